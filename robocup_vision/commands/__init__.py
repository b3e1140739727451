"""The commands of `robocup-vision`, one file each: options in, calls, prints."""

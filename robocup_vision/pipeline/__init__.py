"""The steps from one frame to one view, for each kind of camera."""

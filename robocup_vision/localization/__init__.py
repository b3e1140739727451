"""From what a frame shows to a pose on the field."""

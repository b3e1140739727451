"""From the evidence of a frame to a pose on the field."""

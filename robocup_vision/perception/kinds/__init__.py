"""Whether a robot or a person stands on the floor."""

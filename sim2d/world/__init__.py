"""The physical world of a match: robots, ball, walls and rules in one pymunk space."""

"""How a player gets to a target: the way, the speed, the command."""

"""Balls in one frame: where a ball may lie, how large it is there, and how likely each find is one."""

"""Where a robot is by what hangs on the walls: a map of landmarks from three cameras, and poses from one."""

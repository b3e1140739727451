"""When loops are compiled, and where compiled code is kept."""

"""Layout of the league's messages, and their conversion to values and bytes."""

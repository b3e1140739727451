"""Compiled loops that find balls: blobs of a colour on the floor, what speaks for each, and balls with dark patches."""

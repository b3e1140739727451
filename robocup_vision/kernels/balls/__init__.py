"""Compiled loops that find balls: coloured blobs on the floor, their likelihood ratios, and balls with dark patches."""

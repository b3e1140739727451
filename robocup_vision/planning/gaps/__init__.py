"""Choice of a gap: gaps of uncertain width, the gate problem, and the choice among several."""

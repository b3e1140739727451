"""Which gap to take: gaps of uncertain width, the gate problem, and the choice among several."""

"""sim2d as a simulator of the small-size league, for any team that uses the league's protocols."""

"""sim2d as a simulator of the small-size league: it speaks the league's protocols to anybody's team."""

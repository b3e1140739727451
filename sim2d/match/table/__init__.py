"""The table of a tournament in which all players meet each other."""

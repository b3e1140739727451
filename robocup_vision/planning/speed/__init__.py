"""How fast to go along a path, among opponents and over floor that is not decided yet."""

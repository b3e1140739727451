"""How answers are compared with the truth."""

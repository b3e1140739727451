"""Speeds along a path, among opponents and over undecided floor."""

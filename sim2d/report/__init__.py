"""What a match was worth: figures, match.json, film and report."""

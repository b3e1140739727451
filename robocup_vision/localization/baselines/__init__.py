"""Published methods, kept for comparison: no production code calls them but by name."""

"""Other libraries' methods, adapted for comparison."""

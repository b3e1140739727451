"""What stands on the floor."""

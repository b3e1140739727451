"""A forward camera by pictures of a field: its lens and how it is mounted."""

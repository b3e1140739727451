"""Several cameras in one process."""

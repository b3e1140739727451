"""The mirror camera's frame: accuracy, time, and the paper's table."""

"""A pinhole camera's pose by all edges in the field file: followed from frame to frame, or found without a prior."""

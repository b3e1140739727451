"""A pinhole camera's pose by everything that the field file knows of: followed from frame to frame, or found anew."""

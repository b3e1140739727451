"""A landmark map made from a run with three cameras: stereo points, their association, the joint adjustment."""

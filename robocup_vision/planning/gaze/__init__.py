"""Where to turn the head or look again: to know the pose, to tell two poses apart, to decide the floor ahead."""

"""What a robot in the simulator senses, with its faults."""

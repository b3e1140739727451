"""The small-size league's network: how fast and how punctually it is served, and what decoders bear."""

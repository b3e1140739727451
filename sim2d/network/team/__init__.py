"""A team of the small-size league that plays by overhead vision, with the robots of any league simulator."""

"""A team of the small-size league by overhead vision: it drives robots of any league simulator."""

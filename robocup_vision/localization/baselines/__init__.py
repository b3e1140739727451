"""Published methods for comparison, which run only when they are named."""

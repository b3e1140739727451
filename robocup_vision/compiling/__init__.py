"""Compilation of loops, and the cache of compiled code."""

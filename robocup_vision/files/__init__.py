"""Reads and writes the files that other programs share with this one: images, videos, tables, folders."""

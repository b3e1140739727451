"""Reads and writes files that other programs use as well: images, videos, tables, folders."""

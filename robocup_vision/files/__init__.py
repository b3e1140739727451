"""Reads and writes files in common formats: images, videos, tables, folders."""

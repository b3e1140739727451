"""What the library measures of itself: a folder a capability, a program a measured thing.

Run one as ``python -m benchmarks.FOLDER.NAME`` or ``python benchmarks/FOLDER/NAME.py`` from the repository's root, all
of them as ``python -m benchmarks``. The second form needs the editable install (``make .venv``), which puts the root on
Python's path.
"""

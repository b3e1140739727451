"""Compiled loops for the computations that NumPy and OpenCV cannot do within a frame's time.

They are plain functions of arrays, one file for each concept; the wrappers that give the arrays meaning live elsewhere.
"""

from pathlib import Path

from robocup_vision.compiling.compile_cache import ensure_compile_cache

ensure_compile_cache(Path(__file__).parent)

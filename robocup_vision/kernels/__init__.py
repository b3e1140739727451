"""Compiled loops: what NumPy and OpenCV cannot do in the time a frame has.

Everything here is a plain function of arrays, one file per concept it serves. The wrappers that give the arrays meaning
live beside that concept.
"""

from pathlib import Path

from robocup_vision.compiling.compile_cache import ensure_compile_cache

ensure_compile_cache(Path(__file__).parent)

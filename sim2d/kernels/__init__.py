"""Compiled loops of the simulator; each is held against a plain NumPy twin by the tests."""

from pathlib import Path

from robocup_vision.compiling.compile_cache import ensure_compile_cache

ensure_compile_cache(Path(__file__).parent)

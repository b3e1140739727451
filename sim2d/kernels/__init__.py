"""Compiled loops of the simulator; each is held against a plain NumPy twin by the tests."""

from pathlib import Path

from robocup_vision.compiling.compile_cache import ensure_compile_cache, remove_stale_loops

ensure_compile_cache(Path(__file__).parent)
remove_stale_loops(Path(__file__).parent)

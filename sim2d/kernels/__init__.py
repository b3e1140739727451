"""Compiled loops of the simulator."""

from pathlib import Path

from robocup_vision.compiling.compile_cache import ensure_compile_cache

ensure_compile_cache(Path(__file__).parent)

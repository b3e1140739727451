"""Skips the test modules of the small-size league's network where protobuf, an extra, is not installed."""

import importlib.util
import re

import pytest

_IMPORTS = re.compile(r"^\s*(?:from|import) (?:robocup_vision\.ssl|sim2d\.network|benchmarks\.network)\b", re.MULTILINE)


def has_protobuf():
    try:
        return importlib.util.find_spec("google.protobuf") is not None
    except ModuleNotFoundError:
        return False


class _Skipped(pytest.Module):
    """A module that is not imported, so that its missing imports do not fail the collection."""

    def collect(self):
        pytest.skip("needs protobuf: pip install 'robocup-vision[ssl]'", allow_module_level=True)


def pytest_pycollect_makemodule(module_path, parent):
    if has_protobuf() or not _IMPORTS.search(module_path.read_text(encoding="utf-8")):
        return None
    return _Skipped.from_parent(parent, path=module_path)

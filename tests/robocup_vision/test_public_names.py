"""The names that users import from the package: each exists, none is loaded before it is used."""

import subprocess
import sys

import pytest

import robocup_vision


def test_every_public_name_exists():
    assert "Vision" in robocup_vision.__all__
    for name in robocup_vision.__all__:
        assert getattr(robocup_vision, name).__name__ == name
    assert set(robocup_vision.__all__) <= set(dir(robocup_vision))


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="nothing_of_this_name"):
        robocup_vision.nothing_of_this_name  # noqa: B018


def test_importing_the_package_loads_no_module_of_it():
    code = "import sys, robocup_vision; print(*(name for name in sys.modules if name.startswith('robocup_vision.')))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []

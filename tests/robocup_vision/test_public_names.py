"""The names that users import from the package: each exists, none is loaded before it is used."""

import subprocess
import sys
from importlib import metadata

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


def test_field_errors_and_version_stand_at_the_top_and_load_little():
    assert robocup_vision.__version__ == metadata.version("robocup-vision")
    assert issubclass(robocup_vision.FileError, robocup_vision.RobocupVisionError)
    assert robocup_vision.load_field("ssl_2001").length_m == 2.74
    code = (
        "import sys, robocup_vision as r; r.__version__, r.ArgumentError, r.load_field; print('numba' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False"]

"""The names that users import from the package: each exists."""

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


def test_field_errors_and_version_stand_at_the_top():
    assert robocup_vision.__version__ == metadata.version("robocup-vision")
    assert issubclass(robocup_vision.FileError, robocup_vision.RobocupVisionError)
    assert robocup_vision.load_field("ssl_2001").length_m == 2.74

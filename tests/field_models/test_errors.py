"""Every error is one line that names file, key and value, and survives the way back from a worker process."""

import pickle
from pathlib import Path

import pytest

from field_models import ArgumentError, FileError, FrameError, RobocupVisionError


def test_message_names_file_key_and_value():
    error = FileError("a/b.toml", "must be positive", key="goal.width_m", value=-1.5)
    assert str(error) == "a/b.toml: key 'goal.width_m': must be positive, got -1.5"
    assert (error.path, error.key, error.value) == (Path("a/b.toml"), "goal.width_m", -1.5)


def test_key_and_value_may_be_absent_and_none_is_a_value():
    assert str(FileError("x.toml", "is empty")) == "x.toml: is empty"
    assert str(FileError("x.toml", "is empty", key="k", value=None)) == "x.toml: key 'k': is empty, got None"


@pytest.mark.parametrize("kind", [RobocupVisionError, FrameError, ArgumentError])
def test_message_is_one_line(kind: type[RobocupVisionError]):
    assert str(kind("one\n   two\r\nthree")) == "one two three"
    assert "\n" not in str(FileError("a\nb.toml", "c\nd", key="e\nf", value="g\nh"))


def test_file_name_keeps_its_spaces():
    assert str(FileError("my  images/a.png", "is truncated")) == "my  images/a.png: is truncated"


def test_long_value_is_cut():
    message = str(FileError("x.toml", "is wrong", key="k", value=list(range(10_000))))
    assert len(message) < 200
    assert message.endswith("...")


@pytest.mark.parametrize(
    "error",
    [
        FileError("x.toml", "is wrong", key="k", value=[1, 2]),
        FileError("x.toml", "is wrong"),
        FrameError("grey"),
        ArgumentError("range"),
    ],
)
def test_error_survives_pickling(error: RobocupVisionError):
    back = pickle.loads(pickle.dumps(error))
    assert type(back) is type(error)
    assert str(back) == str(error)
    assert vars(back) == vars(error)


def test_one_base_class_and_arguments_are_value_errors():
    assert all(issubclass(kind, RobocupVisionError) for kind in (FileError, FrameError, ArgumentError))
    assert issubclass(ArgumentError, ValueError)

"""Strict TOML: each kind of damage gives one line with file, key and value."""

from pathlib import Path
from typing import Literal

import pytest

from field_models import FileError
from field_models.toml_file import StrictStruct, convert, load_toml, read_toml


class _Part(StrictStruct):
    size_m: float


class _Whole(StrictStruct):
    count: int
    parts: tuple[_Part, ...] = ()


class _Checked(StrictStruct):
    low: int

    def __post_init__(self) -> None:
        if self.low > 3:
            raise ValueError("low is too high")


def load(tmp_path: Path, text: str | bytes) -> _Whole:
    path = tmp_path / "whole.toml"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return load_toml(path, _Whole)


def test_good_file_becomes_the_struct(tmp_path: Path):
    whole = load(tmp_path, "count = 2\n[[parts]]\nsize_m = 1\n[[parts]]\nsize_m = 2.5\n")
    assert whole == _Whole(count=2, parts=(_Part(size_m=1.0), _Part(size_m=2.5)))
    assert isinstance(whole.parts[0].size_m, float)


def test_byte_order_mark_and_dos_line_ends_do_not_matter(tmp_path: Path):
    assert load(tmp_path, b"\xef\xbb\xbfcount = 2\r\n") == _Whole(count=2)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "key 'count': is missing"),
        ("count = 1\npart = 4", "key 'part': is unknown, got 4; did you mean 'parts'?"),
        (
            "count = 1\n[[parts]]\nsize_m = 1\n[[parts]]\nsize = 2",
            "key 'parts[1].size': is unknown, got 2; did you mean 'size_m'?",
        ),
        ("count = 1\n[[parts]]", "key 'parts[0].size_m': is missing"),
        ("count = 1.5", "key 'count': expected `int`, got `float`, got 1.5"),
        ("count = true", "key 'count': expected `int`, got `bool`, got True"),
        ("count = 1\nparts = 3", "key 'parts': expected `array`, got `int`, got 3"),
        ("count = 1\n[[parts]]\nsize_m = '1'", "key 'parts[0].size_m': expected `float`, got `str`, got '1'"),
        ("count = 1\n[[parts]]\nsize_m = 2001-02-03", "key 'parts[0].size_m': expected `float`, got `date`"),
        ("count = 1\n[[parts]]\nsize_m = nan", "key 'parts[0].size_m': must be a finite number, got nan"),
        ("count = 1\nother = [[1.0, inf]]", "key 'other[0][1]': must be a finite number, got inf"),
        ("count = 1\n[a.b]\nc = -inf", "key 'a.b.c': must be a finite number, got -inf"),
        ("count = 1\n[[parts]]\nsize_m = 1" + "0" * 400, "key 'parts[0].size_m': number out of range, got 1000"),
        ("count = ", "is not valid TOML ("),
        ("count = 1\ncount = 2", "is not valid TOML ("),
        ("count = 1\n'a\tb' = 2", "key 'a\tb': is unknown"),
        ('count = 1\n"a\\nb" = 2', "key 'a b': is unknown"),
        (b"count = 1 # \xff", "is not UTF-8 text"),
    ],
)
def test_bad_file_is_refused_in_one_line(tmp_path: Path, text: str | bytes, message: str):
    with pytest.raises(FileError) as caught:
        load(tmp_path, text)
    assert str(caught.value).startswith(f"{tmp_path / 'whole.toml'}: {message}")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "message"), [("absent.toml", "cannot be read (No such file"), ("", "cannot be read ("), ("a\0b", "cannot")]
)
def test_absent_file_folder_and_impossible_name_are_refused(tmp_path: Path, name: str, message: str):
    with pytest.raises(FileError) as caught:
        read_toml(tmp_path / name)
    assert str(caught.value).startswith(f"{tmp_path / name}: {message}")


def test_bottomless_nesting_is_refused(tmp_path: Path):
    path = tmp_path / "deep.toml"
    path.write_text("a = " + "[" * 20_000 + "]" * 20_000)
    with pytest.raises(FileError):
        read_toml(path)


def test_a_check_of_the_whole_struct_does_not_print_the_whole_file():
    with pytest.raises(FileError) as caught:
        convert("x.toml", {"low": 4}, _Checked)
    assert str(caught.value) == "x.toml: low is too high"


def test_key_that_cannot_be_looked_up_is_still_named():
    with pytest.raises(FileError, match=r"x\.toml: key 'a\.b': is unknown$"):
        convert("x.toml", {"count": 1, "a.b": 2}, _Whole)


class _First(StrictStruct, tag_field="kind", tag="first"):
    size: int


class _Second(StrictStruct, tag_field="kind", tag="second"):
    pass


class _Worded(StrictStruct):
    color: Literal["red", "blue"] = "red"
    parts: tuple[_First | _Second, ...] = ()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "color = 'green'",
            "key 'color': is not a value that this version reads: must be 'blue' or 'red', got 'green'",
        ),
        ("[[parts]]\nkind = 'third'", "key 'parts[0].kind': must be 'first' or 'second', got 'third'"),
    ],
)
def test_the_words_that_are_allowed_are_listed(tmp_path: Path, text: str, message: str):
    path = tmp_path / "worded.toml"
    path.write_text(text)
    with pytest.raises(FileError) as caught:
        load_toml(path, _Worded)
    assert str(caught.value) == f"{path}: {message}"

"""Reads TOML strictly: the result is a typed struct, or an error that names file, key and value."""

from __future__ import annotations

import math
import re
import sys
from pathlib import Path
from typing import Any, TypeVar

import msgspec
from msgspec import inspect

from field_models.errors import ArgumentError, FileError
from field_models.near_names import did_you_mean

if sys.version_info >= (3, 11):
    import tomllib
else:  # ROS 2 Humble ships Python 3.10
    import tomli as tomllib

T = TypeVar("T")
# keys that only one kind of file has
_KINDS = {
    "camera file": {"model", "size_px"},
    "field file": {"length_m", "width_m"},
    "rig file": {"cameras"},
    "dataset file": {"camera", "images"},
    "colour file": {"floor", "line"},
}
_BOUNDS = {"<=": "at most", ">=": "at least", "<": "below", ">": "above"}


class StrictStruct(msgspec.Struct, forbid_unknown_fields=True, kw_only=True):
    """Base of every file format: unknown keys are refused."""


def read_toml(path: str | Path) -> dict[str, Any]:
    """Parse a TOML file into plain values; NaN, infinity and integers beyond 64 bits are refused.

    Raises
    ------
    FileError
        If the file cannot be read, is not TOML, or holds a number that is refused.
    """
    if not isinstance(path, (str, Path)):
        raise ArgumentError(f"the path of a file must be a str or Path, got {type(path).__name__} {path!r}")
    try:
        # "-sig": some editors put a byte order mark in front
        raw = tomllib.loads(Path(path).read_text(encoding="utf-8-sig"))
    except OSError as error:
        hint = _near_file(Path(path)) if isinstance(error, FileNotFoundError) else ""
        raise FileError(path, f"cannot be read ({error.strerror or error})", hint=hint) from None
    except UnicodeDecodeError:
        raise FileError(path, "is not UTF-8 text") from None
    except tomllib.TOMLDecodeError as error:
        raise FileError(path, f"is not valid TOML ({error})") from None
    except RecursionError:
        raise FileError(path, "is nested too deeply") from None
    except ValueError as error:  # a NUL in the path
        raise FileError(path, f"cannot be read ({error})") from None
    _refuse_non_finite(path, raw, "")
    return raw


def convert(path: str | Path, raw: Any, struct: type[T]) -> T:
    """Convert plain values to a struct type.

    Raises
    ------
    FileError
        If a key is missing or unknown, or its value is not allowed; it names the first such key and its value.
    """
    try:
        return msgspec.convert(raw, struct)
    except msgspec.ValidationError as error:
        if isinstance(raw, dict):
            refuse_other_kind(path, raw, struct)
        problem, _, where = str(error).partition(" - at `")
        key = where.rstrip("`").removeprefix("$").lstrip(".")
        named = re.search(r"(?:required field|unknown field) `([^`]+)`", problem)
        if named is not None:
            inside = f"{key}." if key else ""
            missing = "required" in problem
            unknown_value = ... if missing else _look_up(raw, f"{inside}{named[1]}")
            known = () if missing else _keys(struct, key)
            raise FileError(
                path,
                "is missing" if missing else "is unknown",
                key=f"{inside}{named[1]}",
                value=unknown_value,
                hint=did_you_mean(named[1], known),
            ) from None
        if problem.startswith("Invalid enum value"):
            words = " or ".join(repr(word) for word in _allowed(struct, key))
            problem = "is not a value that this version reads" + (f": must be {words}" if words else "")
        elif problem.startswith("Invalid value "):
            words = " or ".join(repr(word) for word in _allowed(struct, key))
            problem = f"must be {words}" if words else problem
        elif (bound := re.fullmatch(r"Expected `(?:int|float)` ([<>]=?) (\S+)", problem)) is not None:
            problem = f"must be {_BOUNDS[bound[1]]} {bound[2]}"
        value = _look_up(raw, key) if key else ...
        raise FileError(path, problem[0].lower() + problem[1:], key=key or None, value=value) from None


def load_toml(path: str | Path, struct: type[T]) -> T:
    """Read a TOML file straight into a struct type."""
    return convert(path, read_toml(path), struct)


def refuse_other_kind(path: str | Path, raw: dict[str, Any], struct: type[Any]) -> None:
    """Refuse a file of another kind as a whole, which is clearer than an error about one of its keys.

    Raises
    ------
    FileError
        If the keys belong to another kind of file than the struct type does.
    """
    found = next((kind for kind, keys in _KINDS.items() if keys <= raw.keys()), None)
    wanted = next((kind for kind, keys in _KINDS.items() if keys <= {*struct.__struct_fields__}), None)
    if found is None or wanted is None or found == wanted:
        return
    swapped = ": are the two swapped?" if {found, wanted} == {"camera file", "field file"} else ""
    raise FileError(path, f"is a {found}, must be a {wanted}{swapped}")


def _near_file(path: Path) -> str:
    """Return a hint that names a TOML file with a similar name in the same folder; empty if there is none."""
    try:
        return did_you_mean(path.name, sorted(entry.name for entry in path.parent.glob("*.toml")))
    except OSError:
        return ""


def _allowed(struct: type[Any], key: str) -> tuple[object, ...]:
    """Return the values that a key may have, if the struct type lists them; else none."""
    return tuple(
        value for node in _types_of(struct, key) if isinstance(node, inspect.LiteralType) for value in node.values
    )


def _keys(struct: type[Any], key: str) -> tuple[str, ...]:
    """Return the keys of the table at a key."""
    tables = (node for node in _types_of(struct, key) if isinstance(node, inspect.StructType))
    return tuple(one.encode_name for table in tables for one in table.fields)


def _types_of(struct: type[Any], key: str) -> list[Any]:
    """Return the types that a key's value may have."""
    nodes: list[Any] = [inspect.type_info(struct)]
    for part in re.findall(r"[^.\[\]]+|\[\.*\]", key):
        inner: list[Any] = []
        for node in nodes:
            if isinstance(node, inspect.StructType):
                if node.tag_field == part:
                    inner.append(inspect.LiteralType((node.tag,)))
                inner += [one.type for one in node.fields if one.encode_name == part]
            elif isinstance(node, (inspect.VarTupleType, inspect.ListType)):
                inner.append(node.item_type)
            elif isinstance(node, inspect.TupleType):
                inner += node.item_types
        nodes = [one for node in inner for one in (node.types if isinstance(node, inspect.UnionType) else (node,))]
    return nodes


def _look_up(raw: Any, key: str) -> Any:
    try:
        for part in re.findall(r"[^.\[\]]+", key):
            raw = raw[int(part)] if isinstance(raw, list) else raw[part]
    except (KeyError, IndexError, TypeError, ValueError):
        return ...
    return raw


def _refuse_non_finite(path: str | Path, value: Any, key: str) -> None:
    if isinstance(value, dict):
        for name, inner in value.items():
            _refuse_non_finite(path, inner, f"{key}.{name}" if key else name)
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            _refuse_non_finite(path, inner, f"{key}[{index}]")
    elif isinstance(value, float) and not math.isfinite(value):
        raise FileError(path, "must be a finite number", key=key, value=value)
    elif isinstance(value, int) and not -(2**63) <= value < 2**63:
        raise FileError(path, "number out of range", key=key, value=value)

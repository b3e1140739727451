"""Converts messages to frozen values in metres and radians and back, by the annotations of a value's class.

A class names its message with `message_value`; each of its fields is the message's field of the same name unless a
`Wire` states another. A field that may be absent is None then, so that a value written again is the message that was
read, byte for byte. What this project's tables do not know of stays in `unknown`, as bytes; an enum's unknown number is
a member too (`OpenEnum`).
"""

from __future__ import annotations

import re
import types
import typing
from collections.abc import Callable
from dataclasses import dataclass, fields
from enum import IntEnum
from typing import Any, NamedTuple, TypeVar

from field_models.errors import PacketError
from robocup_vision.ssl.protocol.messages import EncodeError, UnknownFieldSet, message_class, parse


class OpenEnum(IntEnum):
    """An enum that has a member for every number; those that it does not know are called e.g. ``unknown stage 14``."""

    @classmethod
    def _missing_(cls, value: object) -> OpenEnum | None:
        if not isinstance(value, int):
            return None
        # not among the members: a sender must not make them more
        member = int.__new__(cls, value)
        kind = re.sub(r"(?<!^)(?=[A-Z])", " ", cls.__name__).lower().rpartition(" ")[2]
        member._name_, member._value_ = f"unknown {kind} {value}", value
        return member

    def __str__(self) -> str:
        return self.name

    @property
    def is_known(self) -> bool:
        """Whether this version has a name for it."""
        return self.name in type(self).__members__


T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Wire:
    """How a field stands in the message."""

    name: str  #: its name there
    per_unit: float = 1.0  #: how many of the message's units make one of the value's (1000: millimetres for metres)


class _Field(NamedTuple):
    """One field of a value: its own name, that in the message, its kind, and how it is converted (None: as it is)."""

    attribute: str
    name: str
    optional: bool
    repeated: bool
    nested: bool
    read: Callable[[Any], Any] | None
    write: Callable[[Any], Any] | None


class _Mapping(NamedTuple):
    message: Any
    fields: tuple[_Field, ...]


_NAMES: dict[type, str] = {}
_MAPPINGS: dict[type, _Mapping] = {}


def message_value(name: str) -> Callable[[type[T]], type[T]]:
    """Return a class decorator that names the message of a frozen value, e.g. ``vision.SSL_DetectionBall``."""

    def decorate(cls: type[T]) -> type[T]:
        _NAMES[cls] = name
        return cls

    return decorate


def decode(cls: type[T], data: bytes) -> T:
    """Return the value of a class that some bytes are.

    Raises
    ------
    PacketError
        If they are no such message, lack a required field, or hold a text that is not UTF-8.
    """
    value: T = _from_message(cls, parse(_NAMES[cls], data))
    return value


def encode(value: Any) -> bytes:
    """Return a value as its message's bytes.

    Raises
    ------
    PacketError
        If one of its numbers does not fit into its field.
    """
    try:
        data: bytes = _to_message(value).SerializeToString()
    except (EncodeError, ValueError, TypeError, OverflowError) as error:
        raise PacketError(f"a {type(value).__name__} cannot be written: {error}") from None
    return data


def _from_message(cls: type, message: Any) -> Any:
    values: dict[str, Any] = {}
    for attribute, name, optional, repeated, _, read, _ in _mapping(cls).fields:
        if repeated:
            entries = getattr(message, name)
            values[attribute] = tuple(entries) if read is None else tuple([read(entry) for entry in entries])
        elif optional and not message.HasField(name):
            values[attribute] = None
        else:
            found = getattr(message, name)
            values[attribute] = found if read is None else read(found)
    if len(UnknownFieldSet(message)):
        values["unknown"] = _unknown_bytes(message)
    return cls(**values)


def _unknown_bytes(message: Any) -> bytes:
    rest = type(message)()
    rest.CopyFrom(message)
    for field, _ in rest.ListFields():
        rest.ClearField(field.name)
    data: bytes = rest.SerializePartialToString()
    return data


def _to_message(value: Any) -> Any:
    message = _mapping(type(value)).message()
    _fill(message, value)
    return message


def _fill(message: Any, value: Any) -> None:
    """Write a value into an empty message."""
    for attribute, name, _, repeated, nested, _, write in _mapping(type(value)).fields:
        given = getattr(value, attribute)
        if given is None:
            continue
        if not (nested or repeated):
            setattr(message, name, given if write is None else write(given))
        elif not repeated:
            inner = getattr(message, name)
            inner.SetInParent()
            _fill(inner, given)
        elif nested:
            add = getattr(message, name).add
            for entry in given:
                _fill(add(), entry)
        else:
            getattr(message, name).extend(given if write is None else [write(entry) for entry in given])
    if value.unknown:
        message.MergeFromString(value.unknown)


def _mapping(cls: type) -> _Mapping:
    mapping = _MAPPINGS.get(cls)
    if mapping is None:
        mapping = _MAPPINGS[cls] = _build(cls)
    return mapping


def _build(cls: type) -> _Mapping:
    message = message_class(_NAMES[cls])
    hints = typing.get_type_hints(cls, include_extras=True)
    found = []
    for field in fields(cls):
        if field.name == "unknown":
            continue
        hint, wire = hints[field.name], Wire(field.name)
        if typing.get_origin(hint) is typing.Annotated:
            hint, wire = typing.get_args(hint)
        repeated = typing.get_origin(hint) is tuple
        optional = isinstance(hint, types.UnionType)
        if repeated or optional:
            hint = typing.get_args(hint)[0]
        nested = hint in _NAMES
        read, write = _conversion(hint, wire.per_unit, message.DESCRIPTOR.fields_by_name[wire.name])
        found.append(_Field(field.name, wire.name, optional, repeated, nested, read, write))
    return _Mapping(message, tuple(found))


def _conversion(
    hint: type, per_unit: float, field: Any
) -> tuple[Callable[[Any], Any] | None, Callable[[Any], Any] | None]:
    """Return how one entry of a field is read and written, None where it stays as it is."""
    if hint in _NAMES:
        return lambda message: _from_message(hint, message), None
    if issubclass(hint, OpenEnum):
        return hint, int
    if hint is str:
        return _text, None
    if per_unit == 1.0:
        return None, None
    whole = field.cpp_type not in (field.CPPTYPE_FLOAT, field.CPPTYPE_DOUBLE)
    if whole:
        return lambda number: number / per_unit, lambda value: round(value * per_unit)
    return lambda number: number / per_unit, lambda value: value * per_unit


def _text(value: Any) -> Any:
    # the runtime returns bytes where a text is not UTF-8
    if isinstance(value, bytes):
        raise PacketError(f"the text {value[:40]!r} is not UTF-8")
    return value

"""The league's messages as frozen values in metres and radians: how a value's class is laid out as a message.

A class names its message with `message_value`; each of its fields states its number there, and what else differs, by a
`Wire`. The league's .proto files are not used, nor modules that protoc makes of them: each field would stand twice, and
such modules share one pool of the protobuf runtime with those that a team's own program may load of the same messages,
where the second to come is refused. Here the runtime gets the classes' own layout, in a pool apart.

A field that may be absent is None then, so that a value written again is the message that was read, byte for byte. A
field that the class does not have stays in `unknown`, as bytes. Enums are open, as those of proto3: a number that a
later version of the league's files may have is a member too (`OpenEnum`).
"""

from __future__ import annotations

import dataclasses
import re
import types
import typing
from collections.abc import Callable
from dataclasses import dataclass, fields
from enum import IntEnum
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar, cast

from field_models.errors import PacketError, RobocupVisionError

try:
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
    from google.protobuf.message import DecodeError, EncodeError
    from google.protobuf.unknown_fields import UnknownFieldSet
except ImportError:
    raise RobocupVisionError(
        "the small-size league's messages need protobuf, which is not installed: pip install 'robocup-vision[ssl]'"
    ) from None

if TYPE_CHECKING:
    from typing import dataclass_transform
else:
    # it is for type checkers alone, and Python 3.10 has none
    dataclass_transform = lambda **_: lambda decorator: decorator  # noqa: E731

_PACKAGE = "robocup_vision"
_Proto = descriptor_pb2.FieldDescriptorProto
_SCALARS = {float: "float", int: "uint32", bool: "bool", str: "string", bytes: "bytes"}
_NAMES: dict[type, str] = {}
_POOL = descriptor_pool.DescriptorPool()


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

    number: int  #: its number there
    name: str = ""  #: its name there, where it is another
    per_unit: float = 1.0  #: how many of the message's units make one of the value's (1000: millimetres for metres)
    #: of a number or text: its protobuf type, where it is none of float, uint32, bool, string and bytes; then "packed",
    #: where repeated ones stand in one piece
    kind: str = ""


class _Field(NamedTuple):
    """One field of a value: its own name, that in the message, its kind, and how it is converted (None: as it is)."""

    attribute: str
    name: str
    optional: bool
    repeated: bool
    nested: bool
    read: Callable[[Any], Any] | None
    write: Callable[[Any], Any] | None
    layout: tuple[int, str, type]  # number, protobuf type, class


@dataclass(frozen=True, slots=True)
class Message:
    """What all values of messages have."""

    unknown: bytes = dataclasses.field(default=b"", kw_only=True)  #: fields of the message that the class does not have


@dataclass_transform(frozen_default=True)
def message_value(name: str) -> Callable[[type[T]], type[T]]:
    """Return a decorator that makes a class a frozen value and names its message, e.g. ``vision.SSL_DetectionBall``."""

    def decorate(cls: type[T]) -> type[T]:
        value = dataclass(frozen=True, slots=True)(cls)
        _NAMES[value] = name
        return value

    return decorate


def decode(cls: type[T], data: bytes) -> T:
    """Return the value of a class that some bytes are.

    Raises
    ------
    PacketError
        If they are no such message, lack a required field, or hold a text that is not UTF-8.
    """
    message = message_class(cast(Any, cls))()
    try:
        message.ParseFromString(data)
    except DecodeError:
        raise PacketError(f"{len(data)} bytes are no {_NAMES[cls]}") from None
    if not message.IsInitialized():
        missing = ", ".join(message.FindInitializationErrors())
        raise PacketError(f"a {_NAMES[cls]} lacks the required {missing}")
    value: T = _from_message(cls, message)
    return value


def encode(value: Any) -> bytes:
    """Return a value as its message's bytes.

    Raises
    ------
    PacketError
        If one of its numbers does not fit into its field.
    """
    message = message_class(cast(Any, type(value)))()
    try:
        _fill(message, value)
        data: bytes = message.SerializeToString()
    except (EncodeError, ValueError, TypeError, OverflowError) as error:
        raise PacketError(f"a {type(value).__name__} cannot be written: {error}") from None
    return data


def _from_message(cls: Any, message: Any) -> Any:
    values: dict[str, Any] = {}
    for attribute, name, optional, repeated, _, read, _, _ in _fields(cls):
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


def _fill(message: Any, value: Any) -> None:
    """Write a value into an empty message."""
    kind: Any = type(value)
    for attribute, name, _, repeated, nested, _, write, _ in _fields(kind):
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


@cache
def _fields(cls: Any) -> tuple[_Field, ...]:
    hints = typing.get_type_hints(cls, include_extras=True)
    found = []
    for field in fields(cls):
        if field.name == "unknown":
            continue
        hint, wire = typing.get_args(hints[field.name])
        repeated, optional = typing.get_origin(hint) is tuple, isinstance(hint, types.UnionType)
        if repeated or optional:
            hint = typing.get_args(hint)[0]
        nested, kind = hint in _NAMES, wire.kind or _SCALARS.get(hint, "")
        read, write = _conversion(hint, wire.per_unit, kind)
        layout = wire.number, kind, hint
        found.append(_Field(field.name, wire.name or field.name, optional, repeated, nested, read, write, layout))
    return tuple(found)


def _conversion(
    hint: type, per_unit: float, kind: str
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
    if "int" in kind:
        return lambda number: number / per_unit, lambda value: round(value * per_unit)
    return lambda number: number / per_unit, lambda value: value * per_unit


def _text(value: Any) -> Any:
    # the runtime returns bytes where a text is not UTF-8
    if isinstance(value, bytes):
        raise PacketError(f"the text {value[:40]!r} is not UTF-8")
    return value


@cache
def message_class(cls: Any) -> Any:
    """Return the protobuf runtime's class of a value's message."""
    _definition(cls)
    return message_factory.GetMessageClass(_POOL.FindMessageTypeByName(message_name(cls)))


def message_name(cls: type) -> str:
    """Return the full name of a value's message in `descriptor_set`."""
    return f"{_PACKAGE}.{_NAMES[cls]}"


def descriptor_set(cls: type) -> bytes:
    """Return the definitions of a value's message and of all in it: a serialised google.protobuf.FileDescriptorSet."""
    found: dict[str, Any] = {}

    def add(file: Any) -> None:
        for needed in file.dependencies:
            add(needed)
        if file.name not in found:
            found[file.name] = descriptor_pb2.FileDescriptorProto()
            file.CopyToProto(found[file.name])

    add(message_class(cls).DESCRIPTOR.file)
    data: bytes = descriptor_pb2.FileDescriptorSet(file=found.values()).SerializeToString()
    return data


@cache
def _definition(cls: Any) -> Any:
    """Return the file that defines a value's message, or an enum; it is in the pool, behind those that it needs."""
    if issubclass(cls, OpenEnum):
        # numbers' names are unique within a package
        package = f"{_PACKAGE}.enums.{cls.__name__}"
        file = descriptor_pb2.FileDescriptorProto(name=f"{package}.proto", package=package, syntax="proto3")
        enum = file.enum_type.add(name=cls.__name__)
        for member in cls:
            enum.value.add(name=member.name, number=member.value)
    else:
        package, _, name = message_name(cls).rpartition(".")
        file = descriptor_pb2.FileDescriptorProto(name=f"{package}.{name}.proto", package=package, syntax="proto2")
        message = file.message_type.add(name=name)
        for field in _fields(cls):
            _define_field(file, message.field.add(name=field.name, number=field.layout[0]), field)
    _POOL.Add(file)
    return file


def _define_field(file: Any, entry: Any, field: _Field) -> None:
    _, kind, of = field.layout
    entry.label = _Proto.LABEL_OPTIONAL if field.optional else _Proto.LABEL_REQUIRED
    if field.repeated:
        entry.label = _Proto.LABEL_REPEATED
    scalar, _, packed = kind.partition(" ")
    if scalar:
        entry.type = getattr(_Proto, f"TYPE_{scalar.upper()}")
        if packed:
            entry.options.packed = True
        return
    needed = _definition(of)
    if needed.name not in file.dependency:
        file.dependency.append(needed.name)
    entry.type = _Proto.TYPE_MESSAGE if field.nested else _Proto.TYPE_ENUM
    entry.type_name = f".{needed.name.removesuffix('.proto')}" + ("" if field.nested else f".{of.__name__}")

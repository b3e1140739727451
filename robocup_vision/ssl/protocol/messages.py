"""The league's messages as classes of google's protobuf runtime, in a pool of their own.

A team's program may load its own compiled modules of the same messages into the runtime's default pool: these here
never meet them. Bytes become a message, or a `PacketError` with what is wrong with them. Enums are open, as those of
proto3: a number that a later version of the league's files may have is read as it is.
"""

from __future__ import annotations

import re
from functools import cache
from typing import Any

from field_models.errors import PacketError, RobocupVisionError
from robocup_vision.ssl.protocol.tables import TABLES

try:
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
    from google.protobuf.message import DecodeError, EncodeError
    from google.protobuf.unknown_fields import UnknownFieldSet
except ImportError:
    raise RobocupVisionError(
        "the small-size league's messages need protobuf, which is not installed: pip install 'robocup-vision[ssl]'"
    ) from None

__all__ = ["EncodeError", "UnknownFieldSet", "descriptor_set", "message_class", "message_name", "parse"]

_PACKAGE, _FILE = "robocup_vision", "robocup_vision.proto"
_ENUM_PACKAGE, _ENUM_FILE = "robocup_vision.enums", "robocup_vision_enums.proto"
_FIELD = re.compile(
    r"(?P<number>\d+) (?P<name>\w+) (?P<type>[\w.]+)(?P<packed> packed)?(?P<label>!|\[\])?"
    r"(?: = (?P<default>[\w.]+))?(?: oneof (?P<oneof>\w+))?"
)
_Proto = descriptor_pb2.FieldDescriptorProto
_SCALARS = {
    "bool": _Proto.TYPE_BOOL,
    "bytes": _Proto.TYPE_BYTES,
    "double": _Proto.TYPE_DOUBLE,
    "float": _Proto.TYPE_FLOAT,
    "int32": _Proto.TYPE_INT32,
    "int64": _Proto.TYPE_INT64,
    "sint64": _Proto.TYPE_SINT64,
    "string": _Proto.TYPE_STRING,
    "uint32": _Proto.TYPE_UINT32,
    "uint64": _Proto.TYPE_UINT64,
}


def parse(name: str, data: bytes) -> Any:
    """Return the message that some bytes are.

    Parameters
    ----------
    name : str
        Table and message, e.g. ``vision.SSL_WrapperPacket``.

    Raises
    ------
    PacketError
        If they are no such message, or one without a required field.
    """
    message = message_class(name)()
    try:
        message.ParseFromString(data)
    except DecodeError:
        raise PacketError(f"{len(data)} bytes are no {name}") from None
    if not message.IsInitialized():
        missing = ", ".join(message.FindInitializationErrors())
        raise PacketError(f"a {name} lacks the required {missing}")
    return message


@cache
def message_class(name: str) -> Any:
    """Return the class of a message, by table and name, e.g. ``referee.Referee.TeamInfo``."""
    return message_factory.GetMessageClass(_pool().FindMessageTypeByName(f"{_PACKAGE}.{name}"))


def message_name(name: str) -> str:
    """Return a message's full name in `descriptor_set`."""
    return f"{_PACKAGE}.{name}"


@cache
def descriptor_set() -> bytes:
    """Return the definitions of all messages: a serialised google.protobuf.FileDescriptorSet."""
    files = []
    for name in (_ENUM_FILE, _FILE):
        files.append(descriptor_pb2.FileDescriptorProto())
        _pool().FindFileByName(name).CopyToProto(files[-1])
    data: bytes = descriptor_pb2.FileDescriptorSet(file=files).SerializeToString()
    return data


@cache
def _pool() -> Any:
    file = descriptor_pb2.FileDescriptorProto(name=_FILE, syntax="proto2", dependency=[_ENUM_FILE])
    enums = descriptor_pb2.FileDescriptorProto(name=_ENUM_FILE, syntax="proto3", package=_ENUM_PACKAGE)
    # full names of messages and enums by table: a type is looked up there
    named = {table: re.findall(r"^(enum|message) ([\w.]+)$", text, re.MULTILINE) for table, text in TABLES.items()}
    pool = descriptor_pool.DescriptorPool()
    file.package = _PACKAGE
    for table, text in TABLES.items():
        # each table is a name space of its own: several have a RobotId
        space, enum_space = file.message_type.add(name=table), enums.message_type.add(name=table)
        open_message: Any = None
        open_enum: Any = None
        for line in text.strip().splitlines():
            kind, _, name = line.partition(" ")
            if kind == "message":
                open_message, open_enum = _nested(space, name).nested_type.add(name=name.split(".")[-1]), None
            elif kind == "enum":
                outer, _, short = name.rpartition(".")
                around = enum_space if not outer else enum_space.nested_type.add(name=outer + short)
                open_enum = around.enum_type.add(name=short)
            elif open_enum is not None:
                for entry in line.split():
                    label, _, number = entry.partition("=")
                    open_enum.value.add(name=label, number=int(number))
            else:
                _add_field(open_message, line.strip(), table, named)
    pool.Add(enums)
    pool.Add(file)
    return pool


def _nested(space: Any, name: str) -> Any:
    """Return the message that holds another one: `space` unless the name has a dot."""
    outer = name.rpartition(".")[0]
    if not outer:
        return space
    return next(message for message in space.nested_type if message.name == outer)


def _add_field(message: Any, line: str, table: str, named: dict[str, list[tuple[str, str]]]) -> None:
    match = _FIELD.fullmatch(line)
    if match is None:
        raise ValueError(f"table {table}: {line!r} is no field")
    field = message.field.add(name=match["name"], number=int(match["number"]))
    repeated = match["label"] == "[]"
    labels = {None: _Proto.LABEL_OPTIONAL, "!": _Proto.LABEL_REQUIRED, "[]": _Proto.LABEL_REPEATED}
    field.label = labels[match["label"]]
    if match["type"] in _SCALARS:
        field.type = _SCALARS[match["type"]]
    else:
        kind, home = _home(match["type"], table, named)
        field.type = _Proto.TYPE_ENUM if kind == "enum" else _Proto.TYPE_MESSAGE
        outer, _, short = match["type"].rpartition(".")
        if kind == "enum":
            field.type_name = f".{_ENUM_PACKAGE}.{home}.{outer + short + '.' if outer else ''}{short}"
        else:
            field.type_name = f".{_PACKAGE}.{home}.{match['type']}"
    if match["packed"] and repeated:
        field.options.packed = True
    if match["default"]:
        field.default_value = match["default"]
    if match["oneof"]:
        names = [oneof.name for oneof in message.oneof_decl]
        if match["oneof"] not in names:
            message.oneof_decl.add(name=match["oneof"])
            names.append(match["oneof"])
        field.oneof_index = names.index(match["oneof"])


def _home(type_name: str, table: str, named: dict[str, list[tuple[str, str]]]) -> tuple[str, str]:
    """Return whether a type is an enum or a message, and its table."""
    for home in (table, *named):
        for kind, name in named[home]:
            if name == type_name:
                return kind, home
    raise ValueError(f"table {table}: there is no type {type_name!r}")

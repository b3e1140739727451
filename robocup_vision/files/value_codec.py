"""Values as plain data, exactly: for MessagePack and JSON, and back.

Floats come back bit for bit, infinities and NaN too. Only the classes in a table can be written or read, so that a file
from elsewhere can name nothing but values.
"""

from __future__ import annotations

import base64
import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import Any

import msgspec
import numpy as np

from field_models.errors import ArgumentError, PacketError, RobocupVisionError


class ValueCodec:
    """Converts values to bytes and back.

    Parameters
    ----------
    types : mapping of str to str
        Dataclasses and named tuples that are written by name: class name to module. Fields that are not parameters of a
        dataclass's __init__ are not written.
    """

    def __init__(self, types: Mapping[str, str]) -> None:
        self._types = types

    def pack(self, value: Any) -> bytes:
        """Return a value as MessagePack."""
        return msgspec.msgpack.encode(self.to_plain(value))

    def unpack(self, data: bytes) -> Any:
        """Return the value that was packed.

        Raises
        ------
        PacketError
            If the bytes are not a packed value.
        """
        return self._decoded(msgspec.msgpack.decode, data)

    def to_json(self, value: Any) -> bytes:
        """Return a value as JSON, which a person can read."""
        return msgspec.json.format(msgspec.json.encode(self.to_plain(value)), indent=1)

    def from_json(self, data: bytes) -> Any:
        """Return the value that was written as JSON; raises as `unpack`."""
        return self._decoded(msgspec.json.decode, data)

    def _decoded(self, decode: Callable[[bytes], Any], data: bytes) -> Any:
        try:
            plain = decode(data)
        except (msgspec.MsgspecError, ValueError) as error:
            raise PacketError(f"a recorded value cannot be read ({error})") from None
        return self.from_plain(plain)

    def to_plain(self, value: Any) -> Any:
        """Return a value as numbers, strings, lists and mappings.

        Raises
        ------
        ArgumentError
            If the value, or one inside it, is of a class that is not in the table.
        """
        if value is None or isinstance(value, bool | str):
            return value
        if isinstance(value, bytes):
            return {"bytes": value}
        if isinstance(value, int | np.integer):
            return int(value)
        if isinstance(value, float | np.floating):
            number = float(value)
            return number if math.isfinite(number) else {"float": repr(number)}
        if isinstance(value, np.ndarray):
            if value.dtype.hasobject:
                raise ArgumentError(f"an array of {value.dtype} cannot be recorded")
            return {"array": value.dtype.str, "shape": list(value.shape), "data": value.tobytes()}
        if isinstance(value, Mapping):
            return {"map": [[self.to_plain(key), self.to_plain(item)] for key, item in value.items()]}
        if isinstance(value, Sequence) and type(value).__name__ not in self._types:
            return [self.to_plain(item) for item in value]
        return self._object(value)

    def _object(self, value: Any) -> Any:
        kind = type(value)
        name = kind.__name__
        names = getattr(kind, "_fields", None)
        if names is None and dataclasses.is_dataclass(kind):
            names = [field.name for field in dataclasses.fields(kind) if field.init]
        if self._types.get(name) != kind.__module__ or names is None:
            raise ArgumentError(f"a value of class {kind.__module__}.{name} cannot be recorded")
        return {"class": name, "fields": {field: self.to_plain(getattr(value, field)) for field in names}}

    def from_plain(self, plain: Any) -> Any:
        """Return the value that was made plain; sequences come back as tuples, arrays read-only.

        Raises
        ------
        PacketError
            If it is not the result of `to_plain`.
        """
        try:
            return self._value(plain)
        except (TypeError, KeyError, ValueError, AttributeError, ImportError, RobocupVisionError) as error:
            raise PacketError(f"a recorded value cannot be read ({error})") from None

    def _value(self, plain: Any) -> Any:
        if isinstance(plain, list):
            return tuple(self._value(item) for item in plain)
        if not isinstance(plain, dict):
            return plain
        if "float" in plain:
            return float(plain["float"])
        if "array" in plain:
            return np.frombuffer(_raw(plain["data"]), dtype=np.dtype(plain["array"])).reshape(plain["shape"])
        if "bytes" in plain:
            return _raw(plain["bytes"])
        if "map" in plain:
            return {self._value(key): self._value(item) for key, item in plain["map"]}
        name = plain["class"]
        fields = {key: self._value(item) for key, item in plain["fields"].items()}
        kind = getattr(import_module(self._types[name]), name)
        return kind(**fields)


def _raw(data: bytes | str) -> bytes:
    """Return bytes; JSON has them in base64."""
    return base64.b64decode(data, validate=True) if isinstance(data, str) else data

"""Message types and their CDR encoding, based on rosbags: ROS 2's own types, the soccer messages, and ours.

All functions share one type store, which is made at the first use in 0.2 s. It holds only types, no data.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from field_models.errors import PacketError, RobocupVisionError

_DEFINITIONS = Path(__file__).parent / "definitions.txt"

CALL = "robocup_vision_msgs/msg/Call"


def require_ros_extra() -> None:
    """Raise RobocupVisionError if rosbags and mcap (the extra `ros`) are not installed."""
    try:
        import mcap  # noqa: F401
        import rosbags.typesys  # noqa: F401
    except ImportError as error:
        raise RobocupVisionError(
            f"recordings and ROS messages need rosbags and mcap: pip install 'robocup-vision[ros]' ({error})"
        ) from None


@lru_cache(maxsize=1)
def typestore() -> Any:
    """Return rosbags' store of all types; raises RobocupVisionError if the extra `ros` is not installed."""
    require_ros_extra()
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    added: dict[str, Any] = {}
    for name, (_, fields) in added_types().items():
        added.update(get_types_from_msg("\n".join(fields), name))
    store.register(added)
    return store


def added_types() -> Mapping[str, tuple[str, tuple[str, ...]]]:
    """Return type hash and fields, by name, of the types other than ROS 2's own."""
    types: dict[str, tuple[str, list[str]]] = {}
    name = ""
    for line in _DEFINITIONS.read_text(encoding="utf-8").splitlines():
        if line.startswith(" "):
            types[name][1].append(line.strip())
        elif line and not line.startswith("#"):
            name, type_hash = line.split()
            types[name] = (type_hash, [])
    return {name: (type_hash, tuple(fields)) for name, (type_hash, fields) in types.items()}


def prepare(names: Iterable[str]) -> None:
    """Generate the code for types in advance, which would else delay their first messages by some 20 ms each."""
    for name in names:
        typestore().get_msgdef(name)


def make(name: str, *values: Any) -> Any:
    """Make a message of a type, such as ``std_msgs/msg/Header``, from the values of all its fields in order.

    Arrays of numbers are NumPy arrays. A tuple, also in a list, is made into a message of the field's type.
    """
    store = typestore()
    kinds = (kind for _, kind in store.fielddefs[name][1])
    return store.types[name](*(_field(kind, value) for kind, value in zip(kinds, values, strict=True)))


def _field(kind: Any, value: Any) -> Any:
    if isinstance(value, tuple):
        return make(kind[1], *value)
    if isinstance(value, list):
        of_one = kind[1][0]
        return [_field(of_one, one) for one in value]
    return value


def encode(message: Any) -> bytes:
    """Return the CDR encoding of a message."""
    store = typestore()
    return bytes(store.serialize_cdr(message, message.__msgtype__, little_endian=True))


def decode(data: bytes | memoryview, name: str) -> Any:
    """Return the message of a type that is encoded in CDR; raises PacketError if the bytes are no such message."""
    from rosbags.serde import SerdeError

    try:
        return typestore().deserialize_cdr(data, name)
    except (SerdeError, KeyError, AssertionError) as error:
        raise PacketError(f"the bytes are no {name} ({error})") from None


def definition(name: str) -> str:
    """Return a type's definition with those of the types in it, in MCAP's and Foxglove's format ``ros2msg``."""
    text, _ = typestore().generate_msgdef(name, ros_version=2)
    return str(text)


def type_hash(name: str) -> str:
    """Return a type's hash, RIHS01 (REP-2011)."""
    return str(typestore().hash_rihs01(name))


class FieldDescription(NamedTuple):
    """One field of a type, with the values of type_description_interfaces/FieldType."""

    name: str
    type_id: int
    capacity: int
    string_capacity: int
    nested_type_name: str


def describe(name: str) -> list[tuple[str, tuple[FieldDescription, ...]]]:
    """Return a type's name and fields, then those of all types in it, ordered by name (REP-2011)."""
    described: dict[str, tuple[FieldDescription, ...]] = {}
    waiting = [name]
    while waiting:
        one = waiting.pop()
        fields = described[one] = tuple(_describe_field(*field) for field in typestore().fielddefs[one][1])
        nested = {field.nested_type_name for field in fields} - described.keys() - {""}
        waiting += [other for other in nested if other not in waiting]
    return [(name, described.pop(name)), *sorted(described.items())]


def _describe_field(name: str, kind: Any) -> FieldDescription:
    from rosbags.interfaces import Nodetype
    from rosbags.typesys.store import TIDMAP

    more, capacity = 0, 0
    if kind[0] in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        kind_of_array, (kind, capacity) = kind
        more = 48 if kind_of_array == Nodetype.ARRAY else 96 if capacity else 144
    if kind[0] == Nodetype.NAME:
        return FieldDescription(name, more + 1, capacity, 0, kind[1])
    base, bound = kind[1]
    return FieldDescription(name, more + TIDMAP["bounded_string" if bound else base], capacity, bound or 0, "")


def stamp(t_s: float) -> Any:
    """Return a time in seconds as a ROS time, rounded to nanoseconds."""
    return make("builtin_interfaces/msg/Time", *divmod(to_nanoseconds(t_s), 1_000_000_000))


def header(t_s: float, frame_id: str) -> Any:
    """Return a message header with a time and a frame."""
    return make("std_msgs/msg/Header", stamp(t_s), frame_id)


def to_nanoseconds(t_s: float) -> int:
    """Convert a time from seconds to nanoseconds, rounded."""
    return round(t_s * 1e9)


def time_of(message: Any, now_s: float) -> float:
    """Return a message's stamp, seconds; `now_s` if the stamp is zero."""
    return to_seconds(message.header.stamp) or now_s


def to_seconds(time: Any) -> float:
    """Convert a ROS time to seconds."""
    return float(time.sec) + 1e-9 * float(time.nanosec)

"""Topics of rclpy with messages as bytes, also of types whose ROS packages are not installed.

Messages are passed as CDR bytes, so ROS needs only a type's name, hash and description, which this library provides.
That works only with Fast DDS (rmw_fastrtps_cpp); other middlewares read messages member by member.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from importlib import import_module
from typing import Any

from field_models.errors import FrameError, PacketError, RobocupVisionError
from robocup_vision.messages.types import decode, describe, prepare, type_hash

_FAST_DDS = "rmw_fastrtps_cpp"
_IDENTIFIER = b"rosidl_typesupport_fastrtps_c"
_FIND = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_char_p)
_GET = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p)


def _struct(**fields: Any) -> Any:
    return type("Struct", (ctypes.Structure,), {"_fields_": list(fields.items())})


def _array_of(pointer: Any) -> Any:
    return _struct(data=pointer, size=ctypes.c_size_t, capacity=ctypes.c_size_t)


_String = _array_of(ctypes.c_char_p)
_FieldType = _struct(
    type_id=ctypes.c_uint8,
    capacity=ctypes.c_uint64,
    string_capacity=ctypes.c_uint64,
    nested_type_name=_String,
)
_Field = _struct(name=_String, type=_FieldType, default_value=_String)
_Fields = _array_of(ctypes.POINTER(_Field))
_Type = _struct(type_name=_String, fields=_Fields)
_Types = _array_of(ctypes.POINTER(_Type))
_Description = _struct(type=_Type, referenced=_Types)
_Hash = _struct(version=ctypes.c_uint8, value=ctypes.c_uint8 * 32)
# rosidl_message_type_support_t
_Support = _struct(
    identifier=ctypes.c_char_p,
    **dict.fromkeys(("data", "find", "hash", "description", "sources"), ctypes.c_void_p),
)
# message_type_support_callbacks_t; its functions for serialising are another type's, and are never called
_Callbacks = _struct(namespace=ctypes.c_char_p, name=ctypes.c_char_p, others=ctypes.c_void_p * 5)


def require_rclpy(what: str) -> None:
    """Raise RobocupVisionError without rclpy, which `what` needs."""
    try:
        import rclpy  # noqa: F401
    except ImportError as error:
        raise RobocupVisionError(
            f"{what} needs rclpy: source a ROS 2 installation, or install wheels such as"
            f" ros-kilted-rclpy[fastrtps] ({error})"
        ) from None


def subscribe(
    node: Any,
    topic: str,
    name: str,
    on_message: Callable[[Any], None],
    on_problem: Callable[[str], None],
    depth: int,
    *,
    is_latched: bool = False,
) -> Any:
    """Subscribe to a topic with messages of a type; return rclpy's subscription.

    `on_problem` is called with the problem of an invalid message. From a latched topic, earlier messages are received,
    too. Raises RobocupVisionError if the type is not installed and cannot be made.
    """
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

    kind = raw_class(name)
    if kind is None:
        raise RobocupVisionError(f"topic {topic}: message type {name} is not installed")
    prepare([name])
    # a best-effort subscription receives from reliable publishers, too
    quality = QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)
    if is_latched:
        quality = QoSProfile(depth=depth, durability=DurabilityPolicy.TRANSIENT_LOCAL)

    def on_bytes(data: bytes) -> None:
        try:
            on_message(decode(data, name))
        except (PacketError, FrameError) as error:
            on_problem(f"topic {topic}: {error}")

    subscription = node.create_subscription(kind, topic, on_bytes, quality, raw=True)
    forget_error()
    return subscription


@cache
def raw_class(name: str) -> Any:
    """Return a class by which rclpy sends and receives bytes of a type: the installed one, or one made here.

    None if the type's package is not installed and the middleware is not Fast DDS.
    """
    kind = _installed_class(name)
    return _made_class(name) if kind is None else kind


def _installed_class(name: str) -> Any:
    package, _, kind = name.split("/")
    try:
        return getattr(import_module(f"{package}.msg"), kind, None)
    except ImportError:
        return None


def forget_error() -> None:
    """Clear the error state that Fast DDS sets for a type without member tables; the next error would print it."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL("librcutils.so").rcutils_reset_error()


def _made_class(name: str) -> Any:
    from rcl_interfaces.msg import Log
    from rclpy.utilities import get_rmw_implementation_identifier

    if get_rmw_implementation_identifier() != _FAST_DDS:
        return None
    like = type(Log)
    if like._TYPE_SUPPORT is None:
        like.__import_type_support__()
    installed = _Support.from_address(_address_in(like._TYPE_SUPPORT))
    found = _FIND(installed.find)(ctypes.addressof(installed), _IDENTIFIER)
    if not found:
        return None
    kept: list[Any] = []
    package, folder, kind = name.split("/")
    support = _Support.from_buffer_copy(_Support.from_address(found))
    callbacks = _Callbacks.from_buffer_copy(_Callbacks.from_address(support.data))
    callbacks.namespace, callbacks.name = f"{package}::{folder}".encode(), kind.encode()
    support.data = ctypes.addressof(callbacks)
    parts = {"hash": _hash_of(name), "description": _description_of(name, kept), "sources": _Types()}
    for part, value in parts.items():
        getter = _GET(lambda _, address=ctypes.addressof(value): address)
        setattr(support, part, ctypes.cast(getter, ctypes.c_void_p))
        kept += [value, getter]
    # ROS keeps pointers to all of these, so they must not be freed
    kept += [support, callbacks]
    # functions that make and read objects are the other type's, too; they are not used, since only bytes are passed
    meta = type(f"Metaclass_{kind}", (like,), {"_TYPE_SUPPORT": _capsule_of(support), "kept": kept})
    return meta(kind, (), {"__slots__": (), "SLOT_TYPES": ()})


def _hash_of(name: str) -> Any:
    version, digits = type_hash(name).removeprefix("RIHS").split("_")
    return _Hash(int(version), (ctypes.c_uint8 * 32)(*bytes.fromhex(digits)))


def _description_of(name: str, kept: list[Any]) -> Any:
    def array(kind: Any, values: list[Any]) -> tuple[Any, int, int]:
        block = (kind * len(values))(*values)
        kept.append(block)
        return ctypes.cast(block, ctypes.POINTER(kind)), len(values), len(values)

    types = []
    for one, fields in describe(name):
        described = []
        for field in fields:
            kind = _FieldType(field.type_id, field.capacity, field.string_capacity, _text(field.nested_type_name))
            described.append(_Field(_text(field.name), kind, _text("")))
        types.append(_Type(_text(one), _Fields(*array(_Field, described))))
    return _Description(types[0], _Types(*array(_Type, types[1:])))


def _text(text: str) -> Any:
    data = text.encode()
    return _String(data, len(data), len(data) + 1)


def _address_in(capsule: Any) -> int:
    api = ctypes.pythonapi
    api.PyCapsule_GetName.restype, api.PyCapsule_GetName.argtypes = ctypes.c_char_p, [ctypes.py_object]
    api.PyCapsule_GetPointer.restype = ctypes.c_void_p
    api.PyCapsule_GetPointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
    return int(api.PyCapsule_GetPointer(capsule, api.PyCapsule_GetName(capsule)))


def _capsule_of(support: Any) -> Any:
    new = ctypes.pythonapi.PyCapsule_New
    new.restype, new.argtypes = ctypes.py_object, [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]
    return new(ctypes.addressof(support), None, None)

"""Requests of a page: each is one small JSON text, in which all keys are checked before anything is done."""

from __future__ import annotations

from functools import reduce
from operator import or_
from typing import Annotated, Any, Literal

import msgspec
from msgspec.structs import astuple

from field_models.errors import PacketError

# longer messages are not even decoded
MAX_MESSAGE_BYTES = 1024

_Name = Annotated[str, msgspec.Meta(min_length=1, max_length=200)]
_Number = Annotated[int, msgspec.Meta(ge=0, le=2**53)]
_Metres = Annotated[float, msgspec.Meta(ge=-1e3, le=1e3)]
_Angle = Annotated[float, msgspec.Meta(ge=-10.0, le=10.0)]
_Seconds = Annotated[float, msgspec.Meta(ge=0.0, le=1e9)]


# names of the messages, their keys and types of values; those without a comment are described in `Controls`
_MESSAGES: dict[str, list[tuple[str, Any] | tuple[str, Any, Any]]] = {
    # the page has drawn a robot's picture, and may be sent the next one
    "drawn": [("robot", _Name), ("number", _Number)],
    # start or stop finding the markings of frames, which takes longer than the rest of a picture
    "markings": [("on", bool)],
    # pause, or go on with the newest frame
    "pause": [("on", bool)],
    # go some frames forward or back, and pause there
    "step": [("frames", Annotated[int, msgspec.Meta(ge=-10_000, le=10_000)])],
    # go back a number of seconds before the newest frame, and pause there
    "back": [("seconds", _Seconds)],
    "seek": [("t_s", _Seconds)],
    "open": [("recording", _Name), ("t_s", _Seconds, 0.0)],
    "record": [("on", bool)],
    "save": [("robot", _Name), ("number", _Number)],
    "place": [("thing", _Name), ("x_m", _Metres), ("y_m", _Metres), ("theta_rad", _Angle | None, None)],
    "collect": [("on", bool)],
    "calibrate": [("kind", Literal["omni", "pinhole"])],
}
_TYPES = tuple(
    msgspec.defstruct(name, keys, tag=name, tag_field="type", forbid_unknown_fields=True)
    for name, keys in _MESSAGES.items()
)
_DECODER: msgspec.json.Decoder[msgspec.Struct] = msgspec.json.Decoder(reduce(or_, _TYPES))


def read_message(text: str) -> tuple[Any, ...]:
    """Return the name of a page's message, and its values in order.

    Raises PacketError if the text is not a valid message.
    """
    size = len(text.encode("utf-8", "surrogatepass"))
    if size > MAX_MESSAGE_BYTES:
        raise PacketError(f"a message of a page has {size} bytes, may have {MAX_MESSAGE_BYTES}")
    try:
        message = _DECODER.decode(text)
    except (msgspec.MsgspecError, UnicodeEncodeError) as error:
        raise PacketError(f"a message of a page cannot be read: {error}") from None
    return type(message).__name__, *astuple(message)

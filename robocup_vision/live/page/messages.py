"""What a page may ask for: one small JSON text a message, checked key by key before anything is done."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

import msgspec

from field_models.errors import PacketError

# longer messages are not even decoded
MAX_MESSAGE_BYTES = 1024

_Name = Annotated[str, msgspec.Meta(min_length=1, max_length=200)]
_Number = Annotated[int, msgspec.Meta(ge=0, le=2**53)]
_Metres = Annotated[float, msgspec.Meta(ge=-1e3, le=1e3)]
_Angle = Annotated[float, msgspec.Meta(ge=-10.0, le=10.0)]
_Seconds = Annotated[float, msgspec.Meta(ge=0.0, le=1e9)]


class _Asked(msgspec.Struct, tag_field="type", forbid_unknown_fields=True, frozen=True):
    """What all have in common: their tag is the name that `Controls.ask` takes."""


class Drawn(_Asked, tag="drawn", frozen=True):
    """The page has drawn a robot's picture: it may get the next one."""

    robot: _Name
    number: _Number


class Pause(_Asked, tag="pause", frozen=True):
    """Stand still, or go on with the newest."""

    on: bool


class Step(_Asked, tag="step", frozen=True):
    """Go some frames forward or back, and stand still there."""

    frames: Annotated[int, msgspec.Meta(ge=-10_000, le=10_000)]


class Back(_Asked, tag="back", frozen=True):
    """Go to so many seconds before the newest frame, and stand still there."""

    seconds: _Seconds


class Seek(_Asked, tag="seek", frozen=True):
    """Go to a time of a source that can go to times, and stand still there."""

    t_s: _Seconds


class Open(_Asked, tag="open", frozen=True):
    """Open a recording of the folder that is shown, at a time."""

    recording: _Name
    t_s: _Seconds = 0.0


class Record(_Asked, tag="record", frozen=True):
    """Begin or end recording."""

    on: bool


class Save(_Asked, tag="save", frozen=True):
    """Write the picture that a robot's panel shows as a dataset."""

    robot: _Name
    number: _Number


class Place(_Asked, tag="place", frozen=True):
    """Put a robot of a simulation, or its ball, somewhere on the field."""

    thing: _Name
    x_m: _Metres
    y_m: _Metres
    theta_rad: _Angle | None = None


class Collect(_Asked, tag="collect", frozen=True):
    """Begin or end collecting frames for a calibration."""

    on: bool


class Calibrate(_Asked, tag="calibrate", frozen=True):
    """Calibrate a camera of a kind by the collected frames."""

    kind: Literal["omni", "pinhole"]


class ShowMarkings(_Asked, tag="markings", frozen=True):
    """Find the markings of the frames to come, or no more: that takes longer than the rest of a picture."""

    on: bool


Message: TypeAlias = (
    Drawn | Pause | Step | Back | Seek | Open | Record | Save | Place | Collect | Calibrate | ShowMarkings
)

_DECODER: msgspec.json.Decoder[Message] = msgspec.json.Decoder(Message)


def read_message(text: str) -> Message:
    """Return what a page asks for.

    Raises
    ------
    PacketError
        If it is too long, or no such message.
    """
    size = len(text.encode("utf-8", "surrogatepass"))
    if size > MAX_MESSAGE_BYTES:
        raise PacketError(f"a message of a page has {size} bytes, may have {MAX_MESSAGE_BYTES}")
    try:
        return _DECODER.decode(text)
    except (msgspec.MsgspecError, UnicodeEncodeError) as error:
        raise PacketError(f"a message of a page cannot be read: {error}") from None

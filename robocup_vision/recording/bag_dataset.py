"""Recordings and bags as datasets, so that `evaluate` scores them as it scores a folder of images.

Frames, times and odometry come from the topics of images and odometry, truth from a topic of poses. A recording of this
library brings its field, camera and colours along; of any other bag they must be named.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from field_models.catalog import load_field
from field_models.errors import ArgumentError, FileError, FrameError, PacketError
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera.files import load_camera
from robocup_vision.evaluation.dataset import Dataset, FrameTime, Truth
from robocup_vision.evaluation.frame_scorer import make_vision_with_memory
from robocup_vision.evaluation.steering import SteerPlan
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.localization.methods import choose_method
from robocup_vision.messages.images import frame_of
from robocup_vision.messages.topics import pose_of
from robocup_vision.messages.types import to_seconds
from robocup_vision.perception.color_table import load_colors
from robocup_vision.recording.bag import Bag
from robocup_vision.recording.calls import DROPPED, LOOK, STEER
from robocup_vision.recording.log_reader import LogReader
from robocup_vision.recording.recorder import RUN_ATTACHMENT
from robocup_vision.recording.recording import Recording
from robocup_vision.view import View
from robocup_vision.vision import Vision

_IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
_ODOMETRY = ("nav_msgs/msg/Odometry",)
_POSES = (
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/TransformStamped",
    *_ODOMETRY,
)
# poses farther apart than this do not tell where the robot was between them
_MAX_GAP_S = 0.5

Frames = Iterator[UInt8Array | FrameError]
Poses = Sequence[tuple[float, Pose2]]


@dataclass(frozen=True, slots=True)
class BagTopics:
    """Which topics are read; None: the one of a fitting type, if there is just one.

    Parameters
    ----------
    image, truth, odometry : str or None
        Their names.
    """

    image: str | None = None
    truth: str | None = None
    odometry: str | None = None


def _nothing() -> Frames:
    return iter(())


@dataclass(frozen=True, eq=False)
class StreamDataset(Dataset):
    """A dataset whose frames are read in order, from a recording or a bag.

    Parameters
    ----------
    open_frames : callable
        Returns the frames from the first on.
    pans : mapping of float to float
        Pan of the head by the frame's time, where there is one.
    """

    open_frames: Callable[[], Frames] = _nothing
    pans: Mapping[float, float] = field(default_factory=dict)

    @property
    def is_video(self) -> bool:
        """Whether the frames can only be read from the beginning."""
        return True

    def read_frames(self) -> Frames:
        """Read all frames; where one cannot be used, yield the error in its place."""
        width, height = self.camera.size_px
        for name, frame in zip(self.image_names, self.open_frames(), strict=False):
            if isinstance(frame, FrameError) or frame.shape == (height, width, 3):
                yield frame
            else:
                got = f"{frame.shape[1]}x{frame.shape[0]}"
                yield FrameError(f"{name}: is {got}, the camera file says {width}x{height}")


class PannedVision:
    """Looks with the head's pan of each frame: a `VisionLike` of `evaluation.run`.

    Parameters
    ----------
    dataset : Dataset
        Knows the pans.
    vision : Vision
        Looks.
    """

    def __init__(self, dataset: Dataset, vision: Vision) -> None:
        self.vision = vision
        self._pans = dataset.pans if isinstance(dataset, StreamDataset) else {}

    def look(self, frame: UInt8Array, t_s: float | None = None, odometry: Pose2 | None = None) -> View:
        """See `Vision.look`."""
        return self.vision.look(frame, t_s, odometry, pan_rad=None if t_s is None else self._pans.get(t_s))

    def forget(self) -> None:
        """See `Vision.forget`."""
        self.vision.forget()


def make_panned_vision(dataset: Dataset) -> PannedVision:
    """Build the `Vision` of a dataset."""
    vision = Vision(dataset.field, dataset.camera, dataset.colors, method=dataset.method, mask=dataset.mask)
    return PannedVision(dataset, vision)


def make_panned_vision_with_memory(dataset: Dataset) -> PannedVision:
    """Build the `Vision` of a dataset with a memory: see `make_vision_with_memory`."""
    return PannedVision(dataset, make_vision_with_memory(dataset))


def recorded_steering(path: str | Path) -> SteerPlan | None:
    """Return how a recorded robot was steered; None of a bag, and of a recording without a `Steering`.

    Raises
    ------
    FileError
        If a part of the file is damaged.
    """
    path = Path(path)
    if not _is_recording(path):
        return None
    recording = Recording(path)
    run = recording.run.steering
    if run is None:
        return None
    asked: dict[float, Mapping[str, Any]] = {}
    t_s: float | None = None
    for call in recording.calls():
        if call.kind == LOOK:
            t_s = None if call.inputs.get(DROPPED) else call.inputs["t_s"]
            t_s = call.t_s if t_s is None else t_s
        elif call.kind == STEER and t_s is not None:
            asked[t_s] = {name: value for name, value in call.inputs.items() if name != "free_space"}
    return SteerPlan(run.robot_radius_m, run.limits, run.settings, recorded=asked)


def draw_panned(view: View, frame: UInt8Array, vision: PannedVision) -> UInt8Array:
    """Draw a frame with what was found in it."""
    from robocup_vision.overlay import draw

    return draw(view, frame, vision.vision)


def load_bag(
    path: str | Path,
    *,
    field: str | Path | None = None,
    camera: str | Path | None = None,
    colors: str | Path | None = None,
    method: str | None = None,
    topics: BagTopics = BagTopics(),
) -> StreamDataset:
    """Load and check a recording or a bag, without keeping its frames.

    Parameters
    ----------
    path : str or Path
        A recording, a rosbag2 folder, or a .mcap or .db3 file.
    field, camera, colors, method
        As of `load_dataset`; needed where the file is no recording of this library.
    topics : BagTopics
        Which topics are read.

    Raises
    ------
    FileError
        If it cannot be read, a topic is missing or of another type, or it is not clear which one is meant.
    ArgumentError
        If `field` or `camera` is needed, or the method does not fit.
    """
    path = Path(path)
    own = Recording(path) if _is_recording(path) else None
    for name, value in (("field", field), ("camera", camera)):
        if value is None and own is None:
            raise ArgumentError(f"{path}: is no recording of robocup-vision, so --{name} must be given")
    pitch = own.field if field is None and own is not None else load_field(field or "")
    used_camera = own.camera if camera is None and own is not None else load_camera(camera or "")
    used_colors = load_colors(colors) if colors is not None else None if own is None else own.colors
    ran = None if own is None else own.run.vision
    wanted = method if method is not None or ran is None or camera is not None else ran.method
    plain = StreamDataset(
        name=path.stem if path.is_file() else path.resolve().name,
        path=path,
        image_names=(),
        field=pitch,
        camera=used_camera,
        colors=used_colors,
        method=choose_method(used_camera, wanted).name,
        times={},
        truth={},
        mask=None if ran is None or camera is not None else ran.mask,
        symmetry="none" if pitch.halves_differ else "point",
    )
    if own is not None and topics == BagTopics():
        return _of_recording(plain, own)
    return _of_bag(plain, Bag(path), topics)


def _is_recording(path: Path) -> bool:
    return path.suffix == ".mcap" and path.is_file() and RUN_ATTACHMENT in LogReader(path).attachments


def _of_recording(plain: StreamDataset, recording: Recording) -> StreamDataset:
    times: list[FrameTime] = []
    pans: dict[float, float] = {}
    for frame in recording.frames():
        times.append(FrameTime(frame.t_s, frame.odometry))
        if frame.pan_rad is not None:
            pans[frame.t_s] = frame.pan_rad

    def frames() -> Frames:
        return (frame.frame for frame in recording.frames())

    notes = [] if recording.is_whole else [f"{recording.path.name}: was cut off: read up to its last whole chunk"]
    return replace(_timed(plain, times, frames, recording.truth(), notes), pans=pans)


def _of_bag(plain: StreamDataset, bag: Bag, topics: BagTopics) -> StreamDataset:
    image_topic = _topic(bag, "image", topics.image, _IMAGES, required=True)
    odometry_topic = _topic(bag, "odometry", topics.odometry, _ODOMETRY)
    truth_topic = None if topics.truth is None else _topic(bag, "truth", topics.truth, _POSES)
    if topics.truth is None:
        truth_topic = next((name for name in bag.topics if name.endswith("/truth/pose")), None)
    odometry = [] if odometry_topic is None else _poses(bag, odometry_topic)
    times: list[FrameTime] = []
    before: Pose2 | None = None
    for logged_s, message in bag.messages(image_topic or ""):
        t_s = _time_of(message, logged_s)
        there = pose_at(odometry, t_s)
        motion = None if there is None or before is None else before.inverse().compose(there)
        before = there
        times.append(FrameTime(t_s, motion))

    def frames() -> Frames:
        for _, message in bag.messages(image_topic or ""):
            yield _frame_or_error(message)

    notes = [] if bag.is_whole else [f"{bag.path.name}: was cut off: read up to its last whole chunk"]
    truth = [] if truth_topic is None else _poses(bag, truth_topic)
    if truth_topic is not None and not truth:
        notes.append(f"topic {truth_topic} has no message: there is no truth")
    return _timed(plain, times, frames, truth, notes)


def _timed(
    plain: StreamDataset, times: Sequence[FrameTime], frames: Callable[[], Frames], truth: Poses, notes: list[str]
) -> StreamDataset:
    """Return the dataset with its frames; those that are not later than the one before are left out, and counted."""
    kept: list[bool] = []
    names: list[str] = []
    named: dict[str, FrameTime] = {}
    truths: dict[str, Truth] = {}
    last_s, skipped = -math.inf, Pose2(0.0, 0.0, 0.0)
    for index, time in enumerate(times):
        kept.append(time.t_s > last_s)
        if not kept[-1]:
            skipped = skipped if time.odometry is None else skipped.compose(time.odometry)
            continue
        name = f"frame_{index:06d}"
        odometry = None if time.odometry is None else skipped.compose(time.odometry)
        last_s, skipped = time.t_s, Pose2(0.0, 0.0, 0.0)
        names.append(name)
        named[name] = FrameTime(time.t_s, odometry)
        there = pose_at(truth, time.t_s)
        if there is not None:
            truths[name] = Truth(there.x_m, there.y_m, there.theta_rad)
    if not names:
        raise FileError(plain.path, "holds no frame")
    left_out = kept.count(False)
    if left_out:
        notes = [*notes, f"{left_out} frames are not later than the one before: left out"]

    def chosen() -> Frames:
        return (frame for frame, keep in zip(frames(), kept, strict=False) if keep)

    return replace(plain, image_names=tuple(names), times=named, truth=truths, notes=tuple(notes), open_frames=chosen)


def pose_at(poses: Poses, t_s: float) -> Pose2 | None:
    """Return the pose at a time, between the two that are nearest to it.

    Parameters
    ----------
    poses : sequence of (float, Pose2)
        By ascending time, seconds.
    t_s : float
        The time.

    Returns
    -------
    Pose2 or None
        None beyond the first and last one by more than 0.1 ms, and between two that are more than 0.5 s apart.
    """
    slack_s = 1e-4
    at = bisect.bisect_left(poses, t_s, key=lambda pose: pose[0])
    near = [poses[index] for index in (at - 1, at) if 0 <= index < len(poses)]
    for near_s, pose in near:
        if abs(near_s - t_s) <= slack_s:
            return pose
    if len(near) < 2 or near[1][0] - near[0][0] > _MAX_GAP_S:
        return None
    (a_s, a), (b_s, b) = near
    part = (t_s - a_s) / (b_s - a_s)
    turn = wrap_angle(b.theta_rad - a.theta_rad)
    return Pose2(a.x_m + part * (b.x_m - a.x_m), a.y_m + part * (b.y_m - a.y_m), a.theta_rad + part * turn)


def _topic(bag: Bag, use: str, wanted: str | None, types: tuple[str, ...], *, required: bool = False) -> str | None:
    fitting = sorted(name for name, kind in bag.topics.items() if kind in types)
    if wanted is not None:
        if wanted not in bag.topics:
            raise FileError(
                bag.path, f"has no topic for --{use}-topic, only {', '.join(sorted(bag.topics))}", value=wanted
            )
        if wanted not in fitting:
            kinds = " or ".join(types)
            raise FileError(bag.path, f"--{use}-topic {wanted} must be of {kinds}", value=bag.topics[wanted])
        return wanted
    if len(fitting) == 1:
        return fitting[0]
    if not required:
        return None
    if not fitting:
        raise FileError(bag.path, f"has no topic of {' or '.join(types)}")
    raise FileError(bag.path, f"has several topics of images, name one by --{use}-topic: {', '.join(fitting)}")


def _poses(bag: Bag, topic: str) -> list[tuple[float, Pose2]]:
    poses = []
    for logged_s, message in bag.messages(topic):
        if isinstance(message, PacketError):
            raise FileError(bag.path, f"topic {topic}: {message}")
        poses.append((_time_of(message, logged_s), _pose_in(message)))
    return sorted(poses, key=lambda pose: pose[0])


def _pose_in(message: Any) -> Pose2:
    if hasattr(message, "transform"):
        place, turn = message.transform.translation, message.transform.rotation
        return pose_of(_PoseLike(place, turn))
    inner = message.pose
    return pose_of(inner.pose if hasattr(inner, "pose") else inner)


@dataclass(frozen=True, slots=True)
class _PoseLike:
    position: Any
    orientation: Any


def _time_of(message: Any, logged_s: float) -> float:
    """Return when a message's data was taken; when it was logged where its header does not say."""
    if isinstance(message, PacketError):
        return logged_s
    stamp = message.header.stamp
    return to_seconds(stamp) if stamp.sec or stamp.nanosec else logged_s


def _frame_or_error(message: Any) -> UInt8Array | FrameError:
    if isinstance(message, PacketError):
        return FrameError(str(message))
    try:
        return frame_of(message)
    except FrameError as error:
        return error

"""Reads frames, times, odometry and truth from the topics of any bag."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import PurePosixPath
from typing import Any

from field_models.errors import FileError, FrameError, PacketError
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera import OmniCamera, PinholeCamera
from robocup_vision.evaluation.dataset import FrameTime, Truth
from robocup_vision.geometry import Pose2
from robocup_vision.messages.camera_infos import camera_info_problem
from robocup_vision.messages.images import IMAGE_TYPES, frame_of, is_rgb_inside
from robocup_vision.recording.bags.bag import Bag
from robocup_vision.recording.bags.stream import MAX_GAP_S, Frames, StreamDataset, order_note, pose_at, with_frames
from robocup_vision.recording.bags.topic_times import PoseTopic, TopicTimes, rising, stamp_s

_ODOMETRY = ("nav_msgs/msg/Odometry",)
_POSES = (
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/TransformStamped",
    *_ODOMETRY,
)


@dataclass(frozen=True, slots=True)
class BagTopics:
    """Names of the topics to read; None: the only topic of a suitable type.

    Parameters
    ----------
    image, truth, odometry : str or None
        Without `truth`, a topic whose name ends in ``/truth/pose`` is read, if there is one.
    """

    image: str | None = None
    truth: str | None = None
    odometry: str | None = None


def dataset_of_bag(plain: StreamDataset, bag: Bag, topics: BagTopics) -> StreamDataset:
    """Return a dataset with a bag's frames; its notes say which parts of the bag are not used.

    Raises FileError if a topic is missing, ambiguous or of another type, or if there are no frames.
    """
    image_topic = _topic(bag, "image", topics.image, IMAGE_TYPES) or ""
    truth_topic = None if topics.truth is None else _topic(bag, "truth", topics.truth, _POSES)
    if topics.truth is None:
        truth_topic = next((name for name in bag.topics if name.endswith("/truth/pose")), None)
    notes: list[str] = []
    odometry_topic = _odometry_topic(bag, topics.odometry, truth_topic, notes)
    where = f"{bag.path.name}: topic"
    images = _image_times(bag, image_topic, notes)
    if not images.stamps_s:
        raise FileError(bag.path, "; ".join([f"topic {image_topic} has no message", *bag.notes]))
    truth, odometry = (PoseTopic.read(bag, topic) for topic in (truth_topic, odometry_topic))
    # one clock for all: if a topic has no stamps, only the times of logging are common to all
    unstamped = [read.topic for read in (images, truth.times, odometry.times) if not read.has_stamps]
    if unstamped:
        notes.append(
            f"{where} {', '.join(unstamped)}: all stamps are 0: the times of logging are taken, for all topics"
        )
    times_s = images.times_s(by_stamps=not unstamped)
    off = frozenset() if unstamped else images.off
    usable = [index for index in range(len(times_s)) if index not in off]
    kept = [usable[place] for place in rising([times_s[index] for index in usable])]
    if off:
        notes.append(
            f"{where} {image_topic}: {len(off)} of {len(times_s)} frames have a stamp of another clock (the first:"
            f" {times_s[min(off)]:.3f} s, between stamps of {times_s[kept[0]]:.3f} s to {times_s[kept[-1]]:.3f} s):"
            " left out"
        )
    order = [times_s[index] for index in usable]
    notes += order_note(f"{where} {image_topic}", order, [place for place, i in enumerate(usable) if i in set(kept)])
    # messages from after time went back do not belong to the frames before
    span_s = (images.logged_s[kept[0]], images.logged_s[kept[-1]]) if _goes_back(order) else None
    true_poses, moves = (poses.in_time(by_stamps=not unstamped, logged_within_s=span_s) for poses in (truth, odometry))
    notes += truth.notes(where, "only positions are scored") + odometry.notes(where, "not used")
    known_s = [t_s for t_s, pose in true_poses if pose is not None]
    if truth_topic is not None and not known_s:
        notes.append(f"{where} {truth_topic} holds no pose that can be used: there is no truth")
    notes += _camera_info_note(bag, image_topic, plain.camera)
    steps = [_full_pose(pose_at(moves, times_s[index])) for index in kept]
    times = [
        FrameTime(times_s[index], None if before is None or there is None else before.inverse().compose(there))
        for index, before, there in zip(kept, [None, *steps], steps, strict=False)
    ]

    def frames() -> Frames:
        for _, message in bag.messages(image_topic):
            yield _frame_or_error(message)

    dataset = with_frames(plain, len(times_s), kept, times, frames, true_poses, [*bag.notes, *notes])
    if known_s and not dataset.truth:
        note = (
            f"{where} {truth_topic} has poses from {known_s[0]:.3f} s to {known_s[-1]:.3f} s, {image_topic}"
            f" frames from {times[0].t_s:.3f} s to {times[-1].t_s:.3f} s: no frame has a truth (do the clocks differ?)"
        )
        return replace(dataset, notes=(*dataset.notes, note))
    return dataset


def _image_times(bag: Bag, topic: str, notes: list[str]) -> TopicTimes:
    stamps, logged, formats = [], [], set()
    for logged_s, message in bag.messages(topic):
        logged.append(logged_s)
        stamps.append(stamp_s(message))
        formats.add(str(getattr(message, "format", "")))
    swapped = sorted(text for text in formats if is_rgb_inside(text))
    if swapped:
        notes.append(
            f"{bag.path.name}: topic {topic}: format {swapped[0]!r}: its images were compressed as RGB for BGR, as"
            " image_transport reads it: red and blue are exchanged"
        )
    return TopicTimes(topic, tuple(stamps), tuple(logged))


def _goes_back(times_s: Sequence[float]) -> bool:
    return any(after < before - MAX_GAP_S for before, after in pairwise(times_s))


def _full_pose(there: Truth | None) -> Pose2 | None:
    return None if there is None or there.theta_rad is None else Pose2(there.x_m, there.y_m, there.theta_rad)


def _odometry_topic(bag: Bag, wanted: str | None, truth_topic: str | None, notes: list[str]) -> str | None:
    if wanted is not None:
        return _topic(bag, "odometry", wanted, _ODOMETRY)
    # the truth may be of the same type, but is not odometry
    fitting = sorted(name for name, kind in bag.topics.items() if kind in _ODOMETRY and name != truth_topic)
    if len(fitting) > 1:
        named = ", ".join(fitting)
        notes.append(f"{bag.path.name}: has several topics of odometry, none is used (--odometry-topic): {named}")
    return fitting[0] if len(fitting) == 1 else None


def _camera_info_note(bag: Bag, image_topic: str, camera: OmniCamera | PinholeCamera) -> list[str]:
    """Return a note if the camera_info beside the images contradicts the camera file; else nothing."""
    # /camera/image_raw and /camera/image_raw/compressed have /camera/camera_info
    beside = [str(PurePosixPath(folder) / "camera_info") for folder in PurePosixPath(image_topic).parents]
    topic = next((name for name in beside if bag.topics.get(name) == "sensor_msgs/msg/CameraInfo"), None)
    for logged_s, message in () if topic is None else bag.messages(topic):
        if isinstance(message, PacketError):
            continue
        problem = camera_info_problem(message, camera)
        if problem:
            return [f"{bag.path.name}: topic {topic} at {stamp_s(message) or logged_s:.3f} s: {problem}"]
    return []


def _topic(bag: Bag, use: str, wanted: str | None, types: tuple[str, ...]) -> str | None:
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
    if not fitting:
        held = ", ".join(f"{name} of {kind}" for name, kind in sorted(bag.topics.items()))
        raise FileError(bag.path, f"has no topic of {' or '.join(types)}, only {held}")
    raise FileError(bag.path, f"has several topics of images, name one by --{use}-topic: {', '.join(fitting)}")


def _frame_or_error(message: Any) -> UInt8Array | FrameError:
    if isinstance(message, PacketError):
        return FrameError(str(message))
    try:
        return frame_of(message)
    except FrameError as error:
        return error

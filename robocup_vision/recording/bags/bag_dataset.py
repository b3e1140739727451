"""Recordings and bags as datasets, so that `evaluate` can score them like a folder of images.

Frames, times and odometry are read from the topics of images and odometry, truth from a topic of poses. A recording of
this library contains its field, camera and colours; for any other bag, field and camera must be given.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from field_models.catalog import load_field
from field_models.errors import ArgumentError, FileError
from robocup_vision.camera import load_camera
from robocup_vision.evaluation.dataset import FrameTime, Truth
from robocup_vision.evaluation.steering import SteerPlan
from robocup_vision.geometry import Pose2
from robocup_vision.localization.methods import choose_method
from robocup_vision.perception.color_table import load_colors
from robocup_vision.recording.bags.bag import Bag
from robocup_vision.recording.bags.bag_frames import BagTopics, dataset_of_bag
from robocup_vision.recording.bags.stream import Frames, StreamDataset, order_note, with_frames
from robocup_vision.recording.bags.topic_times import rising
from robocup_vision.recording.call_writer import RUN_ATTACHMENT
from robocup_vision.recording.calls import DROPPED, LOOK, STEER
from robocup_vision.recording.log_reader import LogReader
from robocup_vision.recording.recording import Recording


def recorded_steering(path: str | Path) -> SteerPlan | None:
    """Return how a recorded robot was steered; None for a bag, or a recording without a `Steering`.

    Raises FileError if a part of the file is damaged.
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
        As in `load_dataset`; if the file is not a recording of this library, field and camera are needed.

    Raises
    ------
    FileError
        If the file cannot be read, or a topic is missing, ambiguous or of another type.
    ArgumentError
        If `field` or `camera` is needed, or the method does not fit.
    """
    path = Path(path)
    _refuse_several(path)
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
    return dataset_of_bag(plain, Bag(path), topics)


def _is_recording(path: Path) -> bool:
    return path.suffix.lower() == ".mcap" and path.is_file() and RUN_ATTACHMENT in LogReader(path).attachments


def _refuse_several(path: Path) -> None:
    """Refuse a folder of recordings, which are separate runs and not parts of one bag."""
    if path.is_dir():
        found = sorted(entry.name for entry in path.iterdir() if _is_recording(entry))
        if found:
            raise FileError(path, f"is a folder of recordings, name one of them: {', '.join(found)}")


def _of_recording(plain: StreamDataset, recording: Recording) -> StreamDataset:
    given = [FrameTime(frame.t_s, frame.odometry, frame.mounting) for frame in recording.frames()]
    times_s, motions = [time.t_s for time in given], [time.odometry for time in given]

    def frames() -> Frames:
        return (frame.frame for frame in recording.frames())

    kept = rising(times_s)
    name = recording.path.name
    notes = [
        *([] if recording.is_whole else [f"{name}: was cut off: read up to its last whole chunk"]),
        *order_note(name, times_s, kept),
    ]
    truth = [(t_s, Truth(pose.x_m, pose.y_m, pose.theta_rad)) for t_s, pose in recording.truth()]
    moved = zip(kept, _motions(motions, kept), strict=True)
    times = [replace(given[index], odometry=motion) for index, motion in moved]
    return with_frames(plain, len(times_s), kept, times, frames, truth, notes)


def _motions(motions: Sequence[Pose2 | None], kept: Sequence[int]) -> Iterator[Pose2 | None]:
    """Yield the motion before each kept frame, since the last kept one; None if a part of it is unknown."""
    last = -1
    for index in kept:
        motion: Pose2 | None = Pose2(0.0, 0.0, 0.0)
        for step in motions[last + 1 : index + 1]:
            motion = None if motion is None or step is None else motion.compose(step)
        last = index
        yield motion

"""Merges the frames of all overhead cameras: a robot or ball that two cameras see is reported once.

Cameras are neither exposed nor sent at the same time, and each has its own calibration. Near the seam of two images
their measurements differ by millimetres; they are averaged by their confidence. Clocks of cameras may differ, jump and
restart. So the time of reception, and the progress of the other cameras' clocks, show whether a camera still sends.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from robocup_vision.ssl.values.detection import (
    DetectionBall,
    DetectionFrame,
    DetectionRobot,
    VisionPacket,
    finite_frame,
)
from robocup_vision.ssl.values.geometry import CameraCalibration, Geometry

# a frame that is older than the newest by at most this was overtaken on its way; if older, the sender has restarted
_LATE_FRAMES, _LATE_S = 8, 1.0
# no hall has more; the bound keeps a faulty sender from filling the memory
MAX_CAMERAS = 64


@dataclass(frozen=True, slots=True)
class MergeSettings:
    """Thresholds for merging frames of several cameras."""

    #: a camera that sent nothing for this time while another did is ignored: three frames at 60 Hz
    max_age_s: float = 0.05
    #: balls of two cameras nearer than this are one: a ball at 6.5 m/s moves 0.1 m between two exposures at 60 Hz
    max_ball_gap_m: float = 0.1
    #: a number detected at two places farther apart than this, a robot's diameter, was misread at one of them
    max_robot_gap_m: float = 0.18


@dataclass(frozen=True, slots=True)
class Overview:
    """The merged detections of all cameras."""

    t_capture_s: float  #: when the newest of the frames was exposed, by its camera's clock
    balls: tuple[DetectionBall, ...]  #: each ball once
    #: each robot once, in order of their numbers; robots without a number last
    yellow: tuple[DetectionRobot, ...]
    blue: tuple[DetectionRobot, ...]
    cameras: tuple[int, ...]  #: numbers of the cameras whose frames were merged
    problems: tuple[str, ...] = ()  #: ignored detections: numbers seen at two places, and values that are not finite


@dataclass(slots=True)
class _Camera:
    """The newest frame of a camera, when it was received, and the time passed since on each other camera's clock."""

    frame: DetectionFrame
    problems: tuple[str, ...]
    received_s: float
    others_s: dict[int, float]


class CameraMerge:
    """Takes in packets in any order, and merges the newest frame of every camera."""

    def __init__(self, settings: MergeSettings = MergeSettings()) -> None:
        self._settings = settings
        self._seen: dict[int, _Camera] = {}
        self._newest: int | None = None
        self._geometry: Geometry | None = None
        self._cameras: dict[int, CameraCalibration] = {}

    def add(self, packet: VisionPacket, received_s: float | None = None) -> None:
        """Take in a packet; a frame that is older than its camera's newest one is ignored.

        Parameters
        ----------
        received_s : float, optional
            Time of reception, by any monotonic clock; default: now.
        """
        if packet.geometry is not None:
            self._geometry = packet.geometry
            self._cameras.update((camera.camera_id, camera) for camera in packet.geometry.cameras[:MAX_CAMERAS])
            if len(self._cameras) > MAX_CAMERAS:
                self._cameras = {camera.camera_id: camera for camera in packet.geometry.cameras[:MAX_CAMERAS]}
        frame = packet.detection
        if frame is None or not math.isfinite(frame.t_capture_s):
            return
        number, before = frame.camera_id, self._seen.get(frame.camera_id)
        if before is None and len(self._seen) >= MAX_CAMERAS:
            self._seen = {}
        if before is not None:
            behind_s = before.frame.t_capture_s - frame.t_capture_s
            behind = before.frame.frame_number - frame.frame_number
            if 0 < behind_s <= _LATE_S and 0 <= behind <= _LATE_FRAMES:
                return
            if behind_s > _LATE_S or behind > _LATE_FRAMES:
                # the sender has restarted: forget all cameras; those that still send come back with their next frame
                self._seen = {}
            for other, camera in self._seen.items():
                if other != number:
                    camera.others_s[number] = camera.others_s.get(number, 0.0) + max(-behind_s, 0.0)
        finite, problems = finite_frame(frame)
        self._seen[number] = _Camera(finite, problems, time.monotonic() if received_s is None else received_s, {})
        self._newest = number

    @property
    def geometry(self) -> Geometry | None:
        """The newest field with the newest calibration of each camera; None before the first geometry."""
        if self._geometry is None:
            return None
        cameras = tuple(self._cameras[number] for number in sorted(self._cameras))
        return dataclasses.replace(self._geometry, cameras=cameras)

    @property
    def overview(self) -> Overview | None:
        """The merged newest frames of all cameras; None before the first frame."""
        if self._newest is None:
            return None
        newest, most_s = self._seen[self._newest], self._settings.max_age_s
        fresh = [
            camera
            for _, camera in sorted(self._seen.items())
            # a clock that was set back makes an age negative
            if abs(newest.received_s - camera.received_s) <= most_s
            and max(camera.others_s.values(), default=0.0) <= most_s
        ]
        problems = [words for camera in fresh for words in camera.problems]
        return _merged([camera.frame for camera in fresh], newest.frame.t_capture_s, problems, self._settings)


def merge_frames(frames: Iterable[DetectionFrame], settings: MergeSettings = MergeSettings()) -> Overview | None:
    """Merge frames of several cameras; None if there are none.

    Parameters
    ----------
    frames : iterable of DetectionFrame
        At most one per camera, with times of one clock. Frames older than the newest by `max_age_s` are ignored.
    """
    known = sorted((frame for frame in frames if math.isfinite(frame.t_capture_s)), key=lambda frame: frame.camera_id)
    if not known:
        return None
    newest_s = max(frame.t_capture_s for frame in known)
    finite = [finite_frame(frame) for frame in known if newest_s - frame.t_capture_s <= settings.max_age_s]
    problems = [words for _, left_out in finite for words in left_out]
    return _merged([frame for frame, _ in finite], newest_s, problems, settings)


def _merged(
    frames: Sequence[DetectionFrame], newest_s: float, problems: list[str], settings: MergeSettings
) -> Overview:
    """Merge frames that have only finite values and are in order of their cameras."""
    teams: dict[str, tuple[DetectionRobot, ...]] = {}
    for color, robots in (
        ("yellow", [robot for frame in frames for robot in frame.yellow]),
        ("blue", [robot for frame in frames for robot in frame.blue]),
    ):
        teams[color], doubled = _merged_robots(robots, settings.max_robot_gap_m)
        problems += [f"{color} {words}" for words in doubled]
    return Overview(
        newest_s,
        _merged_balls([ball for frame in frames for ball in frame.balls], settings.max_ball_gap_m),
        teams["yellow"],
        teams["blue"],
        tuple(frame.camera_id for frame in frames),
        tuple(problems),
    )


def _merged_balls(balls: Sequence[DetectionBall], gap_m: float) -> tuple[DetectionBall, ...]:
    groups: list[list[DetectionBall]] = []
    for ball in sorted(balls, key=lambda ball: -ball.confidence):
        near = (g for g in groups if math.hypot(g[0].x_m - ball.x_m, g[0].y_m - ball.y_m) < gap_m)
        group = next(near, None)
        if group is None:
            groups.append([ball])
        else:
            group.append(ball)
    return tuple(
        group[0] if len(group) == 1 else dataclasses.replace(group[0], x_m=_mean(group, "x_m"), y_m=_mean(group, "y_m"))
        for group in groups
    )


def _merged_robots(robots: Sequence[DetectionRobot], gap_m: float) -> tuple[tuple[DetectionRobot, ...], list[str]]:
    """Return each robot once, and a text for each number that was seen at two places."""
    by_number: dict[int, list[DetectionRobot]] = {}
    for robot in robots:
        if robot.robot_id is not None:
            by_number.setdefault(robot.robot_id, []).append(robot)
    merged: list[DetectionRobot] = []
    doubled: list[str] = []
    for number, seen in sorted(by_number.items()):
        if len(seen) == 1:
            merged.append(seen[0])
            continue
        best = max(seen, key=lambda robot: robot.confidence)
        group = [robot for robot in seen if _gap_m(robot, best) <= gap_m]
        doubled += [
            f"{number} is seen at ({best.x_m:.2f}, {best.y_m:.2f}) and ({other.x_m:.2f}, {other.y_m:.2f}) m: "
            "the surer one is taken"
            for other in seen
            if _gap_m(other, best) > gap_m
        ]
        if len(group) > 1:
            turned = [robot for robot in group if robot.orientation_rad is not None]
            angle = _mean_angle(turned) if turned else None
            best = dataclasses.replace(best, x_m=_mean(group, "x_m"), y_m=_mean(group, "y_m"), orientation_rad=angle)
        merged.append(best)
    return (*merged, *(robot for robot in robots if robot.robot_id is None)), doubled


def _gap_m(one: DetectionRobot, other: DetectionRobot) -> float:
    return math.hypot(one.x_m - other.x_m, one.y_m - other.y_m)


def _weight(thing: DetectionBall | DetectionRobot) -> float:
    # some senders leave the confidence at zero
    return max(thing.confidence, 1e-3)


def _mean(group: Sequence[DetectionBall] | Sequence[DetectionRobot], name: str) -> float:
    total = sum(_weight(thing) for thing in group)
    return sum(_weight(thing) * float(getattr(thing, name)) for thing in group) / total


def _mean_angle(group: Sequence[DetectionRobot]) -> float:
    angles = [(_weight(robot), robot.orientation_rad or 0.0) for robot in group]
    return math.atan2(sum(w * math.sin(a) for w, a in angles), sum(w * math.cos(a) for w, a in angles))

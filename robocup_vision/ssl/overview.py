"""The frames of all cameras as one look at the field: who stands where two cameras see it is one robot.

Cameras are neither exposed nor sent together, and each is calibrated by itself. What two of them see near the seam of
their images differs by millimetres; both are averaged by their confidence.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from robocup_vision.ssl.values.detection import DetectionBall, DetectionFrame, DetectionRobot, VisionPacket
from robocup_vision.ssl.values.geometry import CameraCalibration, Geometry


@dataclass(frozen=True, slots=True)
class MergeSettings:
    """How frames of several cameras are merged.

    Parameters
    ----------
    max_age_s : float
        A camera whose newest frame is older than the newest of all by more is left out: three frames at 60 Hz.
    max_ball_gap_m : float
        Balls of two cameras nearer than this are one: a ball at 6.5 m/s goes 0.1 m between two exposures at 60 Hz.
    """

    max_age_s: float = 0.05
    max_ball_gap_m: float = 0.1


@dataclass(frozen=True, slots=True)
class Overview:
    """What all cameras saw.

    Parameters
    ----------
    t_capture_s : float
        When the newest of the frames was exposed.
    balls : tuple of DetectionBall
        Each once.
    yellow, blue : tuple of DetectionRobot
        Each once, in order of their numbers; those without a number last.
    cameras : tuple of int
        Whose frames these are.
    """

    t_capture_s: float
    balls: tuple[DetectionBall, ...]
    yellow: tuple[DetectionRobot, ...]
    blue: tuple[DetectionRobot, ...]
    cameras: tuple[int, ...]


class CameraMerge:
    """Takes packets as they come, and has the newest of every camera as one.

    Parameters
    ----------
    settings : MergeSettings
        What counts as one.
    """

    def __init__(self, settings: MergeSettings = MergeSettings()) -> None:
        self._settings = settings
        self._frames: dict[int, DetectionFrame] = {}
        self._geometry: Geometry | None = None
        self._cameras: dict[int, CameraCalibration] = {}

    def add(self, packet: VisionPacket) -> None:
        """Take in a packet; a frame older than the camera's newest is left out."""
        if packet.geometry is not None:
            self._geometry = packet.geometry
            self._cameras.update((camera.camera_id, camera) for camera in packet.geometry.cameras)
        frame = packet.detection
        if frame is not None and math.isfinite(frame.t_capture_s):
            before = self._frames.get(frame.camera_id)
            restarted = before is not None and frame.frame_number < before.frame_number
            if before is None or restarted or frame.t_capture_s >= before.t_capture_s:
                self._frames[frame.camera_id] = frame

    @property
    def geometry(self) -> Geometry | None:
        """The newest field with the newest calibration of each camera; None before any came."""
        if self._geometry is None:
            return None
        cameras = tuple(self._cameras[number] for number in sorted(self._cameras))
        return dataclasses.replace(self._geometry, cameras=cameras)

    @property
    def overview(self) -> Overview | None:
        """The newest frames of all cameras in one; None before any came."""
        return merge_frames(self._frames.values(), self._settings)


def merge_frames(frames: Iterable[DetectionFrame], settings: MergeSettings = MergeSettings()) -> Overview | None:
    """Return frames of several cameras as one, or None of none.

    Parameters
    ----------
    frames : iterable of DetectionFrame
        At most one a camera.
    settings : MergeSettings
        What counts as one.
    """
    known = sorted(frames, key=lambda frame: frame.camera_id)
    if not known:
        return None
    newest_s = max(frame.t_capture_s for frame in known)
    known = [frame for frame in known if newest_s - frame.t_capture_s <= settings.max_age_s]
    return Overview(
        newest_s,
        _merged_balls([ball for frame in known for ball in frame.balls], settings.max_ball_gap_m),
        _merged_robots([robot for frame in known for robot in frame.yellow]),
        _merged_robots([robot for frame in known for robot in frame.blue]),
        tuple(frame.camera_id for frame in known),
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


def _merged_robots(robots: Sequence[DetectionRobot]) -> tuple[DetectionRobot, ...]:
    by_number: dict[int, list[DetectionRobot]] = {}
    for robot in robots:
        if robot.robot_id is not None:
            by_number.setdefault(robot.robot_id, []).append(robot)
    merged = []
    for _, group in sorted(by_number.items()):
        best = max(group, key=lambda robot: robot.confidence)
        if len(group) > 1:
            turned = [robot for robot in group if robot.orientation_rad is not None]
            angle = _mean_angle(turned) if turned else None
            best = dataclasses.replace(best, x_m=_mean(group, "x_m"), y_m=_mean(group, "y_m"), orientation_rad=angle)
        merged.append(best)
    return (*merged, *(robot for robot in robots if robot.robot_id is None))


def _weight(thing: DetectionBall | DetectionRobot) -> float:
    # a sender that does not fill it in sends zero
    return max(thing.confidence, 1e-3)


def _mean(group: Sequence[DetectionBall] | Sequence[DetectionRobot], name: str) -> float:
    total = sum(_weight(thing) for thing in group)
    return sum(_weight(thing) * float(getattr(thing, name)) for thing in group) / total


def _mean_angle(group: Sequence[DetectionRobot]) -> float:
    angles = [(_weight(robot), robot.orientation_rad or 0.0) for robot in group]
    return math.atan2(sum(w * math.sin(a) for w, a in angles), sum(w * math.cos(a) for w, a in angles))

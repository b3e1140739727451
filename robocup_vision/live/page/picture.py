"""Encodes a moment as the bytes that a page draws: JSON with all layers, the frame as JPEG, the map as PNG."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import msgspec
import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.belief import Belief, MapPicture
from robocup_vision.estimates import EdgePoints, EdgeState, NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.image_layers import ImageLayerMaker, Paths, marking_paths
from robocup_vision.live.handover.moment import Moment, RobotSetup, TrueWorld
from robocup_vision.mapping.occupancy import FREE, NO_GO
from robocup_vision.perception.color_table import Colors
from robocup_vision.view import View

# an ellipse of this many standard deviations contains 95 % of a normal distribution in the plane
_ELLIPSE_SIGMAS = 2.448
# hypotheses less probable than this are not shown
_MIN_PROBABILITY = 0.02
# probabilities whose relative difference is smaller count as equal: it is due to rounding
_TIE = 1e-6
# colours of free and no-go cells of the map, BGRA, visible on light and on dark pages
_FREE_BGRA, _NO_GO_BGRA = (110, 200, 60, 70), (40, 60, 220, 110)
# lengths of JSON, JPEG and PNG, little-endian, before the three
_LENGTHS = struct.Struct("<III")


@dataclass(frozen=True, slots=True)
class Picture:
    """One moment, encoded for a page."""

    robot: str  #: name of the robot
    number: int  #: number of the picture among those of the robot, from 1
    t_s: float  #: when the frame was taken
    data: bytes  #: lengths of the three parts as little-endian uint32, then JSON, JPEG and PNG (empty without a map)


class PictureMaker:
    """Makes the pictures of one robot; `jpeg_quality` is from 1 to 100."""

    def __init__(self, setup: RobotSetup, jpeg_quality: int) -> None:
        self.setup = setup
        self._layers = ImageLayerMaker(setup.field)
        self._jpeg = [cv2.IMWRITE_JPEG_QUALITY, jpeg_quality]
        self._number = 0
        self._map: tuple[object, bytes] = (None, b"")

    def make(self, moment: Moment, dropped: int, with_markings: bool = False) -> Picture:
        """Return the picture of a moment.

        `dropped` is the number of this robot's frames that came too late to be shown. The frame's markings are found
        only if `with_markings`.
        """
        self._number += 1
        values = {
            "type": "moment",
            "robot": moment.robot,
            "number": self._number,
            "dropped": dropped,
            **describe(moment, self._layers, with_markings),
        }
        encoded, jpeg = cv2.imencode(".jpg", moment.frame, self._jpeg)
        assert encoded, "OpenCV encodes every (H, W, 3) uint8 array"
        belief = None if moment.view is None else moment.view.belief
        png = b"" if belief is None or belief.free_map is None else self._map_png(belief.free_map)
        json = msgspec.json.encode(values)
        data = b"".join((_LENGTHS.pack(len(json), len(jpeg), len(png)), json, jpeg.tobytes(), png))
        return Picture(moment.robot, self._number, moment.t_s, data)

    def _map_png(self, free_map: MapPicture) -> bytes:
        if self._map[0] is not free_map.state:
            # rows from the top of the page, where y is largest
            state = free_map.state.T[::-1]
            image = np.zeros((*state.shape, 4), dtype=np.uint8)
            image[state == FREE] = _FREE_BGRA
            image[state == NO_GO] = _NO_GO_BGRA
            _, png = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
            self._map = (free_map.state, png.tobytes())
        return self._map[1]


def split_picture(data: bytes) -> tuple[dict[str, Any], bytes, bytes]:
    """Split a picture's data into the values, the JPEG, and the PNG of the map, which is empty without a map."""
    json, jpeg, _ = _LENGTHS.unpack_from(data)
    begin = _LENGTHS.size
    values: dict[str, Any] = msgspec.json.decode(data[begin : begin + json])
    return values, data[begin + json : begin + json + jpeg], data[begin + json + jpeg :]


def describe(moment: Moment, layers: ImageLayerMaker, with_markings: bool = False) -> dict[str, Any]:
    """Return a moment as plain values for JSON: metres and radians, pixels of the frame, times in milliseconds."""
    height, width = moment.frame.shape[:2]
    values: dict[str, Any] = {
        "t_s": round(moment.t_s, 4),
        "size_px": [width, height],
        "problem": moment.problem,
        "rate_hz": moment.rate_hz,
        "truth": None if moment.truth is None else _pose(moment.truth),
        "world": None if moment.world is None else _world(moment.world),
        "command": None if moment.plan.command is None else _rounded(moment.plan.command, 4),
        "way": [_rounded(point, 3) for point in moment.plan.way],
        "reasons": list(moment.plan.reasons),
        "settings": dict(moment.settings or {}),
        "colors": [] if moment.colors is None else _swatches(moment.colors),
    }
    if moment.view is not None:
        values.update(_view(moment.view, layers, moment.truth))
        values["layers"]["markings"] = _all_flat(marking_paths(moment.view)) if with_markings else []
    return values


def _world(world: TrueWorld) -> dict[str, Any]:
    return {
        "robots": [[robot.name, robot.side, *_pose(robot.pose)] for robot in world.robots],
        "ball": None if world.ball_m is None else _rounded(world.ball_m, 4),
    }


def _view(view: View, maker: ImageLayerMaker, truth: Pose2 | None) -> dict[str, Any]:
    layers = maker.layers(view)
    known = view.pose if view.belief is None else view.belief.pose
    values: dict[str, Any] = {
        "frame_pose": _estimate(view.pose),
        "pose": _estimate(known),
        "error": _error(view, truth),
        "from_memory": view.belief is not None,
        "candidates": [_pose(pose) for pose in view.pose.candidates] if view.pose else [],
        "timings_ms": {name: round(1e3 * seconds, 3) for name, seconds in view.timings_s.items()},
        "layers": {
            "edge": _flat(layers.edge_px),
            "lines": _flat(layers.lines_px),
            "free": _flat(layers.free_px),
            "field": _all_flat(layers.field_px),
            "goals": _all_flat(layers.goals_px),
            "obstacles": _all_flat(layers.obstacles_px),
            "ball": _all_flat(layers.ball_px),
            "truth": [] if truth is None else _all_flat(maker.field_at(view.camera, truth)),
            **_edges(view.edge_points),
        },
        "ball": None,
        "free_m": [],
        "obstacles": [],
    }
    if known:
        values.update(_surroundings(view, known.pose))
    if view.belief is not None:
        values.update(_belief(view.belief))
    return values


def _surroundings(view: View, robot: Pose2) -> dict[str, Any]:
    """Return ball, free floor and obstacles in the field frame."""
    values: dict[str, Any] = {}
    if view.ball is not None:
        values["ball"] = _rounded(robot.transform((view.ball.x_m, view.ball.y_m)), 3)
    bearing, range_m = view.free_space.bearing_rad, view.free_space.range_m
    if view.polar is not None and len(bearing):
        reach = np.nan_to_num(range_m)
        corners = np.stack([reach * np.cos(bearing), reach * np.sin(bearing)], axis=1)
        if not view.polar.is_ring:
            corners = np.vstack([corners, [0.0, 0.0]])
        values["free_m"] = _rounded(robot.transform(corners).ravel(), 3)
    values["obstacles"] = [
        [
            *_rounded(robot.transform((thing.x_m, thing.y_m)), 3),
            round(thing.width_m, 3),
            None if thing.hue_rad is None else round(math.degrees(thing.hue_rad)),
        ]
        for thing in view.obstacles
    ]
    return values


def _belief(belief: Belief) -> dict[str, Any]:
    values: dict[str, Any] = {
        "hypotheses": [
            [*_pose(hypothesis.pose), round(hypothesis.probability, 3)]
            for hypothesis in belief.hypotheses
            if hypothesis.probability >= _MIN_PROBABILITY
        ],
        "tracks": [
            [*_rounded((track.x_m, track.y_m, track.vx_mps, track.vy_mps, track.probability), 3), track.number]
            for track in belief.tracks
        ],
    }
    if belief.free_map is not None:
        picture = belief.free_map
        values["map"] = {
            "corner_m": _rounded(picture.corner_m, 4),
            "size_m": _rounded(np.array(picture.state.shape) * picture.cell_m, 4),
        }
    return values


def _estimate(pose: PoseEstimate | NotLocated) -> dict[str, Any]:
    if isinstance(pose, NotLocated):
        return {"located": False, "reason": pose.reason}
    return {
        "located": True,
        "pose": _pose(pose.pose),
        "std": _rounded(pose.std, 5),
        "ellipse": _ellipse(pose.covariance),
        "inlier_ratio": round(pose.inlier_ratio, 3),
        "residual_px": round(pose.residual_px, 2),
    }


def _error(view: View, truth: Pose2 | None) -> list[float] | None:
    """Return the pose's error, metres and radians; of several equally probable poses the smallest error."""
    belief = view.belief
    known = view.pose if belief is None else belief.pose
    if truth is None or isinstance(known, NotLocated):
        return None
    allowed = known.candidates
    if belief is not None:
        most = (1 - _TIE) * max((one.probability for one in belief.hypotheses), default=0.0)
        allowed = (known.pose, *(one.pose for one in belief.hypotheses if one.probability >= most))
    return _rounded(min((pose.error_to(truth) for pose in allowed), key=sum), 5)


def _edges(points: EdgePoints | None) -> dict[str, list[float]]:
    """Return the pixels at which edges of the field were predicted, by whether they are found, hidden or missing."""
    states = (EdgeState.FOUND, EdgeState.HIDDEN, EdgeState.MISSING)
    return {
        state.name.lower(): [] if points is None else _flat(points.pixels[points.state == state]) for state in states
    }


def _ellipse(covariance: FloatArray) -> list[float]:
    """Return both half axes, metres, and the angle of the first, radians, of the ellipse that contains 95 %."""
    values, vectors = np.linalg.eigh(covariance[:2, :2])
    half = _ELLIPSE_SIGMAS * np.sqrt(np.maximum(values, 0.0))
    return _rounded((half[1], half[0], math.atan2(vectors[1, 1], vectors[0, 1])), 4)


@lru_cache(maxsize=8)
def _swatches(colors: Colors) -> list[list[str]]:
    """Return the names of the colour classes and their colours in the present light, as ``#rrggbb``."""
    floor = colors.floor
    lit = floor.lit
    # the level is (R + 2 G + B) / 4
    values = [["floor", _hex(lit.red_ratio, lit.blue_ratio, 4 * floor.level / (lit.red_ratio + 2 + lit.blue_ratio))]]
    for name in ("line", "ball", "goal_positive_x", "goal_negative_x"):
        paint = getattr(colors, name)
        values.append([name, _hex(paint.red_ratio, paint.blue_ratio, None)])
    return values


def _hex(red_ratio: float, blue_ratio: float, green: float | None) -> str:
    """Return the colour with these ratios to green; without a green value it is as bright as possible."""
    rgb = np.array([red_ratio, 1.0, blue_ratio])
    rgb *= 235.0 / rgb.max() if green is None else green
    return "#" + "".join(f"{round(float(value)):02x}" for value in np.clip(rgb, 0, 255))


def _pose(pose: Pose2) -> list[float]:
    return [round(pose.x_m, 4), round(pose.y_m, 4), round(pose.theta_rad, 5)]


def _rounded(values: Any, digits: int) -> list[float]:
    rounded: list[float] = np.round(np.asarray(values, dtype=np.float64), digits).tolist()
    return rounded


def _flat(points: FloatArray) -> list[float]:
    values: list[float] = np.round(points, 1).ravel().tolist()
    return values


def _all_flat(paths: Paths) -> list[list[float]]:
    if not paths:
        return []
    values, begin = _flat(np.concatenate(paths)), 0
    cut = []
    for path in paths:
        cut.append(values[begin : begin + path.size])
        begin += path.size
    return cut

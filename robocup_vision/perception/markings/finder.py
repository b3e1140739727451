"""Search for the field's markings in a frame, with or without a pose."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from field_models.errors import FrameError
from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.perception.line_points import LineFinder, LinePoints
from robocup_vision.perception.markings.arcs import Arc, find_arcs
from robocup_vision.perception.markings.correlated_errors import FloorErrors, common_error_px, with_common_errors
from robocup_vision.perception.markings.crossings import LinePicture, find_crossings
from robocup_vision.perception.markings.field_features import FieldFeatures
from robocup_vision.perception.markings.goal_posts import PostFinder
from robocup_vision.perception.markings.line_pieces import gather_pieces
from robocup_vision.perception.markings.marking import MAX_STD_M, Circle, LineSegment, Markings
from robocup_vision.perception.markings.painted_spots import SpotFinder
from robocup_vision.perception.markings.straight import MIN_POINTS, Straight, find_straight, fit_middles

# greatest differences, in tilt and roll and in logarithms of height and focal length, of cameras that share a line
# finder, because lines have the same width in both
_SAME_TILT_RAD, _SAME_LOG = math.radians(2.0), 0.02
_FINGERPRINT_BYTES = 199
# least number of cells across the picture for which a line's width in pixels is computed
_CELLS_ACROSS = 160


@dataclass(frozen=True, slots=True, eq=False)
class MarkingSource:
    """A frame, of which the markings are computed when needed."""

    finder: MarkingFinder  #: finder of the camera
    frame: UInt8Array  #: (H, W, 3) uint8: BGR
    camera: OmniCamera | PinholeCamera  #: camera at the attitude measured by the frame, or else that of its file
    #: (4, 4) float64: covariance of tilt, roll, height and logarithm of the focal length, if measured by the frame
    held_covariance: FloatArray | None
    fingerprint: bytes  #: fingerprint of the frame when it was looked at

    @classmethod
    def of(
        cls,
        finder: MarkingFinder,
        frame: UInt8Array,
        camera: OmniCamera | PinholeCamera,
        held_covariance: FloatArray | None = None,
    ) -> MarkingSource:
        """Return the source for a frame that is looked at now."""
        return cls(finder, frame, camera, held_covariance, _fingerprint(frame))

    def find(self, pose: PoseEstimate | NotLocated) -> Markings:
        """Return the markings, with their features of the field by a pose.

        Raises
        ------
        FrameError
            If the frame's array has been written to since it was looked at.
        """
        return self.finder.find(self.unchanged_frame("markings"), self.camera, pose, self.held_covariance)

    def unchanged_frame(self, asked: str) -> UInt8Array:
        """Return the frame; `asked` names the result that needs it.

        Raises
        ------
        FrameError
            If the frame's array has been written to since it was looked at.
        """
        if _fingerprint(self.frame) != self.fingerprint:
            raise FrameError(
                f"the frame has been written to since it was looked at: ask for the view's {asked} before, or hand look"
                " a copy"
            )
        return self.frame


def _fingerprint(frame: UInt8Array) -> bytes:
    """Return some pixels of a frame, spread over all of it, which differ between frames by noise alone."""
    flat = frame.reshape(-1)
    return flat[:: max(len(flat) // _FINGERPRINT_BYTES, 1)].tobytes()


class MarkingFinder:
    """Finds markings in successive frames of one camera.

    Parameters
    ----------
    mask : (H, W) uint8, optional
        Non-zero pixels are never used.
    """

    def __init__(self, field: Field, mask: UInt8Array | None = None) -> None:
        self.field, self._mask = field, mask
        self._radii_m = np.round(field.arcs[:, 2], 6)
        # greatest distance of a line of the field from a robot on it
        self._reach_m = math.hypot(field.length_m, field.width_m)
        self._features = FieldFeatures(field)
        self._posts, self._spots = PostFinder(field), SpotFinder(field)
        self._finder: LineFinder | None = None

    def __getstate__(self) -> dict[str, object]:
        # not pickled, because its tables are large and quickly rebuilt
        return {**vars(self), "_finder": None}

    def find(
        self,
        frame: UInt8Array,
        camera: OmniCamera | PinholeCamera,
        pose: PoseEstimate | NotLocated = NotLocated("no pose is given"),
        held_covariance: FloatArray | None = None,
    ) -> Markings:
        """Return the markings in a frame.

        Parameters
        ----------
        camera : OmniCamera or PinholeCamera
            The camera, with a known tilt.
        pose : PoseEstimate or NotLocated
            Pose of the robot on the field, which identifies the markings.
        held_covariance : (4, 4) float64, optional
            Covariance of a forward camera's tilt and roll (rad), height (m) and logarithm of the focal length, if
            measured by the frame; by default that of the camera file.
        """
        markings = self._find(frame, FloorErrors.of(camera, held_covariance))
        return self._features.name(markings, pose) if isinstance(pose, PoseEstimate) else markings

    def _find(self, frame: UInt8Array, errors: FloorErrors) -> Markings:
        field, camera = self.field, errors.camera
        points = self._points(frame, errors)
        posts, spots = tuple(self._posts.find(frame, errors)), tuple(self._spots.find(frame, points, errors))
        if len(points) < MIN_POINTS:
            return Markings(posts=posts, penalty_marks=spots)
        pieces = gather_pieces(points)
        width_m, radii_m = field.line_width_m, self._radii_m
        lines, left, left_pieces = find_straight(points, pieces, camera, width_m, np.unique(radii_m))
        points, lines = fit_middles(points, lines, camera, width_m)
        common_px = common_error_px(points, lines)
        lines = [with_common_errors(points, line, common_px) for line in lines]
        arcs = find_arcs(points, pieces.take(left_pieces), errors, width_m, common_px, radii_m, left)
        picture = LinePicture.of(points, camera.size_px)
        segments = [_segment(line, errors) for line in lines]
        return Markings(
            tuple(one for one in segments if std_at_middle_m(one) <= MAX_STD_M),
            tuple(find_crossings(lines, picture, errors, field.line_width_m)),
            tuple(_circle(arc) for arc in arcs),
            posts,
            spots,
        )

    def _points(self, frame: UInt8Array, errors: FloorErrors) -> LinePoints:
        finder, camera = self._finder, errors.camera
        if finder is None or not _looks_alike(finder.camera, camera):
            across = camera.size_px[0] // _CELLS_ACROSS
            bits = max(0, across.bit_length() - 1)
            finder = LineFinder(camera, self.field.line_width_m, self._mask, bits)
            self._finder = finder
        found = finder.find(frame)
        if finder.camera is not camera:
            found = LinePoints.from_pixels(camera, found.pixels, found.weight, found.bare_floor)
        near = np.hypot(*found.floor_m.T) <= self._reach_m
        # pixels that may be beyond the horizon have no floor place
        near &= np.isfinite(errors.shifts_m(found.pixels)).all(axis=(1, 2))
        return found.take(near)


def _looks_alike(one: object, other: OmniCamera | PinholeCamera) -> bool:
    """Whether lines have the same width for two cameras."""
    if one is other:
        return True
    if not isinstance(one, PinholeCamera) or not isinstance(other, PinholeCamera):
        return False
    turned = abs((one.tilt_rad or 0.0) - (other.tilt_rad or 0.0)), abs((one.roll_rad or 0.0) - (other.roll_rad or 0.0))
    heights = abs(math.log(one.height_m / other.height_m))
    focal = abs(math.log(one.focal_px[0] / other.focal_px[0]))
    return max(turned) <= _SAME_TILT_RAD and max(heights, focal) <= _SAME_LOG


def _circle(arc: Arc) -> Circle:
    x, y = arc.center_m.tolist()
    return Circle(x, y, arc.covariance, arc.radius_m)


def std_at_middle_m(segment: LineSegment) -> float:
    """Return the standard deviation of a segment's place across it, at its middle, metres."""
    middle = (np.array(segment.start_m) + segment.end_m) / 2
    along = float(middle @ [-math.sin(segment.angle_rad), math.cos(segment.angle_rad)])
    row = np.array([-along, 1.0])
    return math.sqrt(max(float(row @ segment.covariance @ row), 0.0))


def _segment(line: Straight, errors: FloorErrors) -> LineSegment:
    """Return a stretch of line as a marking, with the errors of the camera's attitude in its covariance."""
    low, high = line.ends_m
    ends = line.at(np.array([low, high]))
    shifts = errors.shifts_m(errors.camera.floor_to_pixel(ends))
    off = np.einsum("i,eik->ek", line.normal, shifts)
    # the line through the shifted ends
    turn = -(off[1] - off[0]) / max(high - low, 1e-9)
    middle_m = (low + high) / 2
    common = np.stack([turn, off.mean(axis=0) + middle_m * turn])
    covariance = line.covariance + common @ common.T
    angle, distance = line.angle_rad, line.distance_m
    start, end = ends
    if distance < 0:
        angle, distance, start, end = angle + math.pi, -distance, end, start
        covariance = covariance * [[1, -1], [-1, 1]]
    return LineSegment(
        (float(start[0]), float(start[1])),
        (float(end[0]), float(end[1])),
        math.remainder(angle, math.tau),
        distance,
        covariance,
    )

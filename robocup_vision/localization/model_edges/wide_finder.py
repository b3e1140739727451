"""Finds a camera without a prior where its frame shows too little: in a smaller copy, by boards and lines together.

A moving robot blurs its far lines, a line may be two tapes side by side, and few lines are in view. A copy is several
times sharper in its own pixels. The feet of boards are long, and lie beyond every outer line. Often one of four corners
is seen: the answer then has several candidates.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import EdgePoints, NotLocated
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.kernels.model_edges.align import Alignment, align_all, slopes_of
from robocup_vision.kernels.model_edges.bands import LineLook, line_points
from robocup_vision.kernels.model_edges.carpet import carpet_look, carpet_mask
from robocup_vision.kernels.model_edges.find import BINS, best_poses, floor_places, score_bank, upright_bins
from robocup_vision.kernels.model_edges.follow import brightness
from robocup_vision.kernels.model_edges.sightings import SIGHT
from robocup_vision.kernels.model_edges.tables import HEIGHT, ROLL, TILT, UNKNOWNS
from robocup_vision.localization.model_edges.bank import with_walls
from robocup_vision.localization.model_edges.evidence import CandidateSettings
from robocup_vision.localization.model_edges.finder import THOROUGH, EdgeFinder
from robocup_vision.localization.model_edges.follower import EdgeFollower, FollowedCamera
from robocup_vision.localization.model_edges.second_look import copy_of, edge_points_in, smaller_camera
from robocup_vision.localization.model_edges.settings import EdgeSettings

_QUARTER_RAD = math.pi / 2
_NO_SIGHTINGS = np.zeros((0, SIGHT))


@dataclass(frozen=True, slots=True)
class WideSettings:
    """How a camera is found in a smaller copy. Settings were chosen on rendered frames of boards in motion blur."""

    #: least step of a line, as a fraction of the ordinary one: a line thinner than a pixel shows only a part of it
    step_ratio: float = 0.25
    #: greatest width of a line, in widths by the field file: two tapes side by side, or blur, make it wide
    max_line_widths: float = 3.5
    #: stride of the columns in which the carpet's end is searched, and rows of carpet below an end
    column_stride: int = 4
    carpet_rows: int = 3
    #: weight of a place where the carpet ends, in line points: robots and the ball end it, too
    wall_weight: float = 0.5
    #: noise of such places: metres, and pixels
    wall_off_m: float = 0.1
    wall_off_px: float = 3.0
    #: number of places that are compared with their equivalents at the floor's other corners
    repeated: int = 4
    #: numbers of proposals fitted, and compared with each other
    fitted: int = 24
    weighed: int = 12
    #: most candidates, one a corner of the floor; where halves look alike, half of them and their half turns
    corners: int = 4
    #: least probability of the candidates together: no photograph of another thing has more than 0.05
    min_together: float = 0.9


class WideFinder(EdgeFinder):
    """Proposes poses by lines of any width and by the feet of boards, in the smallest copy of a frame.

    Boards or walls bound the field; `camera` is that of the whole frames.
    """

    def __init__(
        self, field: Field, camera: PinholeCamera, edges: EdgeSettings, settings: WideSettings = WideSettings()
    ) -> None:
        self._wide, self._whole = settings, camera
        candidates = CandidateSettings(
            min_together=settings.min_together,
            max_candidates=settings.corners if field.halves_differ else settings.corners // 2,
        )
        self.factor = smallest_copy(camera, edges)
        super().__init__(
            EdgeFollower(field, smaller_camera(camera, self.factor), edges.for_doubted_frames()),
            replace(THOROUGH, fitted=settings.fitted, weighed=settings.weighed, candidates=candidates),
        )
        self._walls = with_walls(self._bank, field)
        self._wall_scores = np.zeros_like(self._scores)
        self._wall_rows = np.zeros((self.settings.points, 3))

    @staticmethod
    def serves(field: Field, camera: PinholeCamera, edges: EdgeSettings) -> bool:
        """Whether boards bound the field, and frames have a smaller copy."""
        return field.is_bounded and smallest_copy(camera, edges) > 1

    def find(self, frame: UInt8Array, near: Pose2 | None = None) -> FollowedCamera | NotLocated:
        """See `EdgeFinder.find`; the frame is a whole one."""
        answer = super().find(copy_of(frame, self.follower.camera.size_px), near)
        if not answer:
            return answer
        estimate = replace(answer.estimate, residual_px=self.factor * answer.estimate.residual_px)
        return replace(answer, estimate=estimate, file_camera=self._whole)

    def edge_points(self) -> EdgePoints:
        """Return where the last fit predicts the field's edges, in pixels of the whole frame."""
        return edge_points_in(self._whole.size_px, self.follower)

    def propose(self, frame: UInt8Array) -> list[Pose2]:
        """See `EdgeFinder.propose`; the frame is the copy."""
        s, wide, follower, camera = self.settings, self._wide, self.follower, self.follower.camera
        tilt, roll = camera.tilt_rad or 0.0, camera.roll_rad or 0.0
        horizon = camera.center_px[1] + camera.focal_px[1] * math.tan(tilt)
        carpet = np.zeros(5)
        carpet_look(frame, int(horizon), carpet)
        orientation = (tilt, roll, camera.height_m, s.max_range_m)
        points = self._line_points(frame, carpet)
        number = floor_places(points, len(points), follower.lens, *orientation, self._rows)
        ends = self._carpet_ends(frame, carpet, int(horizon) + 1)
        walls = floor_places(ends, len(ends), follower.lens, *orientation, self._wall_rows)
        if min(number, walls) < 3:
            return []
        upright_bins(frame, follower.lens, horizon, self._bank.paints, self._bank.half_view_rad, self._seen)
        score_bank(self._bank, self._rows, number, self._seen, s.upright_weight, self._scores)
        nothing = np.zeros((0, BINS + 1))
        score_bank(self._walls, self._wall_rows, walls, nothing, 0.0, self._wall_scores)
        self._scores += wide.wall_weight * self._wall_scores
        kept = best_poses(self._bank, self._rows, number, self._scores, s.scored, self._apart, self._starts)
        slopes = slopes_of(self._rows[:number], tilt, roll, camera.height_m)
        pixel_rad = self._pixel_rad
        how = Alignment(slopes, tilt, roll, camera.height_m, self._near_std, pixel_rad, self._gates_px, _NO_SIGHTINGS)
        poses, costs = self._aligned[:kept], self._costs[:kept]
        starts = np.ascontiguousarray(self._starts[:kept, :3])
        align_all(self._bank, how, self._seen, s.upright_weight, starts, poses, costs)
        costs = costs + wide.wall_weight * self._walls_off(
            poses, slopes_of(self._wall_rows[:walls], tilt, roll, camera.height_m), pixel_rad
        )
        return self._first_apart((Pose2(*poses[k, :3].tolist()) for k in np.argsort(costs)), s.fitted)

    def _places(self, frame: UInt8Array, proposals: Iterable[Pose2], near: Pose2 | None = None) -> list[Pose2]:
        """Return the results of the proposals' fits, and equivalents of the likeliest at the floor's other corners."""
        places = super()._places(frame, proposals, near)
        repeated = [like for pose in places[: self._wide.repeated] for like in self._likes(pose)]
        return self._first_apart([*places, *repeated], len(places) + len(repeated))

    def _likes(self, pose: Pose2) -> list[Pose2]:
        """Return the poses on the floor that see its other corners where this one sees the nearest corner ahead."""
        field = self.follower.field
        low, high = field.floor_polygon.min(axis=0), field.floor_polygon.max(axis=0)
        corners = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
        off = corners - (pose.x_m, pose.y_m)
        bearing = [abs(wrap_angle(math.atan2(y, x) - pose.theta_rad)) for x, y in off.tolist()]
        away = np.where(np.array(bearing) < self._bank.half_view_rad, np.hypot(*off.T), math.inf)
        ahead = int(np.argmin(away))
        # without a corner in view only the half turn of the floor shows the same
        turns = (1, 2, 3) if math.isfinite(away[ahead]) else (2,)
        likes = []
        for turn in turns:
            c, s = math.cos(turn * _QUARTER_RAD), math.sin(turn * _QUARTER_RAD)
            x, y = corners[(ahead + turn) % 4] - np.array([[c, -s], [s, c]]) @ off[ahead]
            like = Pose2(float(x), float(y), wrap_angle(pose.theta_rad + turn * _QUARTER_RAD))
            if not field.is_on_floor(like.x_m, like.y_m):
                continue
            # of two halves that look alike the bank has one
            likes.append(like.half_turn() if like.x_m < 0 and not field.halves_differ else like)
        return likes

    def _line_points(self, frame: UInt8Array, carpet: FloatArray) -> FloatArray:
        """(N, 3) float64: line points of all widths, as `line_points` gives them."""
        wide, follower, camera = self._wide, self.follower, self.follower.camera
        p = np.zeros(UNKNOWNS)
        p[TILT], p[ROLL], p[HEIGHT] = camera.tilt_rad or 0.0, camera.roll_rad or 0.0, camera.height_m
        usual = follower.numbers.min_ratio * float(follower.edges.channels[0, 3]) * brightness(carpet)
        step = max(wide.step_ratio * usual, 5 * float(carpet[3]))
        look = LineLook(step, follower.numbers.line_width_m, wide.max_line_widths, 2)
        count = line_points(frame, follower.lens, p, carpet, look, self._points)
        return self._points[:count].copy()

    def _carpet_ends(self, frame: UInt8Array, carpet: FloatArray, top: int) -> FloatArray:
        """(N, 3) float64: pixels u, v and 0 of the carpet's upper end in some columns, below row `top`."""
        wide = self._wide
        top = max(top, 0)
        columns = np.arange(1, frame.shape[1] - 1, wide.column_stride)
        is_floor = carpet_mask(frame[top:, columns], carpet).astype(np.uint8)
        if len(is_floor) <= wide.carpet_rows:
            return np.zeros((0, 3))
        # rows at which a run of carpet begins
        runs = np.min([is_floor[k : len(is_floor) - wide.carpet_rows + k] for k in range(wide.carpet_rows)], axis=0)
        first = runs.argmax(axis=0)
        # carpet up to the horizon ends at no board
        ends = (first > 0) & runs.any(axis=0)
        pixels = np.column_stack([columns, top + first - 0.5, np.zeros(len(columns))])
        return np.asarray(pixels[ends], dtype=np.float64)

    def _walls_off(self, poses: FloatArray, slopes: FloatArray, pixel_rad: float) -> FloatArray:
        """(M,) float64: robust costs of the distances between the carpet's ends and the walls, for poses (M, 5)."""
        wide, camera, walls = self._wide, self.follower.camera, self._walls
        x, y, theta = (poses[:, k : k + 1] for k in range(3))
        tilt, roll = (camera.tilt_rad or 0.0) + poses[:, 3:4], (camera.roll_rad or 0.0) + poses[:, 4:5]
        left = np.cos(roll) * slopes[:, 0] - np.sin(roll) * slopes[:, 1]
        over = np.sin(roll) * slopes[:, 0] + np.cos(roll) * slopes[:, 1]
        ahead, up = np.cos(tilt) - np.sin(tilt) * over, np.sin(tilt) + np.cos(tilt) * over
        scale = -camera.height_m / np.minimum(up, -0.01)
        ahead, left = ahead * scale, left * scale
        place = np.stack(
            [x + np.cos(theta) * ahead - np.sin(theta) * left, y + np.sin(theta) * ahead + np.cos(theta) * left]
        )
        column, row = np.rint((place - walls.origin_m[:, None, None]) / walls.cell_m).astype(np.intp)
        rows, columns = walls.distance_m.shape
        inside = (row >= 0) & (column >= 0) & (row < rows) & (column < columns)
        off_m = np.where(inside, walls.distance_m[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)], math.inf)
        slack_m = wide.wall_off_m + wide.wall_off_px * pixel_rad * (ahead**2 + left**2) / camera.height_m
        square = (off_m / slack_m) ** 2
        return np.asarray((1.0 - 1.0 / (1.0 + square)).sum(axis=1))


def smallest_copy(camera: PinholeCamera, edges: EdgeSettings) -> int:
    """Return the factor of the smallest copy of a frame in the second look."""
    return max(k for k in edges.copy_factors if k == 1 or camera.size_px[0] >= k * edges.min_copy_px)

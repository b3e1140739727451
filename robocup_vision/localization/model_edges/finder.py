"""Finds a pinhole camera without a prior: proposes poses by a bank, and decides by the follower's fits and verdict."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple, TypeVar

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.kernels.model_edges.align import DROPPED, Alignment, align_poses, rays_to
from robocup_vision.kernels.model_edges.carpet import carpet_ends
from robocup_vision.kernels.model_edges.find import best_poses, floor_places, score_bank
from robocup_vision.kernels.model_edges.prediction import horizon_row
from robocup_vision.kernels.model_edges.sightings import (
    MAX_SIGHTINGS,
    NOD_RAD,
    SIGHTING_COLUMNS,
    Horizon,
    poses_around,
    sightings,
)
from robocup_vision.localization.distinct import Apart
from robocup_vision.localization.model_edges.bank import prepare_bank, prepare_uprights, with_walls
from robocup_vision.localization.model_edges.evidence import MIN_INLIERS, CandidateSettings, accepted, posterior
from robocup_vision.localization.model_edges.follower import EdgeFollower, FollowedCamera
from robocup_vision.localization.model_edges.settings import DESIGN_WIDTH_PX
from robocup_vision.localization.model_edges.weights import packaged_edge_weights

_AnyPose = TypeVar("_AnyPose", bound=Pose2)

_CORNERS, _QUARTER_RAD = 4, math.pi / 2
_NO_ENDS = np.zeros((0, 3))
_SURE_LOG_ODDS = math.log(99.0)  # an answer of 99 % probability ends the search
# grid of the bank: alignment must converge from the nearest node; the spacing is a whole number of the table's cells
_SPACING_M, _HEADING_STEP_RAD = 0.24, math.radians(6.0)
_FITTED, _WEIGHED = 12, 6  # numbers of poses fitted, and compared with each other
# greatest number of proposals by beacons and posts, and the distance between them on a circle about one
_MAX_UPRIGHT_POSES, _STEP_M = 400, 0.2
_LIKELY = 16  # number of the likeliest poses that pass all steps of the alignment
# greatest excess of missed line points over the best proposal's for a proposal to be fitted
_MAX_MORE_MISSED = 6.0
# greatest difference of a pose's log-likelihood after the first fit from the best one's
_MAX_LOG_LIKELIHOOD_DROP = 4.0
_TURNED = 2  # number of the likeliest poses whose half turns are also fitted where the halves of the field differ
_APART = Apart(0.2, math.radians(6.0))  # proposals and answers nearer to each other count as one
# scale of the robust weight in each step of the alignment, in pixels of a picture 208 wide
_GATES_PX = (20.0, 10.0, 5.0, 3.0, 3.0)
# standard deviations of a proposal, as the prior of its fit; the heading's is also that of a pose of the bank
PROPOSAL_STD_M, PROPOSAL_STD_RAD = 0.10, math.radians(3.5)
# greatest number of repeated fits, each from the last result, and the changes of the pose below which they end
_SETTLING, _SETTLED_M, _SETTLED_RAD = 2, 0.02, math.radians(0.5)
# standard deviations of a lost camera's pose about the last one, and the fraction of lost cameras that are near it
_LOST_STD_M, _LOST_STD_RAD, _NEAR_RATIO = 0.5, 0.5, 0.5
_POINTS = 60  # greatest number of line points in use


@dataclass(frozen=True, slots=True)
class FinderSettings:
    """What differs between searches."""

    #: numbers of poses scored by all points, and aligned
    scored: int = 600
    aligned: int = 100
    #: further tilts, searched if the one at rest gives no answer, in standard deviations of the sway from it
    nods: tuple[float, ...] = (-1.5, 1.5)
    #: number of the likeliest poses that are compared with their equivalents at the floor's other corners
    repeated: int = 0
    #: weight of an end of the carpet, in line points, on a field with walls; small, because robots also hide carpet
    end_weight: float = 0.0
    #: greatest standard deviation of an answer's position; beyond it a later picture must decide
    max_std_m: float = 0.10
    #: greatest range of line points
    max_range_m: float = 6.0
    #: how probable answers must be
    candidates: CandidateSettings = CandidateSettings()


def for_walled_fields(field: Field) -> FinderSettings:
    """Return the settings for a frame that shows little of a floor within walls, whose corners look alike.

    The answer has up to one candidate for each corner; on a field whose halves look alike for two corners only, because
    the half turns of these are implied.
    """
    corners = _CORNERS if field.halves_differ else _CORNERS // 2
    candidates = CandidateSettings(max_candidates=corners)
    return FinderSettings(repeated=4, end_weight=0.5, candidates=candidates)


@dataclass(frozen=True, slots=True)
class TiltedPose(Pose2):
    """A pose of a camera with its tilt and roll."""

    tilt_rad: float = 0.0
    roll_rad: float = 0.0

    def half_turn(self) -> TiltedPose:
        """See `Pose2.half_turn`."""
        return TiltedPose(-self.x_m, -self.y_m, self.theta_rad + math.pi, self.tilt_rad, self.roll_rad)


class Clues(NamedTuple):
    """Features of a field that are found in a frame without a pose."""

    points: FloatArray  #: (N, 3) float64: pixels u, v on lines, see `kernels.model_edges.bands.line_points`
    ends: FloatArray  #: (E, 3) float64: pixels u, v where the carpet ends, and 0
    uprights: FloatArray  #: (S, 8) float64: see `kernels.model_edges.sightings.sightings`


CluesAt = Callable[[float], Clues]


class EdgeFinder:
    """Proposes poses all over the field and lets the follower's fit and verdict decide."""

    def __init__(self, follower: EdgeFollower, settings: FinderSettings | None = None) -> None:
        self.follower = follower
        self.settings = s = settings or FinderSettings()
        field, camera = follower.field, follower.camera
        self._bank = prepare_bank(field, _SPACING_M, _HEADING_STEP_RAD)
        self._half_view_rad = math.atan(camera.size_px[0] / 2 / camera.focal_px[0])
        self._has_twins = not field.halves_differ
        self._apart = replace(_APART, twins=self._has_twins)
        self._is_same_frame = False  # whether the next fit is to the frame of the last one
        self._scores = np.zeros((len(self._bank.places), len(self._bank.headings)))
        self._walls = with_walls(self._bank, field) if s.end_weight and field.is_bounded else None
        self._rows, self._end_rows = np.zeros((_POINTS, 3)), np.zeros((_POINTS, 3))
        self._end_scores = np.zeros_like(self._scores)
        self._points = np.zeros((600, 3))
        self._starts = np.zeros((s.aligned, 4))
        most = s.aligned + _MAX_UPRIGHT_POSES
        self._tried = np.zeros((most, 3))
        self._half_m = (field.length_m / 2 + 0.2, field.width_m / 2 + 0.2)
        self._aligned, self._costs = np.zeros((most, 5)), np.zeros(most)
        self._uprights = prepare_uprights(field)
        self._sightings = np.zeros((MAX_SIGHTINGS, SIGHTING_COLUMNS))
        scale = camera.size_px[0] / DESIGN_WIDTH_PX
        self._weights = packaged_edge_weights()
        low, high = field.floor_polygon.min(axis=0), field.floor_polygon.max(axis=0)
        self._searched_m2rad = math.tau * float(np.prod(high - low))
        self._covariance = np.diag([PROPOSAL_STD_M, PROPOSAL_STD_M, PROPOSAL_STD_RAD]) ** 2
        self._gates_px = np.array(_GATES_PX) * max(1.0, 0.5 * (1.0 + scale))

    def with_follower(self, follower: EdgeFollower) -> EdgeFinder:
        """Return a finder with a follower of another calibration of the camera; the tables are shared."""
        other = copy(self)
        other.follower = follower
        return other

    @property
    def _pixel_rad(self) -> float:
        """Angle of one pixel at the image's centre."""
        fu, fv = self.follower.camera.focal_px
        return 1.0 / math.sqrt(fu * fv)

    @property
    def _rest_rad(self) -> tuple[float, float]:
        """The camera's tilt and roll at rest."""
        camera = self.follower.camera
        return camera.tilt_rad or 0.0, camera.roll_rad or 0.0

    @property
    def _rest_std_rad(self) -> tuple[float, float]:
        """Standard deviations of tilt and roll about those at rest."""
        return self.follower.sway_std_rad

    @property
    def _near_std(self) -> FloatArray:
        """(5,) float64: standard deviations of a bank's x, y, heading, tilt and roll, the prior of the alignment."""
        near_m = _SPACING_M / 2
        return np.array([near_m, near_m, PROPOSAL_STD_RAD, *self._near_tilt_roll_rad])

    @property
    def _near_tilt_roll_rad(self) -> tuple[float, float]:
        """Standard deviations of tilt and roll about those at which a search begins."""
        return self._rest_std_rad

    @property
    def proposal_std(self) -> FloatArray:
        """(3,) float64: standard deviations of a proposal as the prior of its fit, m, m and rad."""
        return np.asarray(np.sqrt(self._covariance.diagonal()))

    def propose(self, frame: UInt8Array) -> Iterator[list[TiltedPose]]:
        """Yield lists of proposed poses, likeliest first; a further list is for when the last one fails."""
        aligned = np.empty((0, 6))
        for clues, tilts in self._searches(frame):
            aligned = np.vstack([aligned, self._aligned_poses(clues, tilts)])
            yield self._likeliest(aligned)

    def _searches(self, frame: UInt8Array) -> Iterator[tuple[CluesAt, FloatArray]]:
        """Yield the clues of a frame, as a function of tilt, and tilts to search; see `propose` for the order."""
        rest, nods = self._rest_rad[0], self.settings.nods
        clues = partial(self._clues, frame)
        yield clues, np.array([rest])
        if nods:
            # the bank's poses at rest do not match the far lines of a body that nods
            yield clues, rest + np.array(nods) * self._rest_std_rad[0]

    def _likeliest(self, aligned: FloatArray) -> list[TiltedPose]:
        """Return distinct poses with costs near the least, best first, of poses with tilts, rolls and costs (N, 6)."""
        costs = aligned[:, 5]
        likely = aligned[costs <= costs.min(initial=math.inf) + _MAX_MORE_MISSED]
        poses = [TiltedPose(*pose) for pose in likely[np.argsort(likely[:, 5], kind="stable"), :5].tolist()]
        return self._first_apart(poses, _FITTED)

    def _clues(self, frame: UInt8Array, tilt_rad: float) -> Clues:
        """Find the clues of a frame at a tilt of the camera."""
        follower, camera = self.follower, self.follower.camera
        horizon = horizon_row(follower.lens, tilt_rad, self._rest_rad[1])
        count = follower.find_line_points(frame, tilt_rad, self._rest_rad[1], self._points)
        level = Horizon(horizon, camera.height_m, NOD_RAD * camera.focal_px[1])
        many = sightings(frame, follower.lens, level, self._half_view_rad, self._uprights, self._sightings)
        ends = _NO_ENDS if self._walls is None else carpet_ends(frame, int(horizon))
        return Clues(self._points[:count], ends, self._sightings[:many])

    def _aligned_poses(self, clues: CluesAt, tilts_rad: FloatArray) -> FloatArray:
        """Align poses with a frame, starting at some tilts: (N, 6), poses, tilts, rolls and costs in line points."""
        return np.vstack([np.empty((0, 6)), *(self._aligned_at(tilt, clues(tilt)) for tilt in tilts_rad.tolist())])

    def _aligned_at(self, tilt: float, clues: Clues) -> FloatArray:
        """See `_aligned_poses`, for one tilt."""
        s, camera, bank = self.settings, self.follower.camera, self._bank
        (rest, roll), height_m = self._rest_rad, camera.height_m
        attitude = (self.follower.lens, tilt, roll, height_m, s.max_range_m)
        number = floor_places(clues.points, len(clues.points), *attitude, self._rows)
        ends = floor_places(clues.ends, len(clues.ends), *attitude, self._end_rows)
        if number < 3 and not len(clues.uprights):
            return np.empty((0, 6))
        score_bank(bank, self._rows, number, self._scores)
        walls = bank if self._walls is None else self._walls
        if ends:
            score_bank(walls, self._end_rows, ends, self._end_scores)
            self._scores += s.end_weight * self._end_scores
        kept = best_poses(bank, self._rows, number, self._scores, s.scored, _APART.m, _APART.rad, self._starts)
        alignment = Alignment(
            rays_to(self._rows[:number], tilt, roll, height_m),
            tilt,
            roll,
            height_m,
            self._near_std,
            self._pixel_rad,
            self._gates_px,
            clues.uprights,
            rays_to(self._end_rows[:ends], tilt, roll, height_m),
            walls.distance_m,
            s.end_weight,
        )
        starts = self._tried
        starts[:kept] = self._starts[:kept, :3]
        kept += poses_around(clues.uprights, camera.focal_px[0], self._half_m, _STEP_M, starts[kept:])
        poses, costs = self._aligned[:kept], self._costs[:kept]
        align_poses(bank, alignment, starts[:kept], _LIKELY, poses, costs)
        # the prior of the tilt is centred at rest, not at the start of this search
        nod = poses[:, 3]
        costs += 0.5 * (((tilt + nod - rest) / self._rest_std_rad[0]) ** 2 - (nod / alignment.std[3]) ** 2)
        is_aligned = costs < 0.5 * DROPPED
        return np.column_stack([poses[is_aligned] + (0.0, 0.0, 0.0, tilt, roll), costs[is_aligned]])

    def likeliest_by_points(self, pixels: FloatArray) -> TiltedPose | None:
        """Return the pose at which points on lines (N, 2), pixels, agree best with the field; None with too few."""
        points = np.column_stack([pixels, np.zeros(len(pixels))])
        poses = self._likeliest(self._aligned_at(self._rest_rad[0], Clues(points, _NO_ENDS, self._sightings[:0])))
        return poses[0] if poses else None

    def _first_apart(self, poses: Sequence[_AnyPose], count: int) -> list[_AnyPose]:
        """Return the first distinct poses, at most `count`."""
        rows = np.array([(pose.x_m, pose.y_m, pose.theta_rad) for pose in poses]).reshape(-1, 3)
        return [poses[index] for index in self._apart.first(rows, count)]

    def find(self, frame: UInt8Array, near: Pose2 | None = None) -> FollowedCamera | NotLocated:
        """Locate the camera by one BGR frame; `near` is the last pose of a lost camera, which may still be near it."""
        frame = self.follower.copy_of(frame)
        turned = [] if near is None else self._turned(near)
        for proposals in self.propose(frame):
            answer = self.judge(frame, [*turned, *proposals], near)
            if answer or not proposals:
                break
            turned = []
        return answer

    def find_with(
        self, frame: UInt8Array, propose: Callable[[UInt8Array], Sequence[Pose2]]
    ) -> FollowedCamera | NotLocated:
        """Locate the camera as `find` does; if the answer is not sure, also judge the poses that `propose` returns.

        `propose` takes longer than most searches, so it is called last.
        """
        found = self.find(frame)
        if found and self._log_odds(found) >= _SURE_LOG_ODDS:
            return found
        other = self.judge(self.follower.copy_of(frame), propose(frame))
        if not found or (other and self._log_odds(other) > self._log_odds(found)):
            return other or found
        if not found.others:
            self.follower.resume(found)
        return found

    def _log_odds(self, found: FollowedCamera) -> float:
        return found.evidence.log_odds_anywhere(self._weights)

    def _turned(self, near: Pose2) -> list[Pose2]:
        """Return poses at a lost camera's last place whose headings cover its error, close enough for a fit."""
        steps = math.ceil(_LOST_STD_RAD / (2 * PROPOSAL_STD_RAD))
        return [near.compose(Pose2(0.0, 0.0, 2 * PROPOSAL_STD_RAD * k)) for k in range(-steps, steps + 1)]

    def _log_prior(self, pose: Pose2, near: Pose2 | None) -> float:
        """Return the logarithm of a pose's prior density divided by that of a camera which may be anywhere."""
        if near is None:
            return 0.0
        away_m, turned_rad = pose.error_to(near, symmetric=self._has_twins)
        density = math.exp(-0.5 * ((away_m / _LOST_STD_M) ** 2 + (turned_rad / _LOST_STD_RAD) ** 2))
        density /= math.sqrt(math.tau) ** 3 * _LOST_STD_M**2 * _LOST_STD_RAD
        return math.log(1 - _NEAR_RATIO + _NEAR_RATIO * density * self._searched_m2rad)

    def judge(
        self, frame: UInt8Array, proposals: Iterable[Pose2], near: Pose2 | None = None
    ) -> FollowedCamera | NotLocated:
        """Fit every proposed pose of the camera, and return the answer that the frame confirms, with its candidates."""
        answers, why_none = self.fits(frame, proposals, near)
        if not answers:
            return NotLocated(why_none)
        s = self.settings
        probabilities = posterior(
            [
                one.evidence.log_odds_anywhere(self._weights) + self._log_prior(one.estimate.pose, near)
                for one in answers
            ]
        )
        order = accepted(probabilities, s.candidates)
        if not order:
            first = int(probabilities.argmax())
            several = f" of {len(answers)} that fit" if len(answers) > 1 else ""
            return NotLocated(
                f"the likeliest pose{several} has a probability of {probabilities[first]:.1%} only:"
                f" {answers[first].evidence.in_words}"
            )
        best_answer = answers[order[0]]
        open_m = best_answer.evidence.position_std_m
        if open_m > s.max_std_m:
            seen = best_answer.evidence.in_words
            return NotLocated(f"what is in view leaves the position open by {open_m:.2f} m: {seen}")
        if len(order) == 1:
            self.follower.resume(best_answer)
        others = tuple(answers[index].estimate.pose for index in order[1:])
        return best_answer.with_candidates(others)

    def fits(
        self, frame: UInt8Array, proposals: Iterable[Pose2], near: Pose2 | None = None
    ) -> tuple[list[FollowedCamera], str]:
        """Fit every proposed pose; return the distinct results to compare, and the reason if there is none.

        On a field whose halves look alike a pose also stands for its half turn.
        """
        s, follower = self.settings, self.follower
        self._is_same_frame = False
        proposals = list(proposals)
        if not proposals:
            horizon = horizon_row(follower.lens, *self._rest_rad)
            reason = "no lines, goals or beacons stand out in this frame"
            if horizon > 0.0:
                reason += f" (the tilt puts the horizon at row {horizon:.0f} of {follower.camera.size_px[1]})"
            return [], reason
        places = self._places(frame, proposals, near)
        equivalents = [equivalent for pose in places[: s.repeated] for equivalent in self._corner_equivalents(pose)]
        places = self._first_apart([*places, *equivalents], len(places) + len(equivalents))
        if not places:
            tried, least = len(proposals), MIN_INLIERS
            return [], f"none of the {tried} likeliest poses has {least} places on edges in this frame"
        if follower.field.shows_half:
            # the lines look alike from both halves, and the proposal may be in the wrong one
            for pose in [one.half_turn() for one in places[:_TURNED]]:
                if not any(self._apart.is_one(pose, other) for other in places):
                    places.append(pose)
        answers: list[FollowedCamera] = []
        likeliest = ""
        for pose in places:
            answer = self._settle(frame, pose)
            likeliest = likeliest or (answer.reason if isinstance(answer, NotLocated) else answer.evidence.in_words)
            if answer and not any(self._apart.is_one(answer.estimate.pose, other.estimate.pose) for other in answers):
                answers.append(answer)
        follower.forget()
        return answers, f"no pose on the field explains what is in view; by the likeliest: {likeliest}"

    def _places(self, frame: UInt8Array, proposals: Iterable[Pose2], near: Pose2 | None = None) -> list[Pose2]:
        """Return the results of the proposals' fits, the likeliest first."""
        follower = self.follower
        results: list[tuple[float, Pose2]] = []
        for proposal in proposals:
            answer, evidence = self._fit(frame, proposal), follower.evidence
            if answer and evidence.inliers >= MIN_INLIERS:
                result = self._fitted_pose(answer)
                results.append((evidence.log_odds_anywhere(self._weights) + self._log_prior(result, near), result))
        results.sort(key=lambda one: -one[0])
        likely = [pose for weight, pose in results if weight > results[0][0] - _MAX_LOG_LIKELIHOOD_DROP]
        return self._first_apart(likely, _WEIGHED)

    def _corner_equivalents(self, pose: Pose2) -> list[Pose2]:
        """Return the poses on the floor that see its other corners where this one sees the nearest corner ahead."""
        field = self.follower.field
        low, high = field.floor_polygon.min(axis=0), field.floor_polygon.max(axis=0)
        corners = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
        off = corners - (pose.x_m, pose.y_m)
        bearing = [abs(wrap_angle(math.atan2(y, x) - pose.theta_rad)) for x, y in off.tolist()]
        away = np.where(np.array(bearing) < self._half_view_rad, np.hypot(*off.T), math.inf)
        ahead = int(np.argmin(away))
        # without a corner in view only the half turn of the floor shows the same
        turns = (1, 2, 3) if math.isfinite(away[ahead]) else (2,)
        equivalents = []
        for turn in turns:
            c, s = math.cos(turn * _QUARTER_RAD), math.sin(turn * _QUARTER_RAD)
            x, y = corners[(ahead + turn) % _CORNERS] - np.array([[c, -s], [s, c]]) @ off[ahead]
            equivalent = Pose2(float(x), float(y), wrap_angle(pose.theta_rad + turn * _QUARTER_RAD))
            if not field.is_on_floor(equivalent.x_m, equivalent.y_m):
                continue
            # of two halves that look alike the bank covers one
            equivalents.append(equivalent.half_turn() if equivalent.x_m < 0 and not field.halves_differ else equivalent)
        return equivalents

    def _fitted_pose(self, answer: FollowedCamera) -> Pose2:
        """Return the result of the last fit, by the frame alone."""
        return answer.measured_pose

    def _settle(self, frame: UInt8Array, pose: Pose2) -> FollowedCamera | NotLocated:
        """Fit one pose by the frame alone: repeat the fit from its result, because a proposal is no evidence."""
        answer = self._fit(frame, pose)
        for _ in range(_SETTLING):
            if not answer:
                break
            result = self._fitted_pose(answer)
            away_m, turn_rad = result.error_to(pose)
            if away_m < _SETTLED_M and turn_rad < _SETTLED_RAD:
                break
            pose = result
            answer = self._fit(frame, pose)
        return answer.without_prior() if answer else answer

    def _fit(self, frame: UInt8Array, pose: Pose2) -> FollowedCamera | NotLocated:
        """Fit one pose, with the proposal as prior."""
        self.follower.forget()
        near = PoseEstimate(pose, self._covariance, 1.0, 0.0)
        same, self._is_same_frame = self._is_same_frame, True
        return self.follower.follow(frame, near, modes=1, is_proposal=True, is_same_frame=same)

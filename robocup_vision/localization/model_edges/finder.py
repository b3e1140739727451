"""Finds a pinhole camera without a prior: a bank of poses proposes, the follower's fit and verdict decide."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from robocup_vision.arrays import UInt8Array
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.model_edges.find import BINS, best_poses, floor_places, score_bank, upright_bins
from robocup_vision.kernels.model_edges.follow import brightness
from robocup_vision.kernels.model_edges.search import carpet_look
from robocup_vision.kernels.model_edges.tables import HEIGHT, ROLL, TILT, UNKNOWNS
from robocup_vision.kernels.model_edges.verdict import LineLook, line_points
from robocup_vision.localization.model_edges.bank import prepare_bank
from robocup_vision.localization.model_edges.follower import EdgeFollower, FollowedCamera


@dataclass(frozen=True, slots=True)
class FinderSettings:
    """How a camera is found."""

    # of the bank: what the fit's basin bridges
    spacing_m: float = 0.25
    heading_step_rad: float = math.radians(6.0)
    # scored by all points; refined by the fit
    scored: int = 800
    refined: int = 12
    # how far apart two proposals are at least
    apart_m: float = 0.2
    apart_rad: float = math.radians(5.0)
    # of a proposal, as the prior of its fit
    std_m: float = 0.10
    std_rad: float = math.radians(3.5)
    # of a bearing bin whose paint is wrong, in line points
    upright_weight: float = 0.25
    # line points in use, and how far away they may be, in metres
    points: int = 90
    max_range_m: float = 6.0
    # tilts tried about the file's, in standard deviations of the nod
    nods: tuple[float, ...] = (0.0,)
    # the best answer's odds over those of any other place, as a logarithm
    min_lead: float = 2.0
    # and its own odds: no prior speaks for it
    min_log_odds: float = 3.5
    # of the samples looked for, that must be found: hidden is neutral for who has a prior, but without one a pose whose
    # samples are mostly hidden is an accident (five right answers of one development sequence found 0.73 and more)
    min_found_of_all: float = 0.35
    # and where nothing upright is found: lines are alike, and parts of them fit in many places
    min_found_of_lines: float = 0.75


class EdgeFinder:
    """Proposes poses all over the field and lets the follower's fit and verdict decide.

    Parameters
    ----------
    follower : EdgeFollower
        For the same field and camera.
    settings : FinderSettings
        How.
    """

    def __init__(self, follower: EdgeFollower, settings: FinderSettings | None = None) -> None:
        self.follower = follower
        self.settings = s = settings or FinderSettings()
        field, camera = follower.field, follower.camera
        self._bank = prepare_bank(field, camera, s.spacing_m, s.heading_step_rad)
        self._scores = np.zeros((len(self._bank.places), len(self._bank.headings)))
        self._seen = np.zeros((len(self._bank.paints), BINS + 1))
        self._rows = np.zeros((s.points, 3))
        self._points = np.zeros((600, 3))
        self._poses = np.zeros((s.refined, 4))

    def propose(self, frame: UInt8Array) -> list[Pose2]:
        """Poses of the camera worth a fit, the likeliest first."""
        s, follower, camera = self.settings, self.follower, self.follower.camera
        tilt = camera.tilt_rad or 0.0
        carpet, p = np.zeros(5), np.zeros(UNKNOWNS)
        horizon = camera.center_px[1] + camera.focal_px[1] * math.tan(tilt)
        carpet_look(frame, int(horizon), carpet)
        p[TILT], p[ROLL], p[HEIGHT] = tilt, camera.roll_rad or 0.0, camera.height_m
        lens, numbers = follower.lens, follower.numbers
        step = 0.5 * numbers.min_ratio * float(follower.edges.channels[0, 3]) * brightness(carpet)
        look = LineLook(max(step, 5 * float(carpet[3])), numbers.line_width_m, max(numbers.point_stride // 2, 2))
        count = line_points(frame, lens, p, carpet, look, self._points)
        upright_bins(frame, lens, horizon, self._bank.paints, self._bank.half_view_rad, self._seen)
        found: list[tuple[float, Pose2]] = []
        for nod in s.nods:
            turned = tilt + nod * follower.sway_std_rad
            number = floor_places(
                self._points, count, lens, turned, p[ROLL], camera.height_m, s.max_range_m, self._rows
            )
            if number < 3 and self._seen[:, -1].sum() < 2:
                continue
            score_bank(self._bank, self._rows, number, self._seen, s.upright_weight, self._scores)
            kept = best_poses(
                self._bank,
                self._rows,
                number,
                self._scores,
                s.scored,
                np.array([s.apart_m, s.apart_rad]),
                self._poses,
            )
            found += [(row[3], Pose2(row[0], row[1], row[2])) for row in self._poses[:kept].tolist()]
        found.sort(key=lambda one: one[0])
        return [pose for _, pose in found[: s.refined]]

    def find(self, frame: UInt8Array) -> FollowedCamera | NotLocated:
        """Locate the camera by one frame alone.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            BGR, of the camera's size.
        """
        return self.judge(frame, self.propose(frame))

    def judge(self, frame: UInt8Array, proposals: Iterable[Pose2]) -> FollowedCamera | NotLocated:
        """Fit every proposed pose of the camera, and return the one that the frame confirms, if it is the only one.

        Where its half turn about the field's centre explains the frame about as well, that is a second candidate.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            BGR, of the camera's size.
        proposals : iterable of Pose2
            Whoever proposes them.
        """
        s, follower = self.settings, self.follower
        answers = [fit for pose in proposals if (fit := self._fit(frame, pose)) is not None]
        follower.forget()
        if not answers:
            return NotLocated("no pose on the field explains what is in view")
        answers.sort(key=lambda one: -one[0])
        odds, best = answers[0]
        if odds < s.min_log_odds:
            return NotLocated(f"the best of all poses is not sure enough: odds {math.exp(odds):.2g} to 1")
        for other_odds, other in answers[1:]:
            away, turn = other.estimate.pose.error_to(best.estimate.pose, symmetric=True)
            if (away > s.apart_m or turn > s.apart_rad) and other_odds > odds - s.min_lead:
                return NotLocated("two poses explain what is in view about equally well")
        is_alone = False
        if follower.field.halves_differ:
            # lines alone look alike from both halves, whichever of them was proposed
            twin = self._fit(frame, best.estimate.pose.half_turn())
            if twin is not None and twin[0] > odds:
                twin, (odds, best) = (odds, best), twin
            is_alone = twin is None or twin[0] <= odds - s.min_lead
        follower.resume(best)
        return best if is_alone else best.with_twin()

    def _fit(self, frame: UInt8Array, pose: Pose2) -> tuple[float, FollowedCamera] | None:
        """Fit one pose: logarithm of its odds, and the answer; None where the frame does not confirm it."""
        s, follower = self.settings, self.follower
        covariance = np.diag([s.std_m, s.std_m, s.std_rad]) ** 2
        follower.forget()
        answer = follower.follow(frame, PoseEstimate(pose, covariance, 1.0, 0.0), modes=1)
        if not answer:
            return None
        evidence = answer.evidence
        min_found = s.min_found_of_all if evidence.found_upright > 0 else s.min_found_of_lines
        if evidence.found < min_found * evidence.looked_for:
            return None
        return evidence.log_odds(follower.settings), answer

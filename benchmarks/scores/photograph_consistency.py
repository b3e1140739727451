"""Whether poses in photographs err as their covariances say: mean and median NEES against what is known of the pose.

NEES is the squared error in units of the covariance: 3 on average for three unknowns (2 where the heading is not
known), if error and covariance agree. A reference errs, too, and its covariance is added; "alone" is the figure with
the reference taken as exact. A row is met where neither the first is too large (poses too sure of themselves, whatever
the reference) nor the second too small (too unsure).

"reached": the mean error of onboard_ssl with priors beside the mean that its covariances and the reference's error lead
to expect, were all that the frames tell exact. Still and moving frames cannot be told apart: of each only one pose is
known, none of the frames beside it, so that nothing tells its speed.

onboard_ssl: overhead cameras, synchronised to a frame of video, 1/30 s, at 1 m/s and 1 rad/s: 0.033 m, 1.9 degrees.
goal_spl: motion capture of the head; a camera sits 0.06 m ahead of the head's axis, and markers sit to 0.01 m.
omni_msl_table: a joint fit that agrees with steps that were measured to 0.02 m; its heading is not judged.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from benchmarks.harness import DEFAULT_SEED
from benchmarks.scores.photograph_rows import (
    REAL,
    Look,
    PhotographRow,
    known_poses,
    looks,
    needs,
    onboard_looks,
    photographs,
    table_of,
)
from field_models import load_field
from robocup_vision import PoseEstimate, Vision, load_camera
from robocup_vision.arrays import FloatArray
from robocup_vision.geometry import Pose2

PRIORS = 6
# covariances of references: x, y (m), heading (rad)
FRAME_S = 1 / 30
ONBOARD = np.diag([FRAME_S, FRAME_S, FRAME_S]) ** 2
HEAD_AHEAD_M, MARKERS_M = 0.06, 0.01
STEPS = np.diag([0.02, 0.02]) ** 2
# of three unknowns; of two, two thirds
LOW, HIGH = 1.5, 6.0
# errors may be so much larger than expected; draws by which it is worked out
WORSE, DRAWS = 1.2, 2000


def nees(error: FloatArray, covariance: FloatArray) -> float:
    """Return the squared size of an error (N,) in units of its covariance (N, N)."""
    return float(error @ np.linalg.solve(covariance, error))


def _errors(estimate: PoseEstimate, truth: Pose2, reference: FloatArray) -> tuple[float, float]:
    """NEES with and without the reference's own covariance, in as many unknowns as that has."""
    size = len(reference)
    error = estimate.pose.array - truth.array
    error[2] = math.remainder(error[2], math.tau)
    covariance = estimate.covariance[:size, :size]
    return nees(error[:size], covariance + reference), nees(error[:size], covariance)


def _row(name: str, found: list[tuple[float, float]], unknowns: int) -> PhotographRow:
    low, high = LOW * unknowns / 3, HIGH * unknowns / 3
    target = f"{low:g} to {high:g}"
    if not found:
        return PhotographRow(name, "none located", target, False)
    both, alone = np.array(found).T
    measured = f"mean {both.mean():.1f}; alone mean {alone.mean():.1f}, median {np.median(alone):.1f}"
    return PhotographRow(name, measured, target, bool(both.mean() <= high and alone.mean() >= low))


def _located(found: Iterable[Look]) -> list[tuple[PoseEstimate, Pose2]]:
    """Return the poses of those looks that gave one, and the known poses."""
    return [(look.view.pose, look.truth) for look in found if look.view.pose and look.truth is not None]


@needs("onboard_ssl_more")
def forward() -> PhotographRow:
    """Look by the small-size robot's camera with priors."""
    located = _located(onboard_looks(PRIORS))
    return _row("NEES, onboard_ssl, prior", [_errors(pose, truth, ONBOARD) for pose, truth in located], 3)


def mean_errors(covariances: FloatArray) -> tuple[float, float]:
    """Return the mean distance (m) and turn (rad) of errors as often as covariances (N, 3, 3) say."""
    drawn = np.random.default_rng(DEFAULT_SEED).standard_normal((DRAWS, 3))
    errors = np.linalg.cholesky(covariances) @ drawn.T
    return float(np.hypot(errors[:, 0], errors[:, 1]).mean()), float(np.abs(errors[:, 2]).mean())


@needs("onboard_ssl_more")
def reached() -> PhotographRow:
    """Compare the errors by the small-size robot's camera with what frames, priors and the reference let expect."""
    located = _located(onboard_looks(PRIORS))
    covariances = np.array([pose.covariance for pose, _ in located])
    errors = np.mean([pose.pose.error_to(truth) for pose, truth in located], axis=0)
    expected = {
        "": (float(errors[0]), float(errors[1])),
        "expected ": mean_errors(covariances + ONBOARD),
        "exact reference ": mean_errors(covariances),
        "reference alone ": mean_errors(ONBOARD[None]),
    }
    measured = "; ".join(f"{name}{away:.3f} m, {math.degrees(turn):.1f} deg" for name, (away, turn) in expected.items())
    away, turn = expected["expected "]
    is_met = errors[0] <= WORSE * away and errors[1] <= WORSE * turn
    return PhotographRow("reached, onboard_ssl, prior", measured, f"<= {WORSE} x expected", bool(is_met))


def _nearer_half(pose: PoseEstimate, truth: Pose2) -> Pose2:
    return min(truth, truth.half_turn(), key=lambda one: pose.pose.error_to(one)[0])


@needs("goal_spl")
def white_goals() -> PhotographRow:
    """Locate the head camera of a Nao, modulo a half turn."""
    vision = Vision(load_field("spl_2020"), load_camera(REAL / "goal_spl" / "camera.toml"))
    table = table_of("goal_spl", "truth.csv")
    truths = {row["image"]: Pose2(float(row["x_m"]), float(row["y_m"]), 0.0) for row in table}
    found = []
    for pose, truth in _located(looks(vision, photographs("goal_spl"), truths)):
        c, s = math.cos(pose.pose.theta_rad), math.sin(pose.pose.theta_rad)
        turn = np.array([[c, -s], [s, c]])
        reference = turn @ np.diag([HEAD_AHEAD_M, MARKERS_M]) ** 2 @ turn.T
        found.append(_errors(pose, _nearer_half(pose, truth), reference))
    return _row("NEES, goal_spl", found, 2)


@needs("omni_msl_table")
def mirror_lines(*, with_prior: bool) -> PhotographRow:
    """Look at the mirror photographs whose poses are known."""
    folder = "omni_msl_table"
    vision = Vision(load_field(REAL / folder / "field.toml"), load_camera(REAL / folder / "camera.toml"))
    located = _located(looks(vision, photographs(folder), known_poses(folder), PRIORS if with_prior else 0))
    found = [_errors(pose, _nearer_half(pose, truth), STEPS) for pose, truth in located]
    return _row(f"NEES, {folder}, {'prior' if with_prior else 'no prior'}", found, 2)


ROWS = (
    forward,
    reached,
    white_goals,
    lambda: mirror_lines(with_prior=False),
    lambda: mirror_lines(with_prior=True),
)

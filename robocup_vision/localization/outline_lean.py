"""How a robot leans while it brakes or kicks, by the floor's outline: a lean moves far walls as no pose does.

A degree moves a wall's foot that is seen 2 m away from 0.2 m above the floor by a third of a metre. Where the walls of
both sides and of an end are in view, the lean is told apart from every motion: it turns them against each other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.camera.projection import camera_rotation
from robocup_vision.kernels.floor.walls import FloorOutline, WallPrediction, WallScene, predict_walls

_STEP_RAD = math.radians(0.1)
_POSE, _LEAN = slice(0, 3), slice(3, 5)


@dataclass(frozen=True, slots=True)
class LeanSettings:
    """Values of `fit_lean`.

    Attributes
    ----------
    sway_std_rad : float
        Standard deviation of pitch and roll about those of the camera file, as in `lines.nearby`.
    steps : int
        Gauss-Newton steps.
    gate : float
        Squared Mahalanobis distance from upright of a lean that is one: 99.9 % for two dimensions.
    group : int
        Neighbouring bearings whose errors are taken to be one.
    """

    sway_std_rad: float = 0.01
    steps: int = 2
    gate: float = 13.8
    group: int = 4


@dataclass(frozen=True, slots=True, eq=False)
class LeanFit:
    """A pose, and how the body leans there.

    Parameters
    ----------
    pose : (3,) float64
        x, y, theta of the robot's foot.
    lean_rad : (float, float)
        Pitch, nose up, and roll, right side down.
    covariance : (3, 3) float64
        Of the pose.
    residual_px, predicted_px : (K,) float64
        As in `WallFit`.
    """

    pose: FloatArray
    lean_rad: tuple[float, float]
    covariance: FloatArray
    residual_px: FloatArray
    predicted_px: FloatArray


def leaning(scene: WallScene, pitch_rad: float, roll_rad: float) -> WallScene:
    """Return the scene of a body that leans about its foot, and carries the camera along."""
    turn = camera_rotation(0.0, pitch_rad, roll_rad)
    x, y, _ = (turn @ np.array([scene.offset_x, scene.offset_y, scene.height])).tolist()
    # inverse ranges are those of the upright camera's height
    return scene._replace(offset_x=x, offset_y=y, robot_to_camera=np.ascontiguousarray(scene.robot_to_camera @ turn.T))


def fit_lean(
    pose: FloatArray,
    scene: WallScene,
    outline: FloorOutline,
    scale_px: float,
    inflate: float,
    systematic: float,
    settings: LeanSettings = LeanSettings(),
) -> LeanFit | None:
    """Fit pose and lean together; None where the body is as good as upright, or the outline does not tell.

    Parameters
    ----------
    pose : (3,) float64
        Of the fit of an upright body.
    scene, outline : WallScene, FloorOutline
        As `fit_walls` takes them.
    scale_px : float
        Width of the weights.
    inflate, systematic : float
        As `summarise_fit` takes them.
    settings : LeanSettings
        See there.
    """
    rows = _Rows(scene, outline, scale_px)
    state = np.array([*pose, 0.0, 0.0])
    prior = np.zeros((5, 5))
    known = math.sqrt(max(systematic, 1e-12))
    for step in range(settings.steps + 1):
        jacobian, residual, weight = rows.at(state)
        used = np.isfinite(residual)
        if used.sum() < len(state) * settings.group:
            return None
        j, e, w = jacobian[used], residual[used], weight[used]
        noise_px2 = max(float(np.average(e * e, weights=w)), known**2)
        prior[_LEAN, _LEAN] = noise_px2 / settings.sway_std_rad**2 * np.eye(2)
        information = j.T @ (w[:, None] * j) + prior
        try:
            inverse = np.asarray(np.linalg.inv(information), dtype=np.float64)
        except np.linalg.LinAlgError:
            return None
        if step == settings.steps:
            break
        state = state + inverse @ (j.T @ (w * e) - prior @ np.array([0.0, 0.0, 0.0, *state[_LEAN]]))
    pulls = np.where(used[:, None], np.nan_to_num(weight * residual)[:, None] * np.nan_to_num(jacobian), 0.0)
    whole = len(pulls) // settings.group * settings.group
    groups = pulls[:whole].reshape(-1, settings.group, 5).sum(axis=1)
    covariance = inverse @ (inflate * groups.T @ groups + systematic * information) @ inverse
    lean = state[_LEAN]
    if not np.isfinite(covariance).all() or _is_upright(lean, settings.gate * covariance[_LEAN, _LEAN]):
        return None
    return LeanFit(state[_POSE], tuple(lean.tolist()), covariance[_POSE, _POSE], residual, rows.predicted_px)


def _is_upright(lean: FloatArray, bound: FloatArray) -> bool:
    """Whether a lean (2,) lies within the ellipse of a matrix (2, 2)."""
    return float(lean @ np.linalg.solve(bound, lean)) < 1.0


class _Rows:
    """Residuals of an outline and their derivatives by x, y, theta, pitch and roll."""

    def __init__(self, scene: WallScene, outline: FloorOutline, scale_px: float) -> None:
        self._scene, self._outline, self._scale_px = scene, outline, scale_px
        count = len(scene.cos_b)
        planes = np.empty((len(scene.walls), 4, 3))
        self._out = WallPrediction(np.empty(count), np.empty(count, dtype=np.int64), planes)
        self._q_of = np.arange(len(outline.radius_of_q)) * outline.q_step
        self.predicted_px = np.full(count, np.nan)

    def at(self, state: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return (K, 5) derivatives, (K,) residuals in pixels, NaN where none, and (K,) weights."""
        pitch, roll = state[_LEAN].tolist()
        pitched, rolled = self._predict(state, pitch + _STEP_RAD, roll), self._predict(state, pitch, roll + _STEP_RAD)
        q, wall = self._predict(state, pitch, roll), self._out.wall
        by_lean = [(leaned - q) / _STEP_RAD for leaned in (pitched, rolled)]
        planes = self._out.planes[np.maximum(wall, 0)]
        cos, sin, outline = self._scene.cos_b, self._scene.sin_b, self._outline
        predicted = np.interp(q, self._q_of, outline.radius_of_q)
        cell = np.minimum((q / outline.q_step).astype(np.int64), len(outline.radius_of_q) - 2)
        slope = (outline.radius_of_q[cell + 1] - outline.radius_of_q[cell]) / outline.q_step
        turn = slope * (planes[:, 0, 1] * cos - planes[:, 0, 0] * sin) / predicted
        oblique = slope / np.sqrt(1.0 + turn * turn)
        by_pose = [
            planes[:, p, 0] * cos + planes[:, p, 1] * sin - q * planes[:, p, 2] for p in range(1, 4)
        ]  # of the inverse range
        jacobian = np.stack([*by_pose, *by_lean], axis=1) * oblique[:, None]
        residual = np.where(
            (outline.radius > 0) & (wall >= 0), (outline.radius - predicted) / np.sqrt(1.0 + turn * turn), np.nan
        )
        self.predicted_px = np.where(wall >= 0, predicted, np.nan)
        # as `fit_walls` weighs: an obstacle hides floor, floor beyond a wall cannot be
        ratio = residual / np.where(residual < 0, self._scale_px, 3.0 * self._scale_px)
        return jacobian, residual, 1.0 / (1.0 + ratio * ratio) ** 2

    def _predict(self, state: FloatArray, pitch_rad: float, roll_rad: float) -> FloatArray:
        """Return the inverse range (K,) of each bearing's wall."""
        predict_walls(state[_POSE], leaning(self._scene, pitch_rad, roll_rad), self._out)
        return self._out.q.copy()

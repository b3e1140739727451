"""Filters the motion of robots with an interacting multiple model (IMM) filter.

A robot of the league drives straight on for a while, then accelerates or brakes as hard as it can. A single model of
motion either smooths too little in the first case or lags behind in the second. Here each robot has several models,
each with its own Kalman filter; their probabilities follow from how well they predict the detections (Blom and
Bar-Shalom 1988). All robots of a frame are filtered in one vectorised step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray

IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class MotionModel:
    """One model of a robot's motion, the same along both axes."""

    decay_s: float  #: time constant with which its acceleration decays (Singer 1970); 0: it has no acceleration
    power: float  #: power of the process noise: of the jerk, m^2/s^5, or if `decay_s` is 0 of the acceleration, m^2/s^3


# straight on; gentle acceleration; hard acceleration; a command that has just changed
MODELS = (MotionModel(0.0, 0.001), MotionModel(1.0, 3.0), MotionModel(0.5, 100.0), MotionModel(0.2, 5000.0))
# mean time for which a robot keeps to one model
_STAY_S = 1.0
# standard deviation of a detection along each axis
_STD_M = 0.0013
#: standard deviation of the velocity of something new
START_SPEED_MPS = 2.0
# time constant with which the acceleration decays in extrapolation beyond the last frame
_FORESIGHT_S = 0.03


class MotionFilter:
    """Positions and velocities of any number of robots, each in a row of its own."""

    def __init__(self, models: tuple[MotionModel, ...] = MODELS) -> None:
        count = len(models)
        self._decay_s = np.array([model.decay_s for model in models])
        self._power = np.array([model.power for model in models])
        self._t_s: FloatArray = np.empty(0)
        # by row, model, axis: position, velocity, acceleration; their covariance is the same for both axes
        self._mean: FloatArray = np.empty((0, count, 2, 3))
        self._cov: FloatArray = np.empty((0, count, 3, 3))
        self._prob: FloatArray = np.empty((0, count))

    def add(self) -> int:
        """Return the number of a new row, which must be initialised with `start`."""
        models = len(self._decay_s)
        self._t_s = np.append(self._t_s, 0.0)
        self._mean = np.append(self._mean, np.zeros((1, models, 2, 3)), axis=0)
        self._cov = np.append(self._cov, np.zeros((1, models, 3, 3)), axis=0)
        self._prob = np.append(self._prob, np.full((1, models), 1.0 / models), axis=0)
        return len(self._t_s) - 1

    def start(self, row: int, t_s: float, x_m: float, y_m: float) -> None:
        """Initialise a row with a place detected at a time."""
        self._t_s[row] = t_s
        self._mean[row] = 0.0
        self._mean[row, :, 0, 0], self._mean[row, :, 1, 0] = x_m, y_m
        self._prob[row] = 1.0 / len(self._decay_s)
        self._cov[row] = np.diag([_STD_M**2, START_SPEED_MPS**2, 0.0])
        self._cov[row, self._decay_s > 0, 2, 2] = START_SPEED_MPS**2

    def predict(self, rows: IntArray, t_s: float) -> None:
        """Predict rows (N,) to a time; those that are at that time or later stay."""
        rows = rows[self._t_s[rows] < t_s]
        if not len(rows):
            return
        dt = t_s - self._t_s[rows]
        mean, cov = self._mixed(rows, dt)
        step = _transitions(dt[:, None], self._decay_s)
        self._mean[rows] = np.einsum("nkij,nkaj->nkai", step, mean)
        self._cov[rows] = step @ cov @ np.swapaxes(step, -1, -2) + self._noise(dt[:, None])
        self._t_s[rows] = t_s

    def innovations(self, rows: IntArray, places_m: FloatArray, t_s: float) -> FloatArray:
        """Return detections (N, 2) of a time minus the predictions of rows (N,) for it: (N, 2) metres."""
        ahead_s = (t_s - self._t_s[rows])[:, None]
        mean = np.einsum("nk,nkai->nai", self._prob[rows], self._mean[rows])
        return np.asarray(places_m - mean[:, :, 0] - ahead_s * mean[:, :, 1])

    def update(self, rows: IntArray, places_m: FloatArray, t_s: float) -> None:
        """Update rows (N,) with detections (N, 2), whose time is that of the rows or shortly before."""
        mean, cov = self._mean[rows], self._cov[rows]
        late_s = (self._t_s[rows] - t_s)[:, None, None]
        innovation = places_m[:, None, :] - (mean[..., 0] - late_s * mean[..., 1])
        total = cov[..., 0, 0] + _STD_M**2
        gain = cov[..., :, 0] / total[..., None]
        self._mean[rows] = mean + innovation[..., None] * gain[..., None, :]
        self._cov[rows] = cov - gain[..., :, None] * cov[..., None, 0, :]
        exponent = np.sum(innovation**2, axis=-1) / (2 * total)
        # relative to the likeliest model, so that not all likelihoods underflow
        likelihood = np.exp(-(exponent - exponent.min(axis=1, keepdims=True))) / total
        probability = self._prob[rows] * likelihood
        self._prob[rows] = probability / probability.sum(axis=1, keepdims=True)

    def at(self, rows: IntArray, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Return positions and velocities (N, 2) of rows (N,) at a time."""
        dt = (t_s - self._t_s[rows])[:, None]
        mean = np.einsum("nk,nkai->nai", self._prob[rows], self._mean[rows])
        ahead_s = np.maximum(dt, 0.0)
        gone = -np.expm1(-ahead_s / _FORESIGHT_S)
        velocity = mean[..., 1] + _FORESIGHT_S * gone * mean[..., 2]
        place = mean[..., 0] + dt * mean[..., 1] + _FORESIGHT_S * (ahead_s - _FORESIGHT_S * gone) * mean[..., 2]
        return place, velocity

    def _mixed(self, rows: IntArray, dt: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the mixed means and covariances of each model for the next step; updates the probabilities."""
        count = len(self._decay_s)
        mean, cov, before = self._mean[rows], self._cov[rows], self._prob[rows]
        if count == 1:
            return mean, cov
        stays = np.exp(-dt / _STAY_S)[:, None, None]
        change = np.where(np.eye(count, dtype=bool), stays, (1.0 - stays) / (count - 1))
        joint = before[:, :, None] * change
        after = np.maximum(joint.sum(axis=1), 1e-12)
        weight = joint / after[:, None, :]
        mixed = np.einsum("nij,niax->njax", weight, mean)
        # both axes share one covariance, so their spreads are averaged
        apart = mean[:, :, None] - mixed[:, None, :]
        spread = np.einsum("nij,nijax,nijay->njxy", weight, apart, apart) / 2
        self._prob[rows] = after
        return mixed, np.einsum("nij,nixy->njxy", weight, cov) + spread

    def _noise(self, dt: FloatArray) -> FloatArray:
        """Return the process noise (N, K, 3, 3) over times (N, 1)."""
        out = np.zeros((len(dt), len(self._decay_s), 3, 3))
        still = self._decay_s == 0.0
        jerky = ~still
        power = self._power * np.ones_like(dt)
        out[:, still, 0, 0] = (power * dt**3 / 3)[:, still]
        out[:, still, 0, 1] = out[:, still, 1, 0] = (power * dt**2 / 2)[:, still]
        out[:, still, 1, 1] = (power * dt)[:, still]
        out[:, jerky, 0, 0] = (power * dt**5 / 20)[:, jerky]
        out[:, jerky, 0, 1] = out[:, jerky, 1, 0] = (power * dt**4 / 8)[:, jerky]
        out[:, jerky, 0, 2] = out[:, jerky, 2, 0] = (power * dt**3 / 6)[:, jerky]
        out[:, jerky, 1, 1] = (power * dt**3 / 3)[:, jerky]
        out[:, jerky, 1, 2] = out[:, jerky, 2, 1] = (power * dt**2 / 2)[:, jerky]
        out[:, jerky, 2, 2] = (power * dt)[:, jerky]
        return out


def _transitions(dt: FloatArray, decay_s: FloatArray) -> FloatArray:
    """Return the transition matrices (N, K, 3, 3) of position, velocity and acceleration over times (N, 1)."""
    out = np.zeros((len(dt), len(decay_s), 3, 3))
    out[..., 0, 0] = out[..., 1, 1] = 1.0
    out[..., 0, 1] = dt
    for model, fade_s in enumerate(decay_s.tolist()):
        if fade_s > 0:
            time = dt[:, 0]
            gone = -np.expm1(-time / fade_s)
            out[:, model, 0, 2] = fade_s * (time - fade_s * gone)
            out[:, model, 1, 2] = fade_s * gone
            out[:, model, 2, 2] = 1.0 - gone
    return out

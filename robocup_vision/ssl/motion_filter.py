"""How robots move, filtered by several models of motion at once: an interacting multiple model (IMM) filter.

A robot of the league drives straight on for a while, then speeds up or brakes as hard as it can. One model of motion
either smooths too little in the one case or lags behind in the other. Here each robot has several, each with its own
Kalman filter; how well each foretells the next detection says how probable it is (Blom and Bar-Shalom 1988). All robots
of a frame are filtered in one go.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray

IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class MotionModel:
    """One model of how a robot moves, the same along both axes."""

    decay_s: float  #: its acceleration fades in about this time (Singer 1970); 0: it has none
    power: float  #: of the noise that disturbs it: of the jerk, m^2/s^5, or, without an acceleration, of that, m^2/s^3


# straight on; speeding up gently; hard; and a command that has just changed
MODELS = (MotionModel(0.0, 0.001), MotionModel(1.0, 3.0), MotionModel(0.5, 100.0), MotionModel(0.2, 5000.0))
# mean time for which a robot moves by one model
_STAY_S = 1.0
# noise of a detection, each axis
_STD_M = 0.0013
#: how fast something new may be, as a standard deviation
START_SPEED_MPS = 2.0
# time constant with which an acceleration is extrapolated beyond the last frame
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
        """Return the number of a new row; `start` it."""
        models = len(self._decay_s)
        self._t_s = np.append(self._t_s, 0.0)
        self._mean = np.append(self._mean, np.zeros((1, models, 2, 3)), axis=0)
        self._cov = np.append(self._cov, np.zeros((1, models, 3, 3)), axis=0)
        self._prob = np.append(self._prob, np.full((1, models), 1.0 / models), axis=0)
        return len(self._t_s) - 1

    def start(self, row: int, t_s: float, x_m: float, y_m: float) -> None:
        """Begin a row anew with something detected at a time."""
        self._t_s[row] = t_s
        self._mean[row] = 0.0
        self._mean[row, :, 0, 0], self._mean[row, :, 1, 0] = x_m, y_m
        self._prob[row] = 1.0 / len(self._decay_s)
        self._cov[row] = np.diag([_STD_M**2, START_SPEED_MPS**2, 0.0])
        self._cov[row, self._decay_s > 0, 2, 2] = START_SPEED_MPS**2

    def predict(self, rows: IntArray, t_s: float) -> None:
        """Go on with rows (N,) to a time; those that are there or beyond stay."""
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
        """Return how far detections (N, 2) of a time lie from where rows (N,) should be then: (N, 2) metres."""
        ahead_s = (t_s - self._t_s[rows])[:, None]
        mean = np.einsum("nk,nkai->nai", self._prob[rows], self._mean[rows])
        return np.asarray(places_m - mean[:, :, 0] - ahead_s * mean[:, :, 1])

    def update(self, rows: IntArray, places_m: FloatArray, t_s: float) -> None:
        """Take in detections (N, 2) of a time at or shortly before that of the rows (N,)."""
        mean, cov = self._mean[rows], self._cov[rows]
        late_s = (self._t_s[rows] - t_s)[:, None, None]
        innovation = places_m[:, None, :] - (mean[..., 0] - late_s * mean[..., 1])
        total = cov[..., 0, 0] + _STD_M**2
        gain = cov[..., :, 0] / total[..., None]
        self._mean[rows] = mean + innovation[..., None] * gain[..., None, :]
        self._cov[rows] = cov - gain[..., :, None] * cov[..., None, 0, :]
        exponent = np.sum(innovation**2, axis=-1) / (2 * total)
        # the likeliest model's exponent is taken out: the others must not underflow together
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
        """Return means and covariances with which each model goes on, mixed from all; updates the probabilities."""
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
        # the axes share one covariance: their spreads are averaged
        apart = mean[:, :, None] - mixed[:, None, :]
        spread = np.einsum("nij,nijax,nijay->njxy", weight, apart, apart) / 2
        self._prob[rows] = after
        return mixed, np.einsum("nij,nixy->njxy", weight, cov) + spread

    def _noise(self, dt: FloatArray) -> FloatArray:
        """Return what a time (N, 1) adds to the covariances: (N, K, 3, 3)."""
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
    """Return the matrices (N, K, 3, 3) that carry position, velocity and acceleration over times (N, 1)."""
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

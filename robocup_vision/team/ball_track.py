"""Filters one robot's own sightings of the ball: a Kalman filter of place and velocity, field frame.

With a nodding camera a far ball is seen alternately too near and too far; the filter averages these errors. A sighting
outside of the gate is ignored; a second one in a row restarts the track, as after a kick or a wrong sighting.
"""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.normal import GATE_2D
from robocup_vision.team.message import BallSighting

# number of consecutive frames with the same error: a step of a walking robot takes several frames. The variance of a
# sighting is multiplied by it.
_CORRELATED_FRAMES = 4.0
_START_SPEED_MPS = 0.5  # standard deviation of the velocity of a new track: balls lie, roll, or were kicked
# square root of the spectral density of the acceleration: other robots touch the ball
_ACCELERATION_MPS15 = 0.5
_ROLL_S = 1.5  # a ball loses its velocity with this time constant
_MAX_GAP_S = 1.0  # after this time without a sighting the next one restarts the track


class BallTrack:
    """Tracks the ball by the sightings of one robot."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Forget the ball, because it is not there."""
        self._t_s = -math.inf
        self._state: FloatArray = np.zeros(4)
        self._covariance: FloatArray = np.eye(4)
        self._is_doubted = False

    @property
    def sighting(self) -> BallSighting | None:
        """The filtered state at the last sighting; None if there was none."""
        if self._t_s == -math.inf:
            return None
        x_m, y_m, vx_mps, vy_mps = self._state.tolist()
        velocity_std_mps = math.sqrt(max(0.5 * float(np.trace(self._covariance[2:, 2:])), 0.0))
        return BallSighting(self._t_s, x_m, y_m, vx_mps, vy_mps, self._covariance[:2, :2], velocity_std_mps)

    def update(self, place: tuple[float, float], covariance: FloatArray, t_s: float) -> None:
        """Update with a sighting; one that is not newer than the last is ignored.

        Parameters
        ----------
        place : (float, float)
            Place of the ball, field frame, metres.
        covariance : (2, 2) float64
            Covariance of the place, square metres.
        """
        # composed covariances are symmetric except for rounding, but messages need exact symmetry
        covariance = 0.5 * (covariance + covariance.T)
        dt_s = t_s - self._t_s
        if dt_s <= 0.0:
            return
        if dt_s > _MAX_GAP_S:
            self._begin(place, covariance, t_s)
            return
        state, predicted = self._predicted(dt_s)
        noise = _CORRELATED_FRAMES * covariance
        innovation = np.asarray(place) - state[:2]
        spread = predicted[:2, :2] + noise
        if float(innovation @ np.linalg.solve(spread, innovation)) > GATE_2D:
            if self._is_doubted:
                self._begin(place, covariance, t_s)
            else:
                self._is_doubted = True
            return
        gain = np.linalg.solve(spread, predicted[:2]).T
        self._state = state + gain @ innovation
        rest = np.eye(4)
        rest[:, :2] -= gain
        # Joseph's form stays positive definite in spite of rounding
        covariance = rest @ predicted @ rest.T + gain @ noise @ gain.T
        # rounding makes it slightly asymmetric, the more the farther away the ball is
        self._covariance = 0.5 * (covariance + covariance.T)
        self._t_s, self._is_doubted = t_s, False

    def _begin(self, place: tuple[float, float], covariance: FloatArray, t_s: float) -> None:
        self._t_s, self._is_doubted = t_s, False
        self._state = np.array([*place, 0.0, 0.0])
        self._covariance = np.zeros((4, 4))
        self._covariance[:2, :2] = covariance
        self._covariance[2:, 2:] = _START_SPEED_MPS**2 * np.eye(2)

    def _predicted(self, dt_s: float) -> tuple[FloatArray, FloatArray]:
        slower = math.exp(-dt_s / _ROLL_S)
        motion = np.eye(4)
        motion[0, 2] = motion[1, 3] = _ROLL_S * (1.0 - slower)
        motion[2, 2] = motion[3, 3] = slower
        density = _ACCELERATION_MPS15**2
        noise = density * np.kron(np.array([[dt_s**3 / 3, dt_s**2 / 2], [dt_s**2 / 2, dt_s]]), np.eye(2))
        return motion @ self._state, motion @ self._covariance @ motion.T + noise

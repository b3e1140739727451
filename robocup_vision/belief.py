"""Estimates over time as plain values: pose hypotheses, tracked objects and the map."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robocup_vision.arrays import FloatArray, UInt8Array, read_only
from robocup_vision.disc import Disc
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2

# position and velocity in a track's state
_POSITION, _VELOCITY = slice(0, 2), slice(2, 4)


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """One possible pose of the robot.

    Parameters
    ----------
    pose : Pose2
        Pose of the robot in the field frame.
    covariance : (3, 3) float64
        Covariance of (x_m, y_m, theta_rad), in m, m and rad.
    probability : float
        Probability; those of all hypotheses add up to 1.
    """

    pose: Pose2
    covariance: FloatArray
    probability: float


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """A tracked object."""

    number: int  #: number of the track, constant while the object is tracked
    #: place and velocity in the field frame
    x_m: float
    y_m: float
    vx_mps: float
    vy_mps: float
    covariance: FloatArray  #: (4, 4) float64: covariance of place and velocity, m and m/s
    probability: float  #: probability that the object is within two thirds of its width from this place
    frames: int  #: number of frames for which it has been tracked
    missed: int  #: number of consecutive frames, up to this one, without a detection

    def __post_init__(self) -> None:
        object.__setattr__(self, "covariance", read_only(self.covariance))

    def place_after(self, seconds: float) -> tuple[float, float]:
        """Return its place a time after the track's frame, at constant velocity, field frame."""
        return self.x_m + seconds * self.vx_mps, self.y_m + seconds * self.vy_mps

    def as_disc(self, robot: Pose2, radius_m: float, seconds: float = 0.0) -> Disc:
        """Return a disc in the robot frame, with velocity and both covariances, for `Steering.steer`.

        Parameters
        ----------
        robot : Pose2
            Present pose of the robot in the field frame.
        radius_m : float
            Radius of the object.
        seconds : float
            Time since the track's frame.
        """
        x, y = robot.inverse().transform(self.place_after(seconds)).tolist()
        c, s = math.cos(robot.theta_rad), math.sin(robot.theta_rad)
        vx, vy = c * self.vx_mps + s * self.vy_mps, c * self.vy_mps - s * self.vx_mps
        robot_from_field = np.array([[c, s], [-s, c]])
        position, velocity = (
            robot_from_field @ self.covariance[part, part] @ robot_from_field.T for part in (_POSITION, _VELOCITY)
        )
        return Disc(x, y, radius_m, position, vx_mps=vx, vy_mps=vy, velocity_covariance=velocity)


@dataclass(frozen=True, slots=True, eq=False)
class MapPicture:
    """The map of free floor at one moment."""

    #: (N, N) uint8: `mapping.occupancy.FREE`, NO_GO or UNDECIDED; first index along x of the field frame
    state: UInt8Array
    corner_m: tuple[float, float]  #: corner of cell (0, 0) with the least x and y, field frame
    cell_m: float  #: side of a cell


@dataclass(frozen=True, slots=True)
class Belief:
    """The estimates after a frame, from all frames so far.

    Parameters
    ----------
    t_s : float
        Time of the frame.
    pose : PoseEstimate or NotLocated
        Pose of the robot in the field frame.
    hypotheses : tuple of Hypothesis
        Its possible poses with probabilities, most probable first.
    tracks : tuple of Track
        Other robots; empty without tracking.
    free_map : MapPicture or None
        Map of the free floor; None without a map, or while the pose is unknown.
    """

    t_s: float
    pose: PoseEstimate | NotLocated
    hypotheses: tuple[Hypothesis, ...]
    tracks: tuple[Track, ...]
    free_map: MapPicture | None

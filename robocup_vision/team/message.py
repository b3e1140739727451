"""The message that robots of one team send to each other, packed into few enough bytes for any league's radio.

A message holds only what its sender has measured itself, not what others have told it, so that nothing is counted
twice. The clocks of a team must be synchronised, as by a time server in the field's network.
"""

from __future__ import annotations

import math
import struct
import zlib
from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

import numpy as np

from field_models.errors import ArgumentError, PacketError
from robocup_vision.arrays import FloatArray, read_only
from robocup_vision.checks import require_not_negative
from robocup_vision.geometry import Pose2

Role: TypeAlias = Literal["search", "fetch", "support", "keep"]
ROLES: tuple[Role, ...] = get_args(Role)

MAX_MESSAGE_BYTES = 128
_MAGIC, _VERSION = b"RV", 1
_HAS_POSE, _HAS_BALL = 1, 2
# magic, version, sender, role, flags; time; time to the ball; pose and its covariance; the ball's time, place,
# velocity, covariance, and the velocity's standard deviation
_BODY = struct.Struct("<2sBBBBdf9fd8f")
_CHECK = struct.Struct("<I")
MESSAGE_BYTES = _BODY.size + _CHECK.size
_UPPER_3, _UPPER_2 = np.triu_indices(3), np.triu_indices(2)
# least ratio of a covariance's smallest eigenvalue to its largest: rounding to 32 bits may make it slightly negative
_MIN_EIGENVALUE_RATIO = -1e-5


@dataclass(frozen=True, slots=True, eq=False)
class BallSighting:
    """One robot's sighting of the ball, field frame.

    Raises
    ------
    ArgumentError
        If a number is not finite, or a covariance is not symmetric and positive semi-definite.
    """

    t_s: float  #: time of the sighting
    #: place and velocity at that time
    x_m: float
    y_m: float
    vx_mps: float
    vy_mps: float
    #: (2, 2) float64: covariance of the place, square metres, including the uncertainty of the robot's own pose
    covariance: FloatArray
    velocity_std_mps: float = 0.0  #: standard deviation of each component of the velocity

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, (self.t_s, self.x_m, self.y_m, self.vx_mps, self.vy_mps))):
            raise ArgumentError("the time, place and velocity of a ball must be finite")
        require_not_negative(self, "velocity_std_mps")
        object.__setattr__(self, "covariance", _checked_covariance(self.covariance, 2, "of a ball"))


@dataclass(frozen=True, slots=True, eq=False)
class TeamMessage:
    """What one robot reports to its team.

    Raises
    ------
    ArgumentError
        If a value is out of its range.
    """

    sender: int  #: the robot's number in the team, 0 to 255
    t_s: float  #: time at which the message was written
    role: Role  #: the robot's present role
    #: time that it would need to reach the ball; infinite if it does not know where the ball is
    time_to_ball_s: float = math.inf
    pose: Pose2 | None = None  #: its pose in the field frame; None if it does not know it
    pose_covariance: FloatArray | None = None  #: (3, 3) float64: covariance of x, y (m) and theta (rad)
    ball: BallSighting | None = None  #: its own last sighting of the ball

    def __post_init__(self) -> None:
        if not 0 <= self.sender <= 255:
            raise ArgumentError(f"sender must be within 0 to 255, got {self.sender}")
        if self.role not in ROLES:
            raise ArgumentError(f"role must be one of {', '.join(ROLES)}, got {self.role!r}")
        if not math.isfinite(self.t_s):
            raise ArgumentError(f"t_s must be finite, got {self.t_s!r}")
        if not self.time_to_ball_s >= 0.0:
            raise ArgumentError(f"time_to_ball_s must not be negative, got {self.time_to_ball_s!r}")
        if (self.pose is None) != (self.pose_covariance is None):
            raise ArgumentError("pose and pose_covariance are given together")
        if self.pose is not None and not np.isfinite(self.pose.array).all():
            raise ArgumentError("the pose of a message must be finite")
        if self.pose_covariance is not None:
            object.__setattr__(self, "pose_covariance", _checked_covariance(self.pose_covariance, 3, "of a pose"))

    def pack(self) -> bytes:
        """Return the message as `MESSAGE_BYTES` bytes; lengths and angles are rounded to 32 bits.

        Raises
        ------
        ArgumentError
            If a number is too large for 32 bits.
        """
        pose, pose_covariance, ball = [0.0] * 3, [0.0] * 6, [0.0] * 9
        if self.pose is not None and self.pose_covariance is not None:
            pose = self.pose.array.tolist()
            pose_covariance = self.pose_covariance[_UPPER_3].tolist()
        if self.ball is not None:
            b = self.ball
            ball = [b.t_s, b.x_m, b.y_m, b.vx_mps, b.vy_mps, *b.covariance[_UPPER_2].tolist(), b.velocity_std_mps]
        flags = (_HAS_POSE if self.pose is not None else 0) | (_HAS_BALL if self.ball is not None else 0)
        head = _MAGIC, _VERSION, self.sender, ROLES.index(self.role), flags
        try:
            body = _BODY.pack(*head, self.t_s, self.time_to_ball_s, *pose, *pose_covariance, *ball)
        except OverflowError:
            raise ArgumentError("a number of a team message is too large for 32 bits") from None
        return body + _CHECK.pack(zlib.crc32(body))


def unpack_message(data: bytes) -> TeamMessage:
    """Return the message that bytes hold.

    Raises
    ------
    PacketError
        If they are not a message of this version, or damaged.
    """
    if not isinstance(data, bytes):
        raise PacketError(f"a team message is bytes, got {type(data).__name__}")
    if data[:2] != _MAGIC:
        raise PacketError(f"these {len(data)} bytes are no team message: they do not begin with {_MAGIC.decode()}")
    if len(data) > 2 and data[2] != _VERSION:
        raise PacketError(f"the team message has version {data[2]}, this program reads version {_VERSION}")
    if len(data) != MESSAGE_BYTES:
        raise PacketError(f"a team message has {MESSAGE_BYTES} bytes, got {len(data)}")
    body = data[: _BODY.size]
    if _CHECK.unpack(data[_BODY.size :])[0] != zlib.crc32(body):
        raise PacketError("the team message is damaged: its checksum does not fit")
    _, _, sender, role, flags, t_s, time_to_ball_s, *numbers = _BODY.unpack(body)
    if role >= len(ROLES) or flags & ~(_HAS_POSE | _HAS_BALL):
        raise PacketError(f"the team message has role {role} and flags {flags}, which this version does not know")
    pose = covariance = ball = None
    try:
        if flags & _HAS_POSE:
            # 32 bits round pi to a heading just outside of [-pi, pi]
            heading_rad = max(-math.pi, min(numbers[2], math.pi)) if abs(numbers[2]) < 3.2 else numbers[2]
            pose, covariance = Pose2(numbers[0], numbers[1], heading_rad), _symmetric(numbers[3:9], 3)
        if flags & _HAS_BALL:
            ball_t_s, x_m, y_m, vx_mps, vy_mps = numbers[9:14]
            ball = BallSighting(ball_t_s, x_m, y_m, vx_mps, vy_mps, _symmetric(numbers[14:17], 2), numbers[17])
        return TeamMessage(sender, t_s, ROLES[role], time_to_ball_s, pose, covariance, ball)
    except ArgumentError as error:
        raise PacketError(f"the team message has impossible values: {error}") from None


def _symmetric(upper: list[float], size: int) -> FloatArray:
    matrix = np.zeros((size, size))
    rows, columns = np.triu_indices(size)
    matrix[rows, columns] = matrix[columns, rows] = upper
    return matrix


def _checked_covariance(matrix: FloatArray, size: int, what: str) -> FloatArray:
    covariance = read_only(matrix)
    if covariance.shape != (size, size) or not np.isfinite(covariance).all():
        raise ArgumentError(f"the covariance {what} must be ({size}, {size}) and finite, got shape {covariance.shape}")
    values = np.linalg.eigvalsh(covariance)
    if not np.array_equal(covariance, covariance.T) and not np.allclose(covariance, covariance.T):
        raise ArgumentError(f"the covariance {what} must be symmetric")
    if values[0] < _MIN_EIGENVALUE_RATIO * max(values[-1], 0.0) or values[-1] < 0.0:
        raise ArgumentError(f"the covariance {what} must not be negative in any direction")
    return covariance

"""Choice of a velocity command that does not collide, from free ranges, the robot's velocity and the target's bearing.

The method of Sekimori et al. (2001), section 3.2: obstacles are grown by the robot's radius; for each direction a
trajectory is predicted under the acceleration limit and the dead time, and its time to contact computed; the safe
direction nearest to the target is taken. Known moving obstacles are removed from the free ranges and predicted on their
own. The loops are compiled (`robocup_vision.kernels.motion.steering`).
"""

from __future__ import annotations

import math
import numbers
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, cast

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arguments import as_angle, as_number, require_kind
from robocup_vision.arrays import FloatArray
from robocup_vision.checks import require_at_least
from robocup_vision.compiling.loops import plain
from robocup_vision.compiling.prepared_kernels import prepare
from robocup_vision.disc import Disc
from robocup_vision.kernels.mapping import grown_profile
from robocup_vision.kernels.motion import steering as kernel
from robocup_vision.kernels.motion.moving_contact import COLUMNS
from robocup_vision.motion_limits import MotionLimits

# A higher speed is probably in a wrong unit, and sampling its stopping distance step by step would take very long.
_MAX_SPEED_MPS = 100.0
_REASONS = (
    "no safe direction: braking",
    "no safe direction, braking would touch: latest contact",
)


@dataclass(frozen=True, slots=True)
class SteeringSettings:
    """How `Steering` chooses commands.

    Raises
    ------
    ArgumentError
        A value is out of its range.
    """

    #: The paper's T_th, one for all directions. None derives it per direction: a command is safe when it can be carried
    #: out to its end and the robot can then still stop. The end is reached after ``|dv_j|`` / alpha, the stopping
    #: distance v^2 / (2 alpha) takes v / (2 alpha) at speed v, and the next decision comes a period and again a dead
    #: time later: T_j >= 2 dead_time + period + ``|dv_j|`` / alpha + v / (2 alpha). Then the command given now stays
    #: safe until it is reached, and braking is safe after that, so that nothing that stands still is ever touched. (The
    #: paper's 2.75 s is the time 2 v / alpha of a full reversal plus the dead time.)
    time_threshold_s: float | None = None
    directions: int = 48  #: number J of directions that are tried: 7.5 degrees apart, as in the paper
    period_s: float = 1 / 30  #: time between two commands
    step_m: float = 0.004  #: largest distance between two samples of a trajectory close to an obstacle
    #: False: the paper's comparison, which takes the present velocity to be the commanded one (v_a = v_b)
    use_velocity: bool = True
    #: Remember the detour: by which angle, and to which side, obstacles have turned the robot from the target's
    #: bearing. The robot then does not alternate between two equally good ways round, and leaves dead ends. `forget`
    #: drops the memory. Use False where a `Wayfinder`, which remembers several views, gives the direction.
    keep_side: bool = True
    #: From the lowest speed tried the robot stops within this fraction of its radius, so it can enter all gaps it fits.
    stop_ratio: float = 0.25
    #: A larger detour leads away from the target: the robot then goes no faster than it can turn in its own length.
    away_rad: float = math.pi / 3.0
    #: The side of a detour changes only where the other side is nearer by more than this (hysteresis).
    other_side_rad: float = 0.25 * math.pi
    #: A larger detour to one side counts as one to the other; otherwise the robot would follow walls in circles.
    max_detour_rad: float = 1.25 * math.pi
    #: Margin around a moving obstacle: standard deviations of its position, and a bound, so that there are ways round.
    obstacle_sigmas: float = 1.0
    max_margin_m: float = 0.05
    return_margin_m: float = 0.05  #: a range that ends within this distance of a moving obstacle's rim is its return

    def __post_init__(self) -> None:
        require_at_least(
            self, 0.0, "period_s", "away_rad", "other_side_rad", "obstacle_sigmas", "max_margin_m", "return_margin_m"
        )
        require_at_least(self, 1e-4, "step_m")
        require_at_least(self, 1e-3, "stop_ratio")
        require_at_least(self, math.pi, "max_detour_rad")
        threshold = self.time_threshold_s
        if threshold is not None and not (math.isfinite(threshold) and threshold >= 0.0):
            raise ArgumentError(f"time_threshold_s must be at least 0, got {threshold!r}")
        require_at_least(self, 4, "directions")


def moving_table(
    moving: Sequence[Disc], robot_radius_m: float, settings: SteeringSettings = SteeringSettings()
) -> FloatArray:
    """Return the moving obstacles as the kernel `moving_contact_time` takes them, (M, 8) float64.

    Parameters
    ----------
    robot_radius_m : float
        Added to the obstacles' radii.
    settings : SteeringSettings, optional
        `obstacle_sigmas` and `max_margin_m` are used.
    """
    sigmas = settings.obstacle_sigmas
    rows = [
        (
            o.x_m, o.y_m, o.vx_mps, o.vy_mps, o.radius_m + robot_radius_m,
            sigmas * o.std_m, sigmas * o.velocity_std_mps, settings.max_margin_m,
        )
        for o in moving
    ]  # fmt: skip
    return np.array(rows, dtype=np.float64).reshape(-1, COLUMNS)


def ranges_past(
    bearing_rad: FloatArray,
    range_m: FloatArray,
    moving: Sequence[Disc],
    settings: SteeringSettings = SteeringSettings(),
) -> FloatArray:
    """Return free ranges (J,) in which each return of a moving obstacle is replaced by its neighbours' smaller range.

    Parameters
    ----------
    bearing_rad, range_m : (J,) float64
        Directions, ascending, and free ranges; robot frame.
    settings : SteeringSettings, optional
        `return_margin_m` is used.
    """
    own = np.zeros(len(bearing_rad), dtype=bool)
    half = 0.5 * float(np.median(np.diff(bearing_rad)))
    for o in moving:
        distance, reach = math.hypot(o.x_m, o.y_m), o.radius_m + settings.return_margin_m
        width = math.asin(min(reach / distance, 1.0)) if distance > 0 else math.pi
        off = np.abs(np.remainder(bearing_rad - math.atan2(o.y_m, o.x_m) + math.pi, math.tau) - math.pi)
        own |= (off <= width + half) & (np.abs(range_m - distance) <= reach)
    if not own.any() or own.all():
        return range_m
    past = range_m.copy()
    others = np.flatnonzero(~own)
    hidden = np.flatnonzero(own)
    after = np.searchsorted(others, hidden)
    past[hidden] = np.fmin(range_m[others[after - 1]], range_m[others[after % len(others)]])
    return past


class FreeRanges(Protocol):
    """What steering needs of a free space: bearings (J,) in radians, ascending, and ranges (J,) in metres."""

    @property
    def bearing_rad(self) -> FloatArray:
        """(J,) float64, radians, robot frame."""

    @property
    def range_m(self) -> FloatArray:
        """(J,) float64, metres from the robot's centre to the first thing that is not floor."""


def bearings_and_ranges(free_space: FreeRanges, least: int) -> tuple[FloatArray, FloatArray]:
    """Return copies of the bearings (J,), radians, and the ranges (J,), metres, of a free space.

    Raises
    ------
    ArgumentError
        If the argument is not a free space, its sizes differ, or it has fewer bearings than `least`.
    """
    if not hasattr(free_space, "bearing_rad"):
        hint = "view.free_space" if hasattr(free_space, "free_space") else "bearing_rad and range_m"
        raise ArgumentError(f"free_space must be the free space of a view, {hint}, got {type(free_space).__name__}")
    bearing, range_m = (np.array(of, dtype=np.float64) for of in (free_space.bearing_rad, free_space.range_m))
    if bearing.ndim != 1 or range_m.shape != bearing.shape or len(bearing) < least:
        raise ArgumentError(
            f"free space needs (J,) bearings and ranges, J at least {least},"
            f" got bearing_rad {bearing.shape} and range_m {range_m.shape}"
        )
    return bearing, range_m


@dataclass(frozen=True, slots=True)
class SteeringCommand:
    """A velocity command, and its reason.

    Parameters
    ----------
    velocity_mps : (2,) float64
        Velocity to command, robot frame, m/s.
    safe : bool
        The trajectory of this command and the stop after it are free. False: an emergency command (mostly zero).
    bearing_rad : float or None
        Chosen direction, robot frame; None when braking.
    time_to_contact_s : (J,) float64
        T_j of each direction at the requested speed (eq. 15); inf where nothing is touched within the horizon.
    directions_rad : (J,) float64
        The directions.
    reason : str
        ``towards target``, ``around obstacle``, or why there is no safe direction.
    """

    velocity_mps: FloatArray
    safe: bool
    bearing_rad: float | None
    time_to_contact_s: FloatArray
    directions_rad: FloatArray
    reason: str


class Steering:
    """Chooses velocity commands; one object per robot and thread.

    Parameters
    ----------
    robot_radius_m : float
        Obstacles are grown by this radius and half a `step_m`. Include the clearance that sensing and slip require.
    limits : MotionLimits
        Speed v_c of eq. 11, limit alpha of eq. 10, and the dead time: from the decision until the robot obeys, it goes
        on with its present velocity.
    settings : SteeringSettings, optional
        Settings for the choice of commands.

    Notes
    -----
    Each measured bearing stands for its whole sector, which reaches halfway to its neighbours and is blocked from the
    range on: there are no gaps between bearings. A measured range below the robot's radius counts as contact; motion
    away from it is free. An unmeasured bearing (NaN range, or outside the camera's view) is blocked at range 0: the
    robot's centre may not enter it. Nothing is known to stand there, so it is not grown.

    The detour is one signed angle, as in the Pledge algorithm for mazes. The wanted direction is the target's bearing
    turned by the detour. An obstacle in that direction increases the detour, and changes its side only where the other
    side is much nearer. Free driving reduces the detour, in the tightest arc that the robot can drive along the
    obstacle and round its corners. In a dead end the robot thus follows the inside back out, and turns to the target
    once it has turned back as much as it turned away. Away from the target it drives no faster than it can turn within
    its own length; otherwise it would overshoot every corner. The detour ends early where the straight way to the
    target is visible and free. A detour beyond `max_detour_rad` is taken for one to the other side; otherwise the robot
    would follow the walls of a field in circles.

    Where the wanted direction is not safe at the requested speed, half of that speed is tried too, then a quarter, down
    to a speed from which the robot stops at once. For each speed the safe direction nearest to the wanted one is a
    candidate; the candidate with the greatest speed in the wanted direction is taken. Otherwise a fast robot would move
    to and fro before a gap that only a slow one may enter, because away from it there is always a safe direction at
    full speed. If no direction is safe at any speed, the robot brakes. If braking ends in contact and no command before
    was safe, the command with the latest contact is given.

    Raises
    ------
    ArgumentError
        An argument is out of its range.
    """

    def __init__(
        self, robot_radius_m: float, limits: MotionLimits, settings: SteeringSettings = SteeringSettings()
    ) -> None:
        robot_radius_m = as_number("robot_radius_m", robot_radius_m)
        require_kind("limits", limits, MotionLimits, "MotionLimits(speed_mps, ...)")
        if not robot_radius_m >= 1e-6:
            raise ArgumentError(f"robot_radius_m must be at least 1e-06, got {robot_radius_m!r}")
        self.robot_radius_m, self.limits, self.settings = robot_radius_m, limits, settings
        # Half a step of clearance, since trajectories are only sampled, and braking midway leaves the checked one.
        self._radius_m = float(robot_radius_m + 0.5 * settings.step_m)
        stop_m = 0.5 * limits.speed_mps**2 / limits.acceleration_mps2
        threshold = settings.time_threshold_s
        self._rules = kernel.Rules(
            speed=float(limits.speed_mps),
            acceleration=float(limits.acceleration_mps2),
            dead_time=float(limits.dead_time_s),
            period=float(settings.period_s),
            threshold=-1.0 if threshold is None else float(threshold),
            step_m=float(settings.step_m),
            levels=max(3, math.ceil(1.0 + 0.5 * math.log2(stop_m / (settings.stop_ratio * robot_radius_m)))),
            use_velocity=bool(settings.use_velocity),
            away_rad=float(settings.away_rad),
            other_side_rad=float(settings.other_side_rad),
            max_detour_rad=float(settings.max_detour_rad),
        )
        self._detour_rad = 0.0
        self._may_brake = False
        directions = settings.directions
        self._directions: FloatArray = np.arange(directions, dtype=np.float64) * (math.tau / directions)
        self._directions.flags.writeable = False
        self._units = np.stack([np.cos(self._directions), np.sin(self._directions)], axis=1)
        # Plain numbers are read faster than elements of arrays. The last one, index -1, is braking.
        self._moves = [*zip(self._directions.tolist(), *self._units.T.tolist(), strict=True), (math.nan, 0.0, 0.0)]
        self._near_target_rad = math.pi / directions * 1.001
        # arguments of compiled code are made plain once, see `plain`
        self._plain_rules = plain(self._rules)
        self._profile = plain(
            grown_profile.Profile(
                profile_edges(grown_profile.BINS),
                np.empty(grown_profile.BINS),
                np.empty(grown_profile.FINE),
                np.empty(grown_profile.COARSE),
            )
        )
        # Read-only arrays are another type to the compiler, so the kernel gets a copy of its own.
        self._kernel_directions = self._directions.copy()
        self._nothing_moves = moving_table((), self._radius_m, settings)
        self._resize(3)
        prepare("steering")

    @property
    def is_fresh(self) -> bool:
        """Whether nothing is remembered: a new object made with the same arguments would decide the same."""
        return self._detour_rad == 0.0 and not self._may_brake

    def forget(self) -> None:
        """Drop the memory: the detour, and whether the last command was safe."""
        self._detour_rad = 0.0
        self._may_brake = False

    def steer(
        self,
        free_space: FreeRanges,
        velocity_mps: Sequence[float] | FloatArray,
        target_bearing_rad: float,
        target_distance_m: float | None = None,
        pending_mps: Sequence[float] | FloatArray | None = None,
        moving: Sequence[Disc] = (),
        speed_mps: float | None = None,
    ) -> SteeringCommand:
        """Choose the next command (the paper's Steps 1 to 5).

        Parameters
        ----------
        free_space : FreeRanges
            Bearings (J,), ascending within one turn, at least 3, and free ranges (J,); robot frame.
        velocity_mps : (2,) float64 or pair of float
            Present velocity v_a, robot frame.
        target_bearing_rad : float
            Direction of the target, robot frame.
        target_distance_m : float, optional
            Lets the robot arrive at rest: its speed is at most sqrt(2 alpha d), d without the distance that it travels
            during the dead time. In the target's direction, contacts beyond the target and the stopping distance are
            then ignored.
        pending_mps : (2,) float64 or pair of float, optional
            The command given before this one, robot frame, which acts during the dead time. By default the robot
            keeps its present velocity during the dead time.
        moving : sequence of Disc
            Obstacles with known velocity, robot frame. The robot avoids their predicted positions at each moment. A
            command is safe if it can be carried out to its end, or given up at the next decision, and the robot then
            stops before it meets any of them; an obstacle that runs into the standing robot is not considered. Without
            `use_velocity` they are treated as standing obstacles.
        speed_mps : float, optional
            Upper bound of the speed for this call; by default the robot's speed v_c.

        Returns
        -------
        SteeringCommand

        Raises
        ------
        ArgumentError
            Shapes do not fit; a velocity or the target's bearing is not finite; the target's distance is negative or
            NaN; the bearing is more than a turn; or a velocity is over 100 m/s.
        """
        bearing, range_m = bearings_and_ranges(free_space, 3)
        velocity = _pair("velocity_mps", velocity_mps)
        pending = velocity if pending_mps is None else _pair("pending_mps", pending_mps)
        target_bearing_rad = as_angle("target_bearing_rad", target_bearing_rad)
        distance = math.inf if target_distance_m is None else _number("target_distance_m", target_distance_m)
        if not distance >= 0.0:
            raise ArgumentError(f"target_distance_m must not be negative, got {target_distance_m!r}")
        if bearing.shape[0] != self._known_bearing.shape[0]:
            self._resize(bearing.shape[0])
        if speed_mps is not None and not _number("speed_mps", speed_mps) > 0.0:
            raise ArgumentError(f"speed_mps must be positive, got {speed_mps!r}")
        rules = self._plain_rules
        if speed_mps is not None:
            rules = plain(self._rules._replace(speed=min(float(speed_mps), self._rules.speed)))
        table = self._nothing_moves
        if type(moving) is not tuple or moving:
            if not isinstance(moving, Sequence) or not all(isinstance(disc, Disc) for disc in moving):
                raise ArgumentError("moving must be a sequence of Disc: track.as_disc(robot, radius_m)")
            if not self._rules.use_velocity:
                moving = ()
        if moving:
            range_m = ranges_past(bearing, range_m, moving, self.settings)
            table = moving_table(moving, self._radius_m, self.settings)
        time_to_contact = np.empty(self._directions.shape[0])
        outcome, index, speed, detour = kernel.steer(
            cast(kernel.Motion, (velocity, pending)),
            cast(kernel.Target, (float(target_bearing_rad), distance, self._detour_rad)),
            rules,
            cast(kernel.Directions, (self._kernel_directions, self._units, time_to_contact)),
            cast(kernel.Scan, (bearing, range_m, self._known_bearing, self._sectors)),
            self._radius_m,
            self._profile,
            table,
        )
        if outcome < 0:
            raise ArgumentError("bearing_rad must be finite and ascend within one turn")
        if self.settings.keep_side:
            self._detour_rad = detour
        # The last safe command left room to stop. If nothing moves, a contact that braking now seems to have comes only
        # from the width of the sectors as seen from here.
        if outcome == 2 and self._may_brake and not moving:
            outcome, index, speed = 1, -1, 0.0
        self._may_brake = outcome < 2 and (self._may_brake or outcome == 0)
        time_to_contact.setflags(write=False)
        direction, unit_x, unit_y = self._moves[index]
        command = np.array((speed * unit_x, speed * unit_y))
        command.setflags(write=False)
        if outcome > 0:
            reason = _REASONS[outcome - 1]
        elif abs(math.remainder(direction - target_bearing_rad, math.tau)) <= self._near_target_rad:
            reason = "towards target"
        else:
            reason = "around obstacle"
        return SteeringCommand(
            command, outcome == 0, None if index < 0 else direction, time_to_contact, self._directions, reason
        )

    def _resize(self, bearings: int) -> None:
        # NaN equals nothing, so the kernel measures the sectors at the first call.
        self._known_bearing = np.full(bearings, np.nan)
        self._sectors = plain(grown_profile.Sectors(np.empty((bearings, 4)), np.empty((bearings, 4), dtype=np.int64)))


def _number(name: str, value: object) -> float:
    """Return a number that may be infinite."""
    if not isinstance(value, numbers.Real):
        raise ArgumentError(f"{name} must be a number, got {value!r}")
    return float(value)


def _pair(name: str, value: Sequence[float] | FloatArray) -> tuple[float, float]:
    try:
        x, y = map(float, value)
    except (TypeError, ValueError):
        raise ArgumentError(f"{name} must be two numbers, got {value!r}") from None
    if not (math.isfinite(x) and math.isfinite(y)):
        raise ArgumentError(f"{name} must be finite, got {(x, y)!r}")
    if math.hypot(x, y) > _MAX_SPEED_MPS:
        raise ArgumentError(f"{name} must be at most {_MAX_SPEED_MPS:g} m/s long, got {(x, y)!r}")
    return x, y


def profile_edges(bins: int) -> FloatArray:
    """Return the unit vectors (bins + 1, 2) of the grown profile's bin edges, evenly spaced in the diamond angle.

    The diamond angle of (x, y) is y / (abs(x) + abs(y)), continued over the four quadrants to [0, 4).
    """
    quadrant, along = np.divmod(np.arange(bins + 1) * (4.0 / bins), 1.0)
    points = (1.0 - along + 1j * along) * 1j**quadrant
    points /= np.abs(points)
    return np.ascontiguousarray(np.stack([points.real, points.imag], axis=1))

"""What a player knows of the ball: its own sightings, who hides it, and what others told."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.belief import Track
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2, compose_covariance
from robocup_vision.perception.balls.ball import Ball
from robocup_vision.perception.free_space import FreeSpace
from robocup_vision.team.ball_track import BallTrack
from robocup_vision.team.message import BallSighting
from sim2d.players.team_talk import TeamTalk
from sim2d.robot_link import Point

# of a ball in the robot's mouth, along each axis
_MOUTH_STD_M = 0.01
# of a ball beyond the floor: its bearing is no better than a pixel of a small head's frame, its errors depend on others
_MIN_BEARING_STD_RAD, _MAX_CORRELATION = 0.005, 0.99


@dataclass(frozen=True, slots=True)
class BallMemorySettings:
    """Values of `BallMemory` and `HiddenBall`."""

    #: A ball unseen for so long may be anywhere: a kicked one crosses a field in this time.
    forget_s: float = 4.0
    #: Weight of a new velocity against the remembered one: smooths the error of two positions a frame apart.
    velocity_gain: float = 0.4
    #: Longest time between two positions of which a velocity is made: after more the ball may have turned.
    max_gap_s: float = 0.25
    #: A faster ball is a wrong detection.
    max_speed_mps: float = 4.0
    #: A ball unseen for so long at a visible place is gone from there.
    missed_s: float = 0.5
    #: A ball that others told of is not there if the robot sees the floor there from no farther than this: small
    #: cameras miss balls that are far.
    reported_missed_m: float = 1.0
    #: A ball unseen for so long is hidden by the robot that held it.
    hidden_s: float = 0.15
    #: A ball nearer than this to another robot's centre, in reaches (robot radius plus ball radius), is held by it.
    taken_reaches: float = 2.0


class BallMemory:
    """The ball as last seen, in the field frame."""

    def __init__(self, settings: BallMemorySettings = BallMemorySettings()) -> None:
        self.settings = settings
        self._place: Point | None = None
        self._velocity: Point = (0.0, 0.0)
        self._seen_s = -math.inf

    def update(self, place: Point, t_s: float, velocity_mps: Point | None = None) -> None:
        """Update with a position (field frame, metres) at a time (seconds).

        Parameters
        ----------
        velocity_mps : (float, float), optional
            Its velocity, where that is known; else it is computed from positions.
        """
        settings = self.settings
        gap_s = t_s - self._seen_s
        if velocity_mps is not None:
            self._velocity = velocity_mps
        elif self._place is not None and 0.0 < gap_s <= settings.max_gap_s:
            moved = ((place[0] - self._place[0]) / gap_s, (place[1] - self._place[1]) / gap_s)
            if math.hypot(*moved) > settings.max_speed_mps:
                moved = (0.0, 0.0)
            (x, y), gain = self._velocity, settings.velocity_gain
            self._velocity = (x + gain * (moved[0] - x), y + gain * (moved[1] - y))
        else:
            self._velocity = (0.0, 0.0)
        self._place, self._seen_s = place, t_s

    def miss(self) -> None:
        """Update with the fact that it is not where it was last seen."""
        self._place = None

    def place(self, t_s: float) -> Point | None:
        """Where it was last seen, field frame; None when that is too long ago."""
        return self._place if self.age_s(t_s) <= self.settings.forget_s else None

    @property
    def velocity_mps(self) -> Point:
        """Its velocity when last seen, field frame."""
        return self._velocity

    def age_s(self, t_s: float) -> float:
        """Seconds since it was seen."""
        return t_s - self._seen_s


class HiddenBall:
    """The ball behind the robot that held it when it was last seen, in the field frame.

    Parameters
    ----------
    reach_m : float
        From a robot's centre to the centre of a ball that it touches.
    """

    def __init__(self, reach_m: float, settings: BallMemorySettings = BallMemorySettings()) -> None:
        self._reach_m, self._settings = reach_m, settings
        self._carrier: int | None = None

    def update(self, ball: Point, tracks: Sequence[Track], age_s: float) -> None:
        """Update with where the ball is seen, and the robots that are tracked, as of `age_s` ago."""
        away = {track.number: math.dist(track.place_after(age_s), ball) for track in tracks}
        nearest = min(away, key=away.__getitem__, default=None)
        is_taken = nearest is not None and away[nearest] < self._settings.taken_reaches * self._reach_m
        self._carrier = nearest if is_taken else None

    def place(self, robot: Point, tracks: Sequence[Track], age_s: float) -> tuple[Point, Point] | None:
        """Return where the ball is, hidden from the robot, and its velocity; None if no known robot holds it."""
        track = next((track for track in tracks if track.number == self._carrier), None)
        if track is None:
            return None
        x, y = track.place_after(age_s)
        part = self._reach_m / max(math.dist((x, y), robot), self._reach_m)
        return (x + part * (x - robot[0]), y + part * (y - robot[1])), (track.vx_mps, track.vy_mps)


def block_ball(free_space: FreeSpace, ball: Point, radius_m: float) -> FreeSpace:
    """Return free space in which the ball (robot frame) is an obstacle too, so that steering goes round it."""
    away = math.hypot(*ball)
    if away <= radius_m:
        return free_space
    off = np.abs(np.remainder(free_space.bearing_rad - math.atan2(ball[1], ball[0]) + math.pi, math.tau) - math.pi)
    hidden = off <= math.asin(radius_m / away) + math.pi / len(free_space.bearing_rad)
    return FreeSpace(
        free_space.bearing_rad, np.where(hidden, np.minimum(free_space.range_m, away - radius_m), free_space.range_m)
    )


def is_in_sight(free_space: FreeSpace, place: Point) -> bool:
    """Whether nothing hides a place on the floor (robot frame)."""
    off = np.abs(np.remainder(free_space.bearing_rad - math.atan2(place[1], place[0]) + math.pi, math.tau) - math.pi)
    nearest = int(np.argmin(off))
    return bool(off[nearest] < math.radians(5) and free_space.range_m[nearest] >= math.hypot(*place))


@dataclass(frozen=True, slots=True)
class KnownBall:
    """Where the ball is now, field frame: metres, metres a second; no place where nobody knows it."""

    place: Point | None
    velocity_mps: Point


@dataclass(frozen=True, slots=True)
class NoddingCamera:
    """A camera near the ground whose body nods."""

    #: Greatest x and y of the floor that a ball may lie on, field frame.
    limits_m: Point
    #: The camera does not see the floor nearer than this.
    blind_m: float

    def within(self, robot: Pose2, ball: Pose2) -> Pose2:
        """Return where a ball (robot frame) is that seems to lie beyond the floor: where its ray leaves the floor."""
        here, there = (robot.x_m, robot.y_m), robot.compose(ball)
        part = 1.0
        for start, end, limit_m in zip(here, (there.x_m, there.y_m), self.limits_m, strict=True):
            if abs(end) > limit_m >= abs(start):
                part = min(part, (math.copysign(limit_m, end) - start) / (end - start))
        return Pose2(part * ball.x_m, part * ball.y_m, 0.0)


class BallKnowledge:
    """Keeps what one player knows of the ball.

    Parameters
    ----------
    reach_m : float
        From a robot's centre to the centre of a ball that it touches.
    hides : bool
        Believe that a ball that went out of sight is with the robot that held it.
    nods : NoddingCamera or None
        The camera, if its body nods: sightings are filtered. None: it does not.
    """

    def __init__(
        self,
        reach_m: float,
        settings: BallMemorySettings,
        *,
        hides: bool,
        talk: TeamTalk | None,
        nods: NoddingCamera | None = None,
    ) -> None:
        self._reach_m, self._settings, self._talk = reach_m, settings, talk
        self._nods = nods
        self._moved_s = -math.inf
        self._memory = BallMemory(settings)
        # what others are told is filtered, too: each of them gets two sightings a second of thirty
        self._track = None if talk is None and nods is None else BallTrack()
        self._hidden = HiddenBall(reach_m, settings) if hides else None
        self._known: KnownBall | None = None
        self._known_t_s = -math.inf

    @property
    def sighting(self) -> BallSighting | None:
        """The ball as the player last saw it itself."""
        return None if self._track is None else self._track.sighting

    def place(self, t_s: float) -> Point | None:
        """Return where the ball is, as the player last saw it, or with messages as all last saw it."""
        if self._talk is not None and self._known is not None and self._known_t_s == t_s:
            return self._known.place
        return self._memory.place(t_s)

    def see(self, robot: PoseEstimate, ball: Ball, t_s: float, tracks: tuple[Track, ...], age_s: float) -> None:
        """Update with a ball that a frame shows.

        Parameters
        ----------
        robot : PoseEstimate
            Where the robot was when the frame was taken.
        ball : Ball
            The ball in the robot frame of then.
        t_s : float
            When it was taken.
        tracks : tuple of Track
            Robots that are tracked, as of `age_s` ago.
        """
        if t_s < self._moved_s:
            return
        mount = Pose2(ball.x_m, ball.y_m, 0.0)
        if self._nods is not None:
            mount = self._nods.within(robot.pose, mount)
        at = robot.pose.compose(mount)
        self._update((at.x_m, at.y_m), robot, mount, self._covariance(ball, mount), t_s)
        if self._hidden is not None:
            self._hidden.update((at.x_m, at.y_m), tracks, age_s)

    def hold(self, robot: PoseEstimate, t_s: float) -> None:
        """Update with a ball in the robot's mouth."""
        mount = Pose2(self._reach_m, 0.0, 0.0)
        mouth = robot.pose.compose(mount)
        self._update((mouth.x_m, mouth.y_m), robot, mount, _MOUTH_STD_M**2 * np.eye(2), t_s)

    def forget(self, t_s: float) -> None:
        """Forget all that was seen before a time: somebody put the ball elsewhere."""
        self._moved_s = t_s
        self._miss()
        if self._talk is not None:
            self._talk.forget(t_s)

    def locate(
        self, robot: Pose2 | None, free_space: FreeSpace | None, t_s: float, tracks: tuple[Track, ...], age_s: float
    ) -> KnownBall:
        """Return where the ball is now.

        Parameters
        ----------
        robot : Pose2 or None
            Where the robot is; None: it does not know.
        free_space : FreeSpace or None
            What it sees of the floor now, robot frame.
        tracks : tuple of Track
            Robots that are tracked, as of `age_s` ago.
        """
        memory, settings = self._memory, self._settings
        ball, unseen_s = memory.place(t_s), memory.age_s(t_s)
        is_missed = unseen_s > settings.missed_s and robot is not None and free_space is not None
        if ball is not None and is_missed and self._sees(robot, free_space, ball, math.inf):
            self._miss()
            ball = None
        velocity, is_hidden = memory.velocity_mps, False
        if self._hidden is not None and robot is not None and settings.hidden_s < unseen_s <= settings.forget_s:
            hidden = self._hidden.place((robot.x_m, robot.y_m), tracks, age_s)
            if hidden is not None:
                (ball, velocity), is_hidden = hidden, True
        known = KnownBall(ball, velocity)
        if self._talk is not None:
            known = self._with_others(self._talk, known, is_hidden, t_s)
            within_m = settings.reported_missed_m
            if known.place is not None and is_missed and self._sees(robot, free_space, known.place, within_m):
                fused = self._talk.ball(None, t_s)
                if fused is not None:
                    self._talk.reject(fused)
                known = KnownBall(ball, velocity)
        self._known, self._known_t_s = known, t_s
        return known

    def _with_others(self, talk: TeamTalk, own: KnownBall, is_hidden: bool, t_s: float) -> KnownBall:
        """Return the ball as all know it together."""
        sighting = self.sighting
        if own.place is None:
            sighting = None
        elif is_hidden and sighting is not None:
            # it went with the robot that has it
            sighting = BallSighting(sighting.t_s, *own.place, 0.0, 0.0, sighting.covariance)
        if talk.is_own_enough(sighting, t_s):
            return own
        fused = talk.ball(sighting, t_s)
        if fused is None:
            return own
        return KnownBall((fused.x_m, fused.y_m), (fused.vx_mps, fused.vy_mps))

    def _covariance(self, ball: Ball, mount: Pose2) -> FloatArray:
        """Return the covariance of a ball, robot frame, that is taken to be at `mount`, nearer on its ray or there."""
        range_m = math.hypot(mount.x_m, mount.y_m)
        nearer = range_m / max(math.hypot(ball.x_m, ball.y_m), 1e-9)
        if nearer == 1.0:
            return ball.covariance
        # errors across the ray grow with the range, those along it with its square
        x, y = mount.x_m / max(range_m, 1e-9), mount.y_m / max(range_m, 1e-9)
        on_ray = np.array([[x, -y], [y, x]])
        (along, both), (_, across) = (on_ray.T @ ball.covariance @ on_ray).tolist()
        # near the horizon a ball is so far off that rounding hides how well its bearing is known
        across = max(nearer**2 * across, (_MIN_BEARING_STD_RAD * range_m) ** 2)
        along = max(nearer**4 * along, across)
        most = _MAX_CORRELATION * math.sqrt(along * across)
        both = max(-most, min(most, nearer**3 * both))
        return np.asarray(on_ray @ np.array([[along, both], [both, across]]) @ on_ray.T)

    def _update(self, place: Point, robot: PoseEstimate, mount: Pose2, covariance: FloatArray, t_s: float) -> None:
        if self._track is not None:
            of_mount = np.zeros((3, 3))
            of_mount[:2, :2] = covariance
            in_field = compose_covariance(robot.pose, robot.covariance, mount, of_mount)[:2, :2]
            self._track.update(place, in_field, t_s)
        if self._nods is None:
            self._memory.update(place, t_s)
            return
        filtered = self.sighting
        if filtered is not None and filtered.t_s == t_s:
            self._memory.update((filtered.x_m, filtered.y_m), t_s, (filtered.vx_mps, filtered.vy_mps))

    def _sees(self, robot: Pose2 | None, free_space: FreeSpace | None, ball: Point, within_m: float) -> bool:
        """Whether the robot sees the floor where the ball should be, no farther off than this."""
        if robot is None or free_space is None:
            return False
        x_m, y_m = robot.inverse().transform(ball).tolist()
        away_m = math.hypot(x_m, y_m)
        if self._nods is not None and away_m < self._nods.blind_m:
            return False
        return away_m <= within_m and is_in_sight(free_space, (x_m, y_m))

    def _miss(self) -> None:
        self._memory.miss()
        if self._track is not None:
            self._track.forget()

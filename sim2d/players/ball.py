"""A player's estimate of the ball: its own sightings, robots that hide it, and messages."""

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

# standard deviation of a ball in the robot's mouth, along each axis
_MOUTH_STD_M = 0.01
# bounds for a ball that seems to lie beyond the floor: least standard deviation of bearing, and greatest correlation
_MIN_BEARING_STD_RAD, _MAX_CORRELATION = 0.005, 0.99


# Time after which an unseen ball may be anywhere, since a kicked one crosses the field in it.
_FORGET_S = 4.0
# Weight of a new velocity, which is noisy if computed from two positions a frame apart.
_VELOCITY_GAIN = 0.4
# Greatest time between two positions for a velocity; after more the ball may have turned.
_MAX_GAP_S = 0.25
# Greatest speed of a ball; a faster one is a wrong detection.
_MAX_SPEED_MPS = 4.0
# Time after which a ball that is not detected at a visible place is taken to be gone.
_MISSED_S = 0.5
# Greatest distance at which a reported ball is rejected if the robot sees the floor there, because small cameras
# miss far balls.
_REPORTED_MISSED_M = 1.0
# Time after which an unseen ball is assumed to be hidden by the robot that held it.
_HIDDEN_S = 0.15
# Another robot holds the ball if it is within this distance of the robot's centre, in units of robot plus ball radius.
TAKEN_REACHES = 2.0


class BallMemory:
    """The last seen ball, field frame."""

    def __init__(self) -> None:
        self._place: Point | None = None
        self._velocity: Point = (0.0, 0.0)
        self._seen_s = -math.inf

    def update(self, place: Point, t_s: float, velocity_mps: Point | None = None) -> None:
        """Update with a position (field frame, metres) at a time (seconds).

        Parameters
        ----------
        velocity_mps : (float, float), optional
            Its velocity if known; otherwise it is computed from positions.
        """
        gap_s = t_s - self._seen_s
        if velocity_mps is not None:
            self._velocity = velocity_mps
        elif self._place is not None and 0.0 < gap_s <= _MAX_GAP_S:
            moved = ((place[0] - self._place[0]) / gap_s, (place[1] - self._place[1]) / gap_s)
            if math.hypot(*moved) > _MAX_SPEED_MPS:
                moved = (0.0, 0.0)
            (x, y), gain = self._velocity, _VELOCITY_GAIN
            self._velocity = (x + gain * (moved[0] - x), y + gain * (moved[1] - y))
        else:
            self._velocity = (0.0, 0.0)
        self._place, self._seen_s = place, t_s

    def miss(self) -> None:
        """Forget the ball's place, because it is not seen there."""
        self._place = None

    def place(self, t_s: float) -> Point | None:
        """Return the ball's last place, field frame; None if it has not been seen for too long."""
        return self._place if self.age_s(t_s) <= _FORGET_S else None

    @property
    def velocity_mps(self) -> Point:
        """The ball's last velocity, field frame."""
        return self._velocity

    def age_s(self, t_s: float) -> float:
        """Return the seconds since the ball was last seen."""
        return t_s - self._seen_s


class HiddenBall:
    """The ball hidden behind the robot that held it when it was last seen, field frame.

    Parameters
    ----------
    reach_m : float
        Distance from a robot's centre to the centre of a ball in contact.
    """

    def __init__(self, reach_m: float) -> None:
        self._reach_m = reach_m
        self._carrier: int | None = None

    def update(self, ball: Point, tracks: Sequence[Track], age_s: float) -> None:
        """Update with the ball's place and the tracked robots, as of `age_s` ago."""
        away = {track.number: math.dist(track.place_after(age_s), ball) for track in tracks}
        nearest = min(away, key=away.__getitem__, default=None)
        is_taken = nearest is not None and away[nearest] < TAKEN_REACHES * self._reach_m
        self._carrier = nearest if is_taken else None

    def place(self, robot: Point, tracks: Sequence[Track], age_s: float) -> tuple[Point, Point] | None:
        """Return place and velocity, field frame, of a ball hidden behind its holder; None if no track holds it."""
        track = next((track for track in tracks if track.number == self._carrier), None)
        if track is None:
            return None
        x, y = track.place_after(age_s)
        part = self._reach_m / max(math.dist((x, y), robot), self._reach_m)
        return (x + part * (x - robot[0]), y + part * (y - robot[1])), (track.vx_mps, track.vy_mps)


def block_ball(free_space: FreeSpace, ball: Point, radius_m: float) -> FreeSpace:
    """Return free space with the ball (robot frame) as an obstacle, so that steering goes around it."""
    away = math.hypot(*ball)
    if away <= radius_m:
        return free_space
    off = np.abs(np.remainder(free_space.bearing_rad - math.atan2(ball[1], ball[0]) + math.pi, math.tau) - math.pi)
    hidden = off <= math.asin(radius_m / away) + math.pi / len(free_space.bearing_rad)
    return FreeSpace(
        free_space.bearing_rad, np.where(hidden, np.minimum(free_space.range_m, away - radius_m), free_space.range_m)
    )


def is_in_sight(free_space: FreeSpace, place: Point) -> bool:
    """Whether a place on the floor (robot frame) is in view and not hidden."""
    off = np.abs(np.remainder(free_space.bearing_rad - math.atan2(place[1], place[0]) + math.pi, math.tau) - math.pi)
    nearest = int(np.argmin(off))
    return bool(off[nearest] < math.radians(5) and free_space.range_m[nearest] >= math.hypot(*place))


@dataclass(frozen=True, slots=True)
class KnownBall:
    """The ball now, field frame: metres, metres per second; `place` is None if it is unknown."""

    place: Point | None
    velocity_mps: Point


@dataclass(frozen=True, slots=True)
class NoddingCamera:
    """A camera near the ground on a nodding body."""

    #: Greatest x and y of a ball on the floor, field frame.
    limits_m: Point
    #: Range of the nearest visible floor.
    blind_m: float

    def within(self, robot: Pose2, ball: Pose2) -> Pose2:
        """Return a ball's place, robot frame; a ball beyond the floor is moved to where its ray leaves the floor."""
        here, there = (robot.x_m, robot.y_m), robot.compose(ball)
        part = 1.0
        for start, end, limit_m in zip(here, (there.x_m, there.y_m), self.limits_m, strict=True):
            if abs(end) > limit_m >= abs(start):
                part = min(part, (math.copysign(limit_m, end) - start) / (end - start))
        return Pose2(part * ball.x_m, part * ball.y_m, 0.0)


class BallKnowledge:
    """A player's estimate of the ball.

    Parameters
    ----------
    reach_m : float
        Distance from a robot's centre to the centre of a ball in contact.
    hides : bool
        Whether a ball that is no longer visible is assumed to be with the robot that held it.
    nods : NoddingCamera or None
        The camera, if its body nods; then sightings are filtered.
    """

    def __init__(
        self,
        reach_m: float,
        *,
        hides: bool,
        talk: TeamTalk | None,
        nods: NoddingCamera | None = None,
    ) -> None:
        self._reach_m, self._talk = reach_m, talk
        self._nods = nods
        self._moved_s = -math.inf
        self._memory = BallMemory()
        # sightings for messages are filtered, too, because the others receive only two of thirty each second
        self._track = None if talk is None and nods is None else BallTrack()
        self._hidden = HiddenBall(reach_m) if hides else None
        self._known: KnownBall | None = None
        self._known_t_s = -math.inf

    @property
    def sighting(self) -> BallSighting | None:
        """The player's own last sighting of the ball."""
        return None if self._track is None else self._track.sighting

    def place(self, t_s: float) -> Point | None:
        """Return the ball's place, field frame, by the player's own sightings; with messages, by those of all."""
        if self._talk is not None and self._known is not None and self._known_t_s == t_s:
            return self._known.place
        return self._memory.place(t_s)

    def see(self, robot: PoseEstimate, ball: Ball, t_s: float, tracks: tuple[Track, ...], age_s: float) -> None:
        """Update with a ball in a frame.

        Parameters
        ----------
        robot : PoseEstimate
            Pose of the robot at the frame's time.
        ball : Ball
            The ball in the robot frame at that time.
        t_s : float
            Time of the frame.
        tracks : tuple of Track
            Tracked robots, as of `age_s` ago.
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
        """Forget all sightings before a time, because the ball has been moved."""
        self._moved_s = t_s
        self._miss()
        if self._talk is not None:
            self._talk.forget(t_s)

    def locate(
        self, robot: Pose2 | None, free_space: FreeSpace | None, t_s: float, tracks: tuple[Track, ...], age_s: float
    ) -> KnownBall:
        """Return the present ball.

        Parameters
        ----------
        robot : Pose2 or None
            Pose of the robot; None if it is not located.
        free_space : FreeSpace or None
            Present free space, robot frame.
        tracks : tuple of Track
            Tracked robots, as of `age_s` ago.
        """
        memory = self._memory
        ball, unseen_s = memory.place(t_s), memory.age_s(t_s)
        is_missed = unseen_s > _MISSED_S and robot is not None and free_space is not None
        if ball is not None and is_missed and self._sees(robot, free_space, ball, math.inf):
            self._miss()
            ball = None
        velocity, is_hidden = memory.velocity_mps, False
        if self._hidden is not None and robot is not None and _HIDDEN_S < unseen_s <= _FORGET_S:
            hidden = self._hidden.place((robot.x_m, robot.y_m), tracks, age_s)
            if hidden is not None:
                (ball, velocity), is_hidden = hidden, True
        known = KnownBall(ball, velocity)
        if self._talk is not None:
            known = self._with_others(self._talk, known, is_hidden, t_s)
            if known.place is not None and is_missed and self._sees(robot, free_space, known.place, _REPORTED_MISSED_M):
                fused = self._talk.ball(None, t_s)
                if fused is not None:
                    self._talk.reject(fused)
                known = KnownBall(ball, velocity)
        self._known, self._known_t_s = known, t_s
        return known

    def _with_others(self, talk: TeamTalk, own: KnownBall, is_hidden: bool, t_s: float) -> KnownBall:
        """Return the ball fused with the others' sightings."""
        sighting = self.sighting
        if own.place is None:
            sighting = None
        elif is_hidden and sighting is not None:
            # a hidden ball moves with its holder, whose next motion is unknown
            sighting = BallSighting(sighting.t_s, *own.place, 0.0, 0.0, sighting.covariance)
        if talk.is_own_enough(sighting, t_s):
            return own
        fused = talk.ball(sighting, t_s)
        if fused is None:
            return own
        return KnownBall((fused.x_m, fused.y_m), (fused.vx_mps, fused.vy_mps))

    def _covariance(self, ball: Ball, mount: Pose2) -> FloatArray:
        """Return the covariance (2, 2), robot frame, of a ball that was moved along its ray to the nearer `mount`."""
        range_m = math.hypot(mount.x_m, mount.y_m)
        nearer = range_m / max(math.hypot(ball.x_m, ball.y_m), 1e-9)
        if nearer == 1.0:
            return ball.covariance
        # errors across the ray grow with the range, those along it with its square
        x, y = mount.x_m / max(range_m, 1e-9), mount.y_m / max(range_m, 1e-9)
        on_ray = np.array([[x, -y], [y, x]])
        (along, cross), (_, across) = (on_ray.T @ ball.covariance @ on_ray).tolist()
        # near the horizon the range is so large that rounding makes the bearing's variance meaningless
        across = max(nearer**2 * across, (_MIN_BEARING_STD_RAD * range_m) ** 2)
        along = max(nearer**4 * along, across)
        bound = _MAX_CORRELATION * math.sqrt(along * across)
        cross = max(-bound, min(bound, nearer**3 * cross))
        return np.asarray(on_ray @ np.array([[along, cross], [cross, across]]) @ on_ray.T)

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
        """Whether the robot sees floor at the ball's expected place, within this distance."""
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

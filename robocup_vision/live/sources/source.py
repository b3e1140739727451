"""What every source of frames has in common, so that the loop need not know where frames come from."""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar, runtime_checkable

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera import OmniCamera, PinholeCamera, load_camera
from robocup_vision.camera.pinhole import Mounting
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.live.handover.moment import RobotPlan, RobotSetup, TrueWorld
from robocup_vision.mapping.view_motion import ViewMotion
from robocup_vision.memory import Memory
from robocup_vision.perception.color_table import Colors, load_colors
from robocup_vision.view import View
from robocup_vision.vision import Vision

# window of the measurement, seconds
_WINDOW_S = 2.0
# a camera's rate varies with the light by less than this factor; a lost half of the frames is more
_CHANGED = 1.5


@dataclass(frozen=True, slots=True, eq=False)
class SourceFrame:
    """One frame of one robot.

    Parameters
    ----------
    robot : str
        Whose.
    frame : (H, W, 3) uint8
        BGR. Nobody writes to it any more.
    t_s : float
        When it was taken.
    odometry : Pose2 or None
        Motion since the frame before, in the robot frame of then; None: not known.
    mounting : Mounting or None
        How a head held the camera; None: as the camera file says.
    prior : PoseEstimate, Pose2 or None
        Where the robot probably is, beside what a memory knows.
    alone : bool
        It has nothing to do with the frame before: nothing learnt from that one is used.
    view : View or None
        What the robot itself saw in it; None: it is to be looked at.
    colors : Colors or None
        That the robot itself used.
    plan : RobotPlan
        What the robot is about to do.
    truth : Pose2 or None
        Where it really was.
    world : TrueWorld or None
        Where everything was in a simulation.
    """

    robot: str
    frame: UInt8Array
    t_s: float
    odometry: Pose2 | None = None
    mounting: Mounting | None = None
    prior: PoseEstimate | Pose2 | None = None
    alone: bool = False
    view: View | None = None
    colors: Colors | None = None
    plan: RobotPlan = RobotPlan()
    truth: Pose2 | None = None
    world: TrueWorld | None = None


@dataclass(frozen=True, slots=True)
class SourceOptions:
    """What the user said beside the source's name; a source that knows better by itself is told by it otherwise.

    Parameters
    ----------
    field : str or None
        Built-in field's name, or a field file.
    camera : str or None
        Camera file.
    colors : str or None
        Colour file.
    method : str or None
        The method of the pose.
    memory : bool
        Join what the frames show.
    """

    field: str | None = None
    camera: str | None = None
    colors: str | None = None
    method: str | None = None
    memory: bool = False


class Source(Protocol):
    """Gives frames, one moment after the other; one thread reads, another one may close."""

    name: str  #: what the page calls it
    setups: tuple[RobotSetup, ...]  #: the robots whose frames it gives
    waits: bool  #: whether it stands still while nobody reads, as a file does; else frames come, and the newest counts
    duration_s: float | None = None  #: times from 0 to this can be gone to by `seek`; None: none can
    problem: str = ""  #: why no frames come; empty while they do

    def make_vision(self, setup: RobotSetup) -> Vision | None:
        """Return what looks at a robot's frames; None where its frames come with views, or it has no camera file."""
        ...

    def read(self, timeout_s: float) -> tuple[SourceFrame, ...] | None:
        """Return the next frames of all robots; empty if none came in time; None after the last.

        Raises
        ------
        FrameError
            If a frame is damaged: the next may be good.
        """
        ...

    def seek(self, t_s: float) -> None:
        """Go to the last frame that is not later than a time.

        Raises
        ------
        ArgumentError
            If it cannot go to a time.
        """
        raise ArgumentError(f"{self.name} cannot go to a time")

    def close(self) -> None:
        """Let go of files and devices."""
        return


@runtime_checkable
class PlacingSource(Source, Protocol):
    """A simulation, in which robots and the ball can be put elsewhere between two reads."""

    def place(self, thing: str, x_m: float, y_m: float, theta_rad: float | None) -> None:
        """Put something elsewhere.

        Parameters
        ----------
        thing : str
            "ball", or a robot's name.
        theta_rad : float or None
            A robot's heading; None: as it is.

        Raises
        ------
        ArgumentError
            If there is no such thing, or the place is off the floor.
        """
        ...


def setup_by_options(name: str, options: SourceOptions) -> RobotSetup:
    """Return a robot's setup; raises ArgumentError if no field is named, FileError if a file is wrong."""
    if options.field is None:
        raise ArgumentError(f"{name}: does not say on which field it is, so --field must be given")
    field = load_field(options.field)
    camera = None if options.camera is None else load_camera(options.camera)
    return RobotSetup(name, field, camera, field.robot_radius_m)


def vision_by_options(setup: RobotSetup, options: SourceOptions, *, has_odometry: bool) -> Vision | None:
    """Return what looks at a robot's frames; None without a camera file. Raises as `memory_for`."""
    if setup.camera is None:
        return None
    memory = memory_for(setup, setup.camera, has_odometry=has_odometry) if options.memory else None
    colors = None if options.colors is None else load_colors(options.colors)
    return Vision(setup.field, setup.camera, colors, method=options.method, memory=memory)


def memory_for(setup: RobotSetup, camera: OmniCamera | PinholeCamera, *, has_odometry: bool) -> Memory:
    """Return a memory of everything that goes by odometry, or where there is none by the motion between views.

    Raises ArgumentError if neither tells how the robot moves.
    """
    memory = Memory.of_everything(setup.field)
    if not has_odometry:
        if isinstance(camera, PinholeCamera):
            raise ArgumentError(
                f"{setup.name}: --memory needs odometry (a recording, or a dataset with frames.csv) or a mirror camera"
            )
        memory.ego_motion = ViewMotion()
    return memory


T = TypeVar("T")


class Newest(Generic[T]):
    """Holds one value: a newer one takes its place, and it is taken once. Safe to use from several threads."""

    def __init__(self) -> None:
        self._news = threading.Condition()
        self._value: T | None = None
        self._is_closed = False

    @property
    def is_closed(self) -> bool:
        """Whether nothing is to come any more."""
        return self._is_closed

    def put(self, value: T) -> None:
        """Put a value in the place of the one that waits, if one does."""
        with self._news:
            self._value = value
            self._news.notify_all()

    def take(self, timeout_s: float) -> T | None:
        """Return the value that waits, or the first that comes in time; None if none does, or it is closed."""
        with self._news:
            self._news.wait_for(lambda: self._value is not None or self._is_closed, timeout_s)
            value, self._value = self._value, None
            return None if self._is_closed else value

    def wait_until_closed(self, timeout_s: float) -> None:
        """Wait, but no longer than until it is closed."""
        with self._news:
            self._news.wait_for(lambda: self._is_closed, timeout_s)

    def close(self) -> None:
        """Let nobody wait any more."""
        with self._news:
            self._is_closed = True
            self._news.notify_all()


class FrameRate:
    """Measures the rate of one source by the times of its frames."""

    def __init__(self) -> None:
        self._times: deque[float] = deque()
        self._usual: float | None = None

    @property
    def rate_hz(self) -> float | None:
        """Frames a second over the last two seconds; None before there are three frames."""
        if len(self._times) < 3 or self._times[-1] <= self._times[0]:
            return None
        return round((len(self._times) - 1) / (self._times[-1] - self._times[0]), 2)

    def add(self, t_s: float) -> tuple[float, float] | None:
        """Take a frame's time; return the rates before and now, once for each change that has lasted two seconds."""
        if self._times and t_s <= self._times[-1]:
            self.forget()
        self._times.append(t_s)
        while t_s - self._times[0] > _WINDOW_S:
            self._times.popleft()
        rate = self.rate_hz
        if rate is None or t_s - self._times[0] < 0.9 * _WINDOW_S:
            return None
        usual, self._usual = self._usual, self._usual or rate
        if usual is None or 1 / _CHANGED < rate / usual < _CHANGED:
            return None
        # told once the window holds the new rate alone: else the change would be told in two halves
        half = [t for t in self._times if t > t_s - _WINDOW_S / 2]
        if len(half) < 2 or not 0.8 < (len(half) - 1) / (half[-1] - half[0]) / rate < 1.25:
            return None
        self._usual = rate
        return usual, rate

    def forget(self) -> None:
        """Begin anew: the source has gone to another time."""
        self._times.clear()
        self._usual = None

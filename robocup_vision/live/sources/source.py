"""The common interface of all sources of frames, so that the loop does not depend on where frames come from."""

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
# factor of the rate from which a change is reported: light changes a camera's rate by less, losing half the frames more
_CHANGED = 1.5


@dataclass(frozen=True, slots=True, eq=False)
class SourceFrame:
    """One frame of one robot.

    Parameters
    ----------
    robot : str
        Name of the robot.
    frame : (H, W, 3) uint8
        BGR; must not be changed any more.
    t_s : float
        Time of the frame.
    odometry : Pose2 or None
        Motion since the frame before, in the robot frame at that time; None: not known.
    mounting : Mounting or None
        Mounting of the camera on a head; None: as in the camera file.
    prior : PoseEstimate, Pose2 or None
        Probable pose of the robot, in addition to a memory's knowledge.
    alone : bool
        Whether the frame is independent of the frame before, so that nothing learnt from that one is used.
    view : View or None
        The robot's own view of the frame; None: the loop must compute one.
    colors : Colors or None
        The colours that the robot itself used.
    plan : RobotPlan
        What the robot is about to do.
    truth : Pose2 or None
        The robot's true pose.
    world : TrueWorld or None
        The true state of a simulation.
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
    """The user's options for a source; they override what the source itself contains.

    Parameters
    ----------
    field : str or None
        Name of a built-in field, or a field file.
    camera : str or None
        Camera file.
    colors : str or None
        Colour file.
    method : str or None
        The method of localisation.
    memory : bool
        Whether a memory combines the frames.
    """

    field: str | None = None
    camera: str | None = None
    colors: str | None = None
    method: str | None = None
    memory: bool = False


class Source(Protocol):
    """Gives frames, one moment after the other; one thread reads, another one may close it."""

    name: str  #: its name on the page
    setups: tuple[RobotSetup, ...]  #: the robots whose frames it gives
    waits: bool  #: whether it waits for its reader, as a file does; otherwise frames come live, and the newest is read
    duration_s: float | None = None  #: `seek` takes times from 0 to this; None: it cannot seek
    problem: str = ""  #: why no frames come; empty while they do

    def make_vision(self, setup: RobotSetup) -> Vision | None:
        """Return the `Vision` for a robot's frames; None if the frames have views, or the robot has no camera file."""
        ...

    def read(self, timeout_s: float) -> tuple[SourceFrame, ...] | None:
        """Return the next frames of all robots; empty if none came in time; None after the last.

        Raises
        ------
        FrameError
            If a frame is damaged; the next one may be usable.
        """
        ...

    def seek(self, t_s: float) -> None:
        """Seek to the last frame that is not later than a time.

        Raises
        ------
        ArgumentError
            If the source cannot seek.
        """
        raise ArgumentError(f"{self.name} cannot go to a time")

    def close(self) -> None:
        """Release files and devices."""
        return


@runtime_checkable
class PlacingSource(Source, Protocol):
    """A simulation, in which robots and the ball can be moved between two reads."""

    def place(self, thing: str, x_m: float, y_m: float, theta_rad: float | None) -> None:
        """Move an object to a place in the field frame.

        Parameters
        ----------
        thing : str
            "ball", or a robot's name.
        theta_rad : float or None
            A robot's heading; None: unchanged.

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
    """Return the `Vision` for a robot's frames; None without a camera file. Raises as `memory_for`."""
    if setup.camera is None:
        return None
    memory = memory_for(setup, setup.camera, has_odometry=has_odometry) if options.memory else None
    colors = None if options.colors is None else load_colors(options.colors)
    return Vision(setup.field, setup.camera, colors, method=options.method, memory=memory)


def memory_for(setup: RobotSetup, camera: OmniCamera | PinholeCamera, *, has_odometry: bool) -> Memory:
    """Return a memory of everything that predicts by odometry or, without odometry, by ego-motion.

    Raises ArgumentError if there is neither.
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
    """Holds one value, which a newer one replaces and which can be taken once. Safe to use from several threads."""

    def __init__(self) -> None:
        self._news = threading.Condition()
        self._value: T | None = None
        self._is_closed = False

    @property
    def is_closed(self) -> bool:
        """Whether it is closed, so that no more values come."""
        return self._is_closed

    def put(self, value: T) -> None:
        """Put a value, replacing one that has not been taken."""
        with self._news:
            self._value = value
            self._news.notify_all()

    def take(self, timeout_s: float) -> T | None:
        """Take the present value, or the first that comes in time; None if none does, or it is closed."""
        with self._news:
            self._news.wait_for(lambda: self._value is not None or self._is_closed, timeout_s)
            value, self._value = self._value, None
            return None if self._is_closed else value

    def wait_until_closed(self, timeout_s: float) -> None:
        """Wait for a time, or until it is closed."""
        with self._news:
            self._news.wait_for(lambda: self._is_closed, timeout_s)

    def close(self) -> None:
        """Close it, and end all waiting."""
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
        """Frames per second over the last two seconds; None before there are three frames."""
        if len(self._times) < 3 or self._times[-1] <= self._times[0]:
            return None
        return round((len(self._times) - 1) / (self._times[-1] - self._times[0]), 2)

    def add(self, t_s: float) -> tuple[float, float] | None:
        """Add a frame's time; return the rates before and now, once for each change that has lasted two seconds."""
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
        # report only when the whole window has the new rate: otherwise one change would be reported in two steps
        half = [t for t in self._times if t > t_s - _WINDOW_S / 2]
        if len(half) < 2 or not 0.8 < (len(half) - 1) / (half[-1] - half[0]) / rate < 1.25:
            return None
        self._usual = rate
        return usual, rate

    def forget(self) -> None:
        """Forget all times, because the source has jumped to another time."""
        self._times.clear()
        self._usual = None

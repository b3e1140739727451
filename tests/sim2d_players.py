"""Players and small cameras for the tests of matches: no Vision, so that a match takes a moment."""

# ruff: noqa: D101, D102
import math
import os
import signal
from pathlib import Path

import numpy as np

from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from sim2d.kick_off import kick_off_pose
from sim2d.rendering.cameras import sekimori_camera
from sim2d.robot_link import Command, PlayerStatus

SMALL_CAMERA = sekimori_camera(64, 56)


class Reckoner:
    """Drives in circles, and believes what its odometry says from the kick-off on."""

    def __init__(self, setup):
        self.setup = setup
        self.pose = kick_off_pose(setup.field, setup.attacks, setup.number, setup.players, setup.limits.radius_m)
        self.senses = []

    def act(self, senses):
        self.senses.append(senses)
        self.pose = self.pose.compose(senses.odometry)
        return Command(forward_mps=0.3, turn_rps=1.5)

    @property
    def status(self):
        return PlayerStatus(PoseEstimate(self.pose, np.eye(3) * 1e-4, 1.0, 0.0), None, "circle", None)


class Sleeper:
    """Stands still and believes nothing."""

    def __init__(self, setup):
        self.setup = setup

    def act(self, senses):
        return Command()

    @property
    def status(self):
        return PlayerStatus(NotLocated("asleep"), None, "sleep", None)


class FailsAt(Sleeper):
    """Fails at half a second, in a way of its own."""

    def fail(self):
        raise RuntimeError("my own\nbug")

    def act(self, senses):
        return self.fail() if senses.t_s > 0.49 else Command()


class Talker(Sleeper):
    """Tells its side and number in every control period, and keeps what it hears."""

    heard = ()

    def act(self, senses):
        self.heard += tuple((round(30 * senses.t_s), message) for message in senses.messages)
        return Command(message=bytes([self.setup.attacks > 0, self.setup.number, round(30 * senses.t_s)]))


class SaysTooMuch(FailsAt):
    def fail(self):
        return Command(message=bytes(129))


class SaysNan(FailsAt):
    def fail(self):
        return Command(forward_mps=math.nan)


class SaysInfinity(FailsAt):
    def fail(self):
        return Command(kick_mps=math.inf)


class SaysNothing(FailsAt):
    def fail(self):
        return None


class SaysWords(FailsAt):
    def fail(self):
        return Command(forward_mps="fast")


class Exits(FailsAt):
    def fail(self):
        raise SystemExit(3)


class ReportsNan(Sleeper):
    @property
    def status(self):
        return PlayerStatus(PoseEstimate(Pose2(math.nan, 0.0, 0.0), np.eye(3), 1.0, 0.0), None, "", None)


class ReportsWords(Sleeper):
    @property
    def status(self):
        return "somewhere"


class NeverBorn(Sleeper):
    def __init__(self, setup):
        raise ValueError("no way")


class KillsItsProcess(Sleeper):
    """Ends its process by force in the middle of the first match that any process plays."""

    def __init__(self, setup, marker):
        super().__init__(setup)
        self.marker = marker

    def act(self, senses):
        if senses.t_s > 0.2:
            try:
                Path(self.marker).touch(exist_ok=False)
            except FileExistsError:
                pass
            else:
                os.kill(os.getpid(), signal.SIGKILL)
        return Command()

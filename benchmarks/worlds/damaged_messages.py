"""Damaged messages for decoders, in benchmarks and tests: bytes changed, cut, repeated, exchanged."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from robocup_vision.ssl.protocol.mapping import encode
from robocup_vision.ssl.values import simulation as sim
from robocup_vision.ssl.values.detection import DetectionBall, DetectionFrame, DetectionRobot, Source, VisionPacket
from robocup_vision.ssl.values.geometry import FieldSize, Geometry
from robocup_vision.ssl.values.referee import CiInput, CiOutput, Referee, RefereeCommand, Stage, TeamInfo
from robocup_vision.ssl.values.tracked import (
    TrackedBall,
    TrackedFrame,
    TrackedRobot,
    TrackedRobotId,
    TrackerPacket,
    Vector2,
    Vector3,
)

TEAM = TeamInfo("ours", 1, 0, 2, 4, 300_000_000, 3, (1_000_000, 2_000_000))
REFEREE = Referee(1_700_000_000_000_000, Stage.NORMAL_FIRST_HALF, RefereeCommand.STOP, 7, 1, TEAM, TEAM, -5)
FRAME = DetectionFrame(
    9,
    1.5,
    1.6,
    0,
    (DetectionBall(1.0, 0.1, -0.2, z_m=0.3),),
    (DetectionRobot(0.9, 0, 1.0, 2.0, -3.0),),
    (DetectionRobot(0.8, 15, -1.0, 2.0, None),),
)
GEOMETRY = Geometry(FieldSize(9.0, 6.0, 1.0, 0.18, 0.3))
TRACKED = TrackedFrame(
    1,
    2.0,
    (TrackedBall(Vector3(1.0, 2.0, 0.0)),),
    (TrackedRobot(TrackedRobotId(3, sim.Team.BLUE), Vector2(1.0, 2.0), 0.5),),
)
ERRORS = (sim.SimulatorError("CODE", "words"),)
COMMAND = sim.RobotCommand(
    3, sim.MoveCommand(local=sim.LocalVelocity(1.0, 0.0, -0.5)), kick_mps=3.0, kick_angle_rad=0.5, dribbler_rps=100.0
)
SPECS = sim.RobotSpecs(
    sim.RobotId(1, sim.Team.BLUE),
    limits=sim.LeagueRobotLimits(speed_mps=2.0),
    wheel_angles=sim.WheelAngles(5.2, 3.9, 2.4, 1.0),
    custom=(sim.AnyMessage("a/b.C", b"x"),),
)
SIMULATOR = sim.SimulatorCommand(
    sim.SimulatorControl(
        sim.TeleportBall(1.0, 2.0, 0.0, vx_mps=1.0, roll=True),
        (sim.TeleportRobot(sim.RobotId(2, sim.Team.YELLOW), 0.0, 0.0, 1.0, present=True),),
        1.0,
    ),
    sim.SimulatorConfig(GEOMETRY, (SPECS,), sim.RealismConfig((sim.AnyMessage("x/y.Z", b""),)), 10006),
)
# one of each message that travels by itself
EXAMPLES: tuple[Any, ...] = (
    VisionPacket(FRAME, GEOMETRY, Source.OTHER),
    TrackerPacket("a-b", "us", TRACKED),
    REFEREE,
    SIMULATOR,
    sim.SimulatorResponse(ERRORS),
    sim.RobotControl((COMMAND, COMMAND)),
    sim.RobotControlResponse(ERRORS, (sim.RobotFeedback(1, True),)),
    sim.SyncRequest(0.01, SIMULATOR, sim.RobotControl((COMMAND,))),
    sim.SyncResponse((FRAME,), sim.RobotControlResponse()),
    CiInput(5, TrackerPacket("u", None, TRACKED), GEOMETRY),
    CiOutput(REFEREE),
    sim.ErForceRealism(0.001, vision_delay_ns=35_000_000, simulate_dribbling=False),
)


def damaged_messages(rng: np.random.Generator, count: int) -> Iterator[tuple[type[Any], bytes]]:
    """Yield `count` pairs of a value's class and damaged bytes of one."""
    sources = [(type(value), encode(value)) for value in EXAMPLES]
    for _ in range(count):
        cls, data = sources[rng.integers(len(sources))]
        other = sources[rng.integers(len(sources))][1]
        yield cls, damaged(rng, data, other)


def damaged(rng: np.random.Generator, data: bytes, other: bytes) -> bytes:
    """Return bytes with one to four damages."""
    work = bytearray(data)
    for _ in range(int(rng.integers(1, 5))):
        place = int(rng.integers(len(work) + 1))
        kind = rng.integers(6)
        if kind == 0 and work:
            work[place % len(work)] = int(rng.integers(256))
        elif kind == 1 and work:
            work[place % len(work)] ^= 1 << int(rng.integers(8))
        elif kind == 2:
            del work[place : place + int(rng.integers(1, 9))]
        elif kind == 3:
            work[place:place] = rng.bytes(int(rng.integers(1, 9)))
        elif kind == 4:
            work[place:place] = work[: int(rng.integers(64))]
        else:
            begin = int(rng.integers(len(other) + 1))
            work[place:place] = other[begin : begin + 32]
    return bytes(work)

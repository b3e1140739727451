"""The simulator's requests and packets, without sockets: what is asked is done or answered with a code."""

import dataclasses
import math

import numpy as np
import pytest

from benchmarks.worlds.damaged_messages import EXAMPLES, damaged
from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.ssl.field import geometry_from_field
from robocup_vision.ssl.protocol.mapping import decode, encode
from robocup_vision.ssl.values import simulation as sim
from robocup_vision.ssl.values.detection import VisionPacket
from robocup_vision.ssl.values.geometry import BallModels, BouncingBall
from robocup_vision.ssl.values.referee import Referee
from robocup_vision.ssl.values.tracked import TrackerPacket
from sim2d.network.league import MAX_REQUEST_BYTES, Channel, LeagueSimulator
from sim2d.network.realism import REALISMS, Realism
from sim2d.network.world import TEAM_OF

FIELD = load_field("ssl_division_b")
YELLOW, BLUE = sim.Team.YELLOW, sim.Team.BLUE
EPOCH_S = 1.7e9


def simulator(players=2, realism=REALISMS["none"], **options):
    return LeagueSimulator(FIELD, players, realism, epoch_s=EPOCH_S, **options)


def control(made, command):
    answer, published = made.answer_control(encode(command))
    assert published == []
    return [] if answer is None else [error.code for error in decode(sim.SimulatorResponse, answer).errors]


def order(made, team, *commands):
    answer, _ = made.answer_robots(team, encode(sim.RobotControl(commands)))
    return None if answer is None else decode(sim.RobotControlResponse, answer)


def teleport(*robots, ball=None, speed=None):
    return sim.SimulatorCommand(sim.SimulatorControl(ball, robots, speed))


def configure(**settings):
    return sim.SimulatorCommand(config=sim.SimulatorConfig(**settings))


def robot_of(made, team, number):
    return next(robot for robot in made.world.state.robots if (TEAM_OF[robot.side], robot.number) == (team, number))


def published(made, steps):
    return [packet for _ in range(steps) for packet in made.step()]


def test_frames_at_60_hz_and_geometry_once_a_second():
    made = simulator()
    packets = published(made, 600)
    vision = [decode(VisionPacket, data) for channel, data in packets if channel is Channel.VISION]
    frames = [packet.detection for packet in vision if packet.detection is not None]
    assert [packet.geometry is not None and packet.detection is None for packet in vision].count(True) == 2
    assert [frame.frame_number for frame in frames] == list(range(1, 121))
    gaps = np.diff([frame.t_capture_s for frame in frames])
    np.testing.assert_allclose(gaps, 1 / 60, atol=1e-6)
    tracked = [decode(TrackerPacket, data).frame for channel, data in packets if channel is Channel.TRACKER]
    assert [frame.t_s for frame in tracked] == [frame.t_capture_s for frame in frames]
    assert 70 <= sum(channel is Channel.REFEREE for channel, _ in packets) <= 90


def test_things_are_put_where_they_shall_be():
    made = simulator()
    there = sim.TeleportRobot(sim.RobotId(1, BLUE), 1.0, -2.0, 0.5, 0.3, 0.1, 2.0)
    ball = sim.TeleportBall(0.5, None, 0.2, 1.0, None, 2.0)
    assert control(made, teleport(there, ball=ball)) == []
    robot, state = robot_of(made, BLUE, 1), made.world.ball
    assert robot.pose.array == pytest.approx([1.0, -2.0, 0.5])
    assert (*robot.velocity_mps, robot.turn_rps) == pytest.approx((0.3, 0.1, 2.0))
    assert (state.x_m, state.y_m, state.z_m, state.vx_mps, state.vz_mps) == pytest.approx((0.5, 0.0, 0.2, 1.0, 2.0))
    # what is left out stays
    assert control(made, teleport(sim.TeleportRobot(sim.RobotId(1, BLUE), y_m=1.0))) == []
    assert robot_of(made, BLUE, 1).pose.array == pytest.approx([1.0, 1.0, 0.5])


def test_robots_come_and_go():
    made = simulator()
    assert control(made, teleport(sim.TeleportRobot(sim.RobotId(0, YELLOW), present=False))) == []
    assert not made.world.has(YELLOW, 0)
    assert control(made, teleport(sim.TeleportRobot(sim.RobotId(0, YELLOW), present=False))) == []
    assert control(made, teleport(sim.TeleportRobot(sim.RobotId(0, YELLOW), 1.0, 0.0, 0.0))) == ["ROBOT_NOT_PRESENT"]
    new = sim.TeleportRobot(sim.RobotId(15, YELLOW), 1.0, 0.0, 0.0, present=True)
    assert control(made, teleport(new)) == []
    assert robot_of(made, YELLOW, 15).pose.x_m == 1.0


def test_a_ball_that_is_put_safely_makes_room():
    made = simulator()
    near = sim.TeleportRobot(sim.RobotId(0, YELLOW), 1.0, 1.05, 0.0, 1.0)
    control(made, teleport(near))
    assert control(made, teleport(ball=sim.TeleportBall(1.0, 1.0, 0.0, teleport_safely=True))) == []
    pose = robot_of(made, YELLOW, 0).pose
    assert math.hypot(pose.x_m - 1.0, pose.y_m - 1.0) > 0.11
    assert robot_of(made, YELLOW, 0).velocity_mps == (0.0, 0.0)


def test_a_ball_commanded_to_roll_rolls():
    ends = []
    for roll in (True, False):
        made = simulator(0)
        control(made, teleport(ball=sim.TeleportBall(-4.0, 2.0, 0.0, 2.0, 0.0, 0.0, roll=roll)))
        published(made, 150)
        ends.append(made.world.ball.vx_mps)
    assert ends[0] > ends[1] + 0.3


NAN = float("nan")


@pytest.mark.parametrize(
    ("command", "code"),
    [
        (teleport(ball=sim.TeleportBall(NAN, 0.0)), "TELEPORT_RANGE"),
        (teleport(ball=sim.TeleportBall(1e9, 0.0)), "TELEPORT_RANGE"),
        (teleport(ball=sim.TeleportBall(z_m=-1.0)), "TELEPORT_RANGE"),
        (teleport(ball=sim.TeleportBall(0.0, 0.0, by_force=True)), "BY_FORCE"),
        (teleport(sim.TeleportRobot(sim.RobotId(1, YELLOW), 0.0, by_force=True)), "BY_FORCE"),
        (teleport(sim.TeleportRobot(sim.RobotId(1, YELLOW), float("inf"))), "TELEPORT_RANGE"),
        (teleport(sim.TeleportRobot(sim.RobotId(1, YELLOW), 0.0, turn_rps=1e30)), "TELEPORT_RANGE"),
        (teleport(sim.TeleportRobot(sim.RobotId(1), 0.0)), "UNKNOWN_TEAM"),
        (teleport(sim.TeleportRobot(sim.RobotId(None, YELLOW), 0.0)), "UNKNOWN_ROBOT"),
        (teleport(sim.TeleportRobot(sim.RobotId(77, YELLOW), 0.0)), "UNKNOWN_ROBOT"),
        (teleport(speed=-1.0), "SPEED_RANGE"),
        (teleport(speed=NAN), "SPEED_RANGE"),
        (teleport(speed=1e-3), "SPEED_RANGE"),
        (teleport(speed=1e30), "SPEED_RANGE"),
        (configure(vision_port=0), "VISION_PORT"),
        (configure(vision_port=70000), "VISION_PORT"),
        (configure(robot_specs=(sim.RobotSpecs(sim.RobotId(1, YELLOW), radius_m=9.0),)), "SPEC_RANGE"),
        (configure(robot_specs=(sim.RobotSpecs(sim.RobotId(1, YELLOW), center_to_dribbler_m=0.2),)), "SPEC_RANGE"),
        (
            configure(
                robot_specs=(sim.RobotSpecs(sim.RobotId(1, YELLOW), wheel_angles=sim.WheelAngles(NAN, 0.0, 0.0, 0.0)),)
            ),
            "SPEC_RANGE",
        ),
        (
            configure(robot_specs=(sim.RobotSpecs(sim.RobotId(1, YELLOW), custom=(sim.AnyMessage("a/b.Odd"),)),)),
            "SPEC_UNKNOWN",
        ),
        (configure(realism=sim.RealismConfig((sim.AnyMessage("a/b.Odd"),))), "REALISM_UNKNOWN"),
        (configure(realism=sim.RealismConfig((sim.AnyMessage("a/b.RealismConfigErForce", b"\xff"),))), "REALISM_RANGE"),
    ],
)
def test_what_cannot_be_done_has_a_code_and_changes_nothing(command, code):
    made = simulator()
    before = made.world.state
    assert control(made, command) == [code]
    assert made.world.state == before
    assert made.bad_datagrams == 0


def test_the_rest_of_a_command_is_done_all_the_same():
    made = simulator()
    bad = sim.TeleportRobot(sim.RobotId(77, YELLOW), 0.0)
    good = sim.TeleportRobot(sim.RobotId(1, YELLOW), 2.0)
    assert control(made, teleport(bad, good, ball=sim.TeleportBall(1.5))) == ["UNKNOWN_ROBOT"]
    assert robot_of(made, YELLOW, 1).pose.x_m == 2.0
    assert made.world.ball.x_m == 1.5


def test_settings_of_speed_port_robots_and_realism():
    made = simulator()
    specs = sim.RobotSpecs(
        sim.RobotId(1, BLUE),
        radius_m=0.08,
        max_kick_mps=3.0,
        limits=sim.LeagueRobotLimits(speed_mps=0.5, speed_up_mps2=1.0),
        custom=(sim.AnyMessage("x/y.RobotSpecErForce", encode(sim.ErForceRobotSpec(0.07, 0.06))),),
    )
    realism = sim.AnyMessage("type.googleapis.com/z.RealismConfigErForce", encode(sim.ErForceRealism(0.004)))
    config = sim.SimulatorConfig(None, (specs,), sim.RealismConfig((realism,)), 10006)
    assert control(made, sim.SimulatorCommand(sim.SimulatorControl(speed=0.5), config)) == []
    assert (made.speed, made.vision_port) == (0.5, 10006)
    assert made.realism == Realism(ball_std_m=pytest.approx(0.004))
    spec = made.world.spec(BLUE, 1)
    assert (spec.radius_m, spec.max_kick_mps, spec.max_speed_mps) == pytest.approx((0.08, 3.0, 0.5))
    assert (spec.center_to_dribbler_m, spec.dribbler_width_m) == pytest.approx((0.07, 0.06))


def test_another_field_is_laid_out():
    made = simulator()
    larger = load_field("ssl_division_a")
    models = BallModels(bouncing=BouncingBall(0.5, 0.9, 0.4))
    assert control(made, configure(geometry=geometry_from_field(larger, (), models))) == []
    assert made.world.field.length_m == larger.length_m
    assert made.world.flight.up_ratio == pytest.approx(0.4)
    told = [decode(VisionPacket, d).geometry for c, d in published(made, 310) if c is Channel.VISION]
    assert {geometry.field.length_m for geometry in told if geometry} == {larger.length_m}
    bad = geometry_from_field(larger)
    for field in (
        dataclasses.replace(bad.field, length_m=900.0),
        dataclasses.replace(bad.field, width_m=-1.0),
        dataclasses.replace(bad.field, lines=bad.field.lines * 10),
    ):
        assert control(made, configure(geometry=dataclasses.replace(bad, field=field))) == ["GEOMETRY"]
    models = BallModels(bouncing=BouncingBall(0.5, 0.9, 1.4))
    assert control(made, configure(geometry=geometry_from_field(FIELD, (), models))) == ["GEOMETRY"]


def test_robots_answer_with_what_they_feel():
    made = simulator()
    control(made, teleport(sim.TeleportRobot(sim.RobotId(0, BLUE), 0.0, 2.0, 0.0)))
    control(made, teleport(ball=sim.TeleportBall(0.0965, 2.0, 0.0, 0.0, 0.0)))
    response = order(made, BLUE, sim.RobotCommand(0), sim.RobotCommand(1), sim.RobotCommand(9))
    assert [(known.number, known.ball_contact) for known in response.feedback] == [(0, True), (1, False)]
    assert [error.code for error in response.errors] == ["ROBOT_NOT_PRESENT"]


@pytest.mark.parametrize(
    "command",
    [
        sim.RobotCommand(0, sim.MoveCommand(local=sim.LocalVelocity(NAN, 0.0, 0.0))),
        sim.RobotCommand(0, sim.MoveCommand(world=sim.GlobalVelocity(0.0, 0.0, 1e9))),
        sim.RobotCommand(0, sim.MoveCommand(wheels=sim.WheelVelocities(0.0, 0.0, float("inf"), 0.0))),
        sim.RobotCommand(0, kick_mps=-1.0),
        sim.RobotCommand(0, kick_angle_rad=2.0),
        sim.RobotCommand(0, dribbler_rps=NAN),
    ],
)
def test_commands_that_no_robot_can_obey_are_answered_so(command):
    made = simulator()
    assert [error.code for error in order(made, YELLOW, command).errors] == ["COMMAND_RANGE"]
    published(made, 30)
    assert robot_of(made, YELLOW, 0).velocity_mps == (0.0, 0.0)


def test_ninety_degrees_as_float32_is_a_chip():
    made = simulator()
    command = decode(sim.RobotCommand, encode(sim.RobotCommand(0, kick_mps=1.0, kick_angle_rad=math.pi / 2)))
    assert order(made, YELLOW, command).errors == ()


def test_losses_are_those_of_the_realism():
    made = simulator(realism=REALISMS["rc2021"])
    answers = [order(made, YELLOW, sim.RobotCommand(0)) for _ in range(2000)]
    assert answers.count(None) / 2000 == pytest.approx(0.10, abs=0.02)


def test_delayed_vision_goes_out_later_than_it_was_exposed():
    made = simulator(realism=REALISMS["rc2021"])
    for _ in range(100):
        for channel, data in made.step():
            packet = decode(VisionPacket, data) if channel is Channel.VISION else None
            if packet is not None and packet.detection is not None:
                age_s = EPOCH_S + made.world.t_s - packet.detection.t_capture_s
                assert age_s == pytest.approx(0.035, abs=1 / 300)


def test_stepping_goes_on_by_what_is_asked_and_stands_still_in_between():
    made = simulator()
    move = sim.MoveCommand(world=sim.GlobalVelocity(1.0, 0.0, 0.0))
    request = sim.SyncRequest(0.05, robot_control=sim.RobotControl((sim.RobotCommand(1, move),)))
    total = 0
    for _ in range(10):
        answer, packets = made.answer_robots(BLUE, encode(request))
        total += sum(channel is Channel.VISION for channel, _ in packets)
        response = decode(sim.SyncResponse, answer)
        assert [known.number for known in response.robots.feedback] == [1]
        assert len(response.detections) == 1
    assert made.world.steps == 150
    assert made.speed == 0
    assert total == 30 + 1
    assert response.detections[0].t_capture_s == pytest.approx(EPOCH_S + 0.5)
    assert robot_of(made, BLUE, 1).velocity_mps[0] == pytest.approx(1.0)
    # steps shorter than the physics' add up
    for _ in range(10):
        made.answer_control(encode(sim.SyncRequest(0.001)))
    assert made.world.steps == 153


def test_stepping_takes_commands_along_and_refuses_what_it_cannot():
    made = simulator()
    ball = teleport(ball=sim.TeleportBall(1.0, 1.0, 0.0, 0.0, 0.0))
    answer, _ = made.answer_control(encode(sim.SyncRequest(0.0, ball, sim.RobotControl((sim.RobotCommand(0),)))))
    response = decode(sim.SyncResponse, answer)
    assert [error.code for error in response.robots.errors] == ["UNKNOWN_TEAM"]
    assert response.detections[0].balls[0].x_m == 1.0
    for step in (1e9, -1.0, NAN):
        answer, packets = made.answer_control(encode(sim.SyncRequest(step)))
        assert [error.code for error in decode(sim.SyncResponse, answer).robots.errors] == ["STEP_RANGE"]
        assert packets == []
    assert made.world.steps == 0


def test_unreadable_requests_are_counted_and_answered():
    made = simulator()
    for data in (b"\xff", b"\x0d\x00", b"\0" * (MAX_REQUEST_BYTES + 1)):
        answer, _ = made.answer_control(data)
        assert [error.code for error in decode(sim.SimulatorResponse, answer).errors] == ["UNREADABLE"]
        answer, _ = made.answer_robots(YELLOW, data)
        assert [error.code for error in decode(sim.RobotControlResponse, answer).errors] == ["UNREADABLE"]
    assert made.bad_datagrams == 6
    assert "at most 8192 bytes" in made.last_problem


def test_no_bytes_stop_the_simulator():
    made = simulator(4)
    rng = np.random.default_rng(5)
    sources = [encode(value) for value in EXAMPLES]
    for _ in range(3000):
        data = damaged(rng, sources[rng.integers(len(sources))], sources[rng.integers(len(sources))])
        if data[:1] == b"\x0d":
            continue
        made.answer_control(data)
        made.answer_robots(YELLOW, data)
        if rng.random() < 0.01:
            made.step()
    published(made, 10)
    for robot in made.world.state.robots:
        assert np.isfinite(robot.pose.array).all()
    assert np.isfinite(dataclasses.astuple(made.world.ball)).all()
    assert made.bad_datagrams > 0


def test_the_same_seed_and_requests_give_the_same_packets():
    runs = []
    for seed in (1, 1, 2):
        made = simulator(3, REALISMS["rc2021"], seed=seed)
        order(made, YELLOW, sim.RobotCommand(1, sim.MoveCommand(local=sim.LocalVelocity(1.0, 0.0, 1.0))))
        runs.append(published(made, 100))
    assert runs[0] == runs[1] != runs[2]


def test_the_referee_lets_everybody_play():
    made = simulator()
    packets = [decode(Referee, data) for channel, data in published(made, 60) if channel is Channel.REFEREE]
    assert {packet.command.name for packet in packets} == {"FORCE_START"}
    assert packets[0].packet_time_us == pytest.approx(EPOCH_S * 1e6, abs=1e5)
    made.publishes_referee = False
    assert not [channel for channel, _ in published(made, 60) if channel is Channel.REFEREE]


def test_what_a_user_can_mend_is_reported():
    with pytest.raises(ArgumentError, match="players must be from 0 to 16, got 17"):
        simulator(17)
    with pytest.raises(ArgumentError, match="seed must not be negative"):
        simulator(seed=-1)
    with pytest.raises(ArgumentError, match="has no goals"):
        LeagueSimulator(dataclasses.replace(FIELD, goals=()), 1, Realism())


@pytest.mark.slow
def test_hours_neither_drift_nor_grow():
    """Only this finds memory that grows with every step, and stamps that drift within a day."""
    import gc
    import tracemalloc

    made = simulator(1, REALISMS["rc2021"])
    move = sim.MoveCommand(world=sim.GlobalVelocity(1.0, 0.3, 1.0))
    published_steps = 300 * 20
    sizes = []
    tracemalloc.start()
    for _ in range(3):
        for step in range(published_steps):
            if step % 30 == 0:
                order(made, YELLOW, sim.RobotCommand(0, move))
            made.step()
        gc.collect()
        sizes.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    assert made.world.t_s == 60.0
    assert sizes[2] - sizes[1] < 20_000
    # a day is 25,920,000 steps, and time is their number over 300: no sum that could drift
    made.world.steps = 24 * 3600 * 300
    assert made.world.t_s == 24 * 3600.0
    frames = [decode(VisionPacket, d).detection for c, d in published(made, 60) if c is Channel.VISION]
    day_s = EPOCH_S + 24 * 3600
    gaps = np.diff(sorted({frame.t_capture_s for frame in frames if frame and frame.t_capture_s > day_s}))
    assert len(gaps) > 5
    np.testing.assert_allclose(gaps, 1 / 60, atol=1e-6)


def tracked(made, steps):
    frames = [decode(TrackerPacket, data) for channel, data in published(made, steps) if channel is Channel.TRACKER]
    return frames[-1].frame


def test_a_kicked_ball_is_told_with_where_it_will_lie():
    made = simulator()
    control(made, teleport(sim.TeleportRobot(sim.RobotId(0, BLUE), 2.0, 2.5, 0.0)))
    control(made, teleport(sim.TeleportRobot(sim.RobotId(1, YELLOW), -3.0, -2.0, 0.0)))
    control(made, teleport(ball=sim.TeleportBall(-2.9, -2.0, 0.0, 0.0, 0.0, 0.0)))
    assert tracked(made, 10).kicked_ball is None
    order(made, YELLOW, sim.RobotCommand(1, kick_mps=2.0))
    kicked = tracked(made, 10).kicked_ball
    assert (kicked.robot.number, int(kicked.robot.team)) == (1, int(YELLOW))
    assert kicked.position_m.x == pytest.approx(-2.9, abs=0.02)
    assert (kicked.velocity_mps.x, kicked.velocity_mps.z) == (pytest.approx(2.0, abs=0.01), 0.0)
    assert kicked.start_s == pytest.approx(EPOCH_S + 10 / 300, abs=0.01)
    steps = round(300 * (kicked.stop_s - EPOCH_S - made.world.t_s))
    late = tracked(made, steps + 60)
    assert late.balls[0].position_m.x == pytest.approx(kicked.stop_position_m.x, abs=0.05)
    assert late.kicked_ball is None


def test_a_kick_is_over_once_somebody_else_has_the_ball():
    made = simulator()
    control(made, teleport(sim.TeleportRobot(sim.RobotId(1, YELLOW), -3.0, -2.0, 0.0)))
    control(made, teleport(sim.TeleportRobot(sim.RobotId(0, BLUE), -2.0, -2.0, math.pi)))
    control(made, teleport(ball=sim.TeleportBall(-2.9, -2.0, 0.0, 0.0, 0.0, 0.0)))
    order(made, YELLOW, sim.RobotCommand(1, kick_mps=3.0))
    assert tracked(made, 30).kicked_ball is not None
    assert tracked(made, 120).kicked_ball is None

"""The simulator on the loopback: its own clients, a program that knows nothing of it, and people who send rubbish."""

import functools
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from ssl_sockets import free_port

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.cli import main
from robocup_vision.ssl.log import LogKind, SslLog
from robocup_vision.ssl.protocol.mapping import decode, encode
from robocup_vision.ssl.requests import RobotClient, SimulatorClient, SyncClient
from robocup_vision.ssl.sockets import REFEREE_GROUP, multicast_sender
from robocup_vision.ssl.subscriptions import RefereeClient, TrackerClient, VisionClient
from robocup_vision.ssl.values import simulation as sim
from robocup_vision.ssl.values.referee import RefereeCommand
from sim2d.network.league import LeagueSimulator
from sim2d.network.packets import referee_packet
from sim2d.network.realism import Realism
from sim2d.network.server import LeagueServer, Ports

WAIT_S = 10.0
FOREIGN_TEAM = Path(__file__).with_name("foreign_team.py")


@pytest.fixture
def running(serve):
    """Run a simulator of division B, six a side."""
    with serve(load_field("ssl_division_b"), 6) as served:
        yield served


def test_our_clients_see_a_robot_that_they_drive(running):
    ports, simulator = running.ports, running.simulator
    move = sim.MoveCommand(local=sim.LocalVelocity(1.0, 0.0, 0.0))
    with (
        VisionClient(simulator.vision_port) as vision,
        TrackerClient(ports.tracker) as tracker,
        RobotClient(sim.Team.YELLOW, port=ports.yellow) as robots,
        SimulatorClient(port=ports.control) as control,
    ):
        control.place_robot(sim.Team.YELLOW, 2, 0.0, 2.0, 0.0)
        places = []
        while len(places) < 40:
            assert vision.receive(WAIT_S) is not None
            robots.send([sim.RobotCommand(2, move)])
            assert robots.receive(WAIT_S).feedback[0].number == 2
            overview = vision.overview
            if overview is not None:
                places.append(next(robot.x_m for robot in overview.yellow if robot.robot_id == 2))
        assert places[-1] > places[0] + 0.1
        assert tracker.receive(WAIT_S).frame.robots
        while vision.geometry is None:
            assert vision.receive(WAIT_S) is not None
        assert vision.geometry.field.length_m == 9.0
        control.send(sim.SimulatorCommand(sim.SimulatorControl(speed=-1.0)))
        assert control.receive(WAIT_S).errors[0].code == "SPEED_RANGE"
    assert simulator.bad_datagrams == 0


def test_vision_moves_to_another_port(running):
    port = free_port()
    with VisionClient(port) as vision, SimulatorClient(port=running.ports.control) as control:
        assert vision.receive(0.1) is None
        control.send(sim.SimulatorCommand(config=sim.SimulatorConfig(vision_port=port)))
        assert vision.receive(WAIT_S) is not None


def test_it_is_stepped_and_paused(running):
    with SimulatorClient(port=running.ports.control) as control:
        assert control.step(0.5, timeout_s=WAIT_S).detections
        steps = running.simulator.world.steps
        time.sleep(0.2)
        assert running.simulator.world.steps == steps
        control.send(sim.SimulatorCommand(sim.SimulatorControl(speed=1.0)))
        end_s = time.monotonic() + WAIT_S
        while running.simulator.world.steps == steps and time.monotonic() < end_s:
            time.sleep(0.01)
        assert running.simulator.world.steps > steps


def test_it_keeps_quiet_while_a_game_controller_speaks(running):
    foreign = encode(referee_packet(1.7e9, 1.0)).replace(b"sim2d", b"other")
    with multicast_sender() as sender, RefereeClient(running.ports.referee) as referee:
        assert referee.receive(WAIT_S).command == RefereeCommand.FORCE_START
        # the client follows the first until it has been silent for a second
        end_s = time.monotonic() + WAIT_S
        while referee.newest.source_identifier != "other" and time.monotonic() < end_s:
            sender.sendto(foreign, (REFEREE_GROUP, running.ports.referee))
            referee.receive(0.03)
        assert referee.newest.source_identifier == "other"
        time.sleep(1.2)
        assert [packet.source_identifier for packet in referee.receive_newest(100)] == []
        assert referee.is_silent


@pytest.mark.slow
def test_stamps_are_this_machines_time_also_after_a_pause(running):
    """Only this finds stamps that a pause leaves behind."""
    with VisionClient(running.simulator.vision_port) as vision, SimulatorClient(port=running.ports.control) as control:
        latest = []
        for speed in (0.0, 1.0, 0.0, 1.0):
            control.send(sim.SimulatorCommand(sim.SimulatorControl(speed=speed)))
            time.sleep(0.3)
            vision.receive_newest(1)
            if speed:
                frames = [vision.receive(WAIT_S) for _ in range(20)]
                stamps = [frame.detection.t_sent_s for frame in frames if frame.detection is not None]
                latest.append(time.time() - stamps[-1])
    # a pause is 0.3 s, and a busy machine may be late by some of it
    assert all(-0.002 < late_s < 0.25 for late_s in latest)


@pytest.mark.slow
def test_who_floods_it_slows_nobody(running):
    """Only this finds a simulator that falls behind for those who send it rubbish."""
    simulator = running.simulator
    flooding = threading.Event()

    def flood():
        junk = np.random.default_rng(1).bytes(600)
        command = encode(sim.SimulatorCommand(config=sim.SimulatorConfig(vision_port=0)))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
            while not flooding.is_set():
                client.sendto(junk, ("127.0.0.1", running.ports.control))
                client.sendto(command, ("127.0.0.1", running.ports.yellow))
                time.sleep(0.0002)

    thread = threading.Thread(target=flood)
    before, begin_s = simulator.world.t_s, time.monotonic()
    thread.start()
    time.sleep(1.0)
    flooding.set()
    thread.join(WAIT_S)
    gone_s, simulated_s = time.monotonic() - begin_s, simulator.world.t_s - before
    assert simulator.bad_datagrams > 100
    # what the machine could not do for others is no fault of the flood
    assert simulated_s + running.behind_s > 0.5 * gone_s


def test_a_port_that_is_taken_is_reported(ports):
    simulator = LeagueSimulator(load_field("ssl_division_b"), 1, Realism())
    with (
        LeagueServer(simulator, ports=ports) as served,
        pytest.raises(ArgumentError, match=f"cannot listen on 127.0.0.1:{ports.control}"),
    ):
        LeagueServer(served.simulator, ports=Ports(ports.control, ports.tracker, free_port()))


def command_line(ports, vision_port, *more):
    given = [
        f"--vision-port={vision_port}",
        f"--tracker-port={ports.tracker}",
        f"--referee-port={ports.referee}",
        f"--control-port={ports.control}",
    ]
    return ["simulate", *given, *more]


def test_the_command_runs_as_fast_as_it_goes_and_ends(ports, capsys):
    assert main(command_line(ports, free_port(), "--speed", "0", "--seconds", "3", "--players", "2")) == 0
    out = capsys.readouterr().out
    assert "3.0 s simulated, 0 bad datagrams" in out
    assert "realism none, network loopback" in out


@pytest.mark.slow
def test_the_command_shows_bad_datagrams_and_ends_by_an_interrupt(ports):
    """Only this finds a server that an interrupt ends with a traceback, or not at all."""
    command = [sys.executable, "-m", "robocup_vision.cli", *command_line(ports, free_port(), "--seconds", "60")]
    # a test run in the background ignores interrupts, and what it starts would, too
    heed = functools.partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, preexec_fn=heed) as process:
        assert "division_b" in process.stdout.readline()
        process.stdout.readline()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
            client.sendto(b"rubbish", ("127.0.0.1", ports.control))
        assert "bad datagrams: 1" in process.stderr.readline()
        time.sleep(1.0)
        os.kill(process.pid, signal.SIGINT)
        out, _ = process.communicate(timeout=6 * WAIT_S)
    assert process.returncode == 0
    assert "vision packets went out late by" in out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("simulate --speed -1", "--speed must be 0 or from 0.01 to 100"),
        ("simulate --seconds 0", "--seconds must be positive"),
        ("simulate --vision-port 0", "--vision-port must be from 1"),
        ("simulate --realism odd", "no realism 'odd'"),
        ("simulate --network nothere0", "no network interface 'nothere0'"),
        ("simulate --players 99", "players must be from 0 to 16"),
        ("simulate --field four_legged_2007 --players -1", "players must be from 0 to 16"),
        ("play --team=yellow --speed=9", "--speed must be from 0.2 to 4 m/s"),
        ("play --team=yellow --seconds=0", "--seconds must be positive"),
        ("play --team=yellow --robot-port=70000", "--robot-port must be from 1 to 65535"),
        ("play --team=yellow --network=nothing0", "there is no network interface 'nothing0'"),
        ("match --ci=127.0.0.1:x", "--ci is given as HOST or HOST:PORT"),
        ("match --referee=network --network=nothing0", "there is no network interface 'nothing0'"),
    ],
)
def test_wrong_options_are_reported_in_one_line(words, message, refused, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert message in refused(*words.split())
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_foreign_team_of_thirty_lines_drives_a_square_and_kicks(running):
    """Only this finds commands of a stranger's program that robots obey otherwise than the league says."""
    ports = running.ports
    arguments = [ports.control, ports.yellow, running.simulator.vision_port]
    done = subprocess.run(
        [sys.executable, str(FOREIGN_TEAM), *map(str, arguments)], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    words = dict(line.split() for line in done.stdout.splitlines())
    assert float(words["worst_corner_m"]) < 0.05
    assert float(words["ball_moved_m"]) > 0.3
    assert words["ball_contact"] == "1"


def test_steps_over_a_connection_are_answered_as_the_draft_has_it(running):
    move = sim.MoveCommand(local=sim.LocalVelocity(1.0, 0.0, 0.0))
    with (
        SyncClient(port=running.ports.control) as control,
        SyncClient(sim.Team.YELLOW, port=running.ports.yellow) as yellow,
    ):
        placed = sim.TeleportRobot(sim.RobotId(2, sim.Team.YELLOW), 0.0, 2.0, 0.0)
        control.step(0.0, command=sim.SimulatorCommand(sim.SimulatorControl(robots=(placed,))))
        steps = running.simulator.world.steps
        for _ in range(20):
            answer = yellow.step(0.05, [sim.RobotCommand(2, move)])
        assert running.simulator.world.steps == steps + 300
        robot = next(robot for robot in answer.detections[0].yellow if robot.robot_id == 2)
        assert robot.x_m == pytest.approx(0.9, abs=0.1)
        (feedback,) = answer.robots.feedback
        assert feedback.custom.kind == "RobotMotion"
        assert decode(sim.RobotMotion, feedback.custom.value).forward_mps == pytest.approx(1.0, abs=0.05)
        answer = control.step(5.0)
        assert answer.robots.errors[0].code == "STEP_RANGE"


def test_rubbish_over_a_connection_ends_it_and_nothing_else(running):
    with socket.create_connection(("127.0.0.1", running.ports.control)) as rude:
        rude.sendall(b"\xff" * 20)
        rude.settimeout(WAIT_S)
        assert rude.recv(10) == b""
    with socket.create_connection(("127.0.0.1", running.ports.control)) as odd:
        odd.sendall(b"\x03\xff\xff\xff")
        odd.settimeout(WAIT_S)
        assert b"UNREADABLE" in odd.recv(1000)
    # more than it takes at once
    crowd = [socket.create_connection(("127.0.0.1", running.ports.control)) for _ in range(12)]
    for one in crowd:
        one.close()
    end_s = time.monotonic() + WAIT_S
    while time.monotonic() < end_s:
        try:
            with SyncClient(port=running.ports.control) as client:
                assert client.step(0.1).detections
            break
        except ArgumentError:
            time.sleep(0.05)
    else:
        raise AssertionError("nobody is let in")


def test_what_is_sent_to_everybody_is_recorded(running, tmp_path, capsys):
    path = tmp_path / "match.log.gz"
    options = [f"--vision-port={running.simulator.vision_port}", f"--tracker-port={running.ports.tracker}"]
    arguments = ["log", "record", str(path), *options, f"--referee-port={running.ports.referee}", "--seconds=1"]
    assert main(arguments) == 0
    assert "vision" in capsys.readouterr().out
    with SslLog(path) as log:
        kinds = [entry.kind for entry in log]
        assert all(entry.value is not None for entry in log)
    assert {LogKind.VISION, LogKind.TRACKER, LogKind.REFEREE} <= set(kinds)
    assert main(arguments) == 2
    assert "is there already (use --force to replace it)" in capsys.readouterr().err

"""Clients over the loopback: values arrive as they were sent, silence ends in time, and rubbish is counted."""

import asyncio
import dataclasses
import socket
import threading

import pytest
from ssl_sockets import free_port

from benchmarks.worlds.damaged_messages import FRAME, GEOMETRY, REFEREE, TRACKED
from field_models.errors import ArgumentError, PacketError
from robocup_vision.ssl.protocol.mapping import decode, encode
from robocup_vision.ssl.requests import RobotClient, SimulatorClient
from robocup_vision.ssl.sockets import VISION_GROUP, interface_address, multicast_receiver, multicast_sender, server
from robocup_vision.ssl.subscriptions import RefereeClient, TrackerClient, VisionClient
from robocup_vision.ssl.values import simulation as sim
from robocup_vision.ssl.values.detection import VisionPacket
from robocup_vision.ssl.values.tracked import TrackerPacket

WAIT_S = 5.0


def end(port):
    """Tell the peer of `echo` that nothing more comes."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
        own.sendto(b"end", ("127.0.0.1", port))


@pytest.fixture
def sender():
    with multicast_sender() as made:
        assert made.getsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL) == 0
        yield made


def test_vision_arrives_and_is_merged(sender):
    port = free_port()
    packet = decode(VisionPacket, encode(VisionPacket(FRAME, GEOMETRY)))
    with VisionClient(port) as client, VisionClient(port) as neighbour:
        assert client.receive(0.0) is None
        sender.sendto(b"rubbish", (VISION_GROUP, port))
        sender.sendto(encode(packet), (VISION_GROUP, port))
        assert client.receive(WAIT_S) == neighbour.receive(WAIT_S) == packet
        assert client.overview.t_capture_s == FRAME.t_capture_s
        assert client.geometry == packet.geometry
        assert client.bad_datagrams == 1
        assert "are no vision.SSL_WrapperPacket" in client.last_problem
        assert client.receive(0.05) is None


def test_of_two_vision_systems_with_one_camera_the_first_is_followed_and_the_other_said(sender):
    port = free_port()

    def frame_of(camera, x_m):
        ball = dataclasses.replace(FRAME.balls[0], x_m=x_m)
        return encode(VisionPacket(dataclasses.replace(FRAME, camera_id=camera, balls=(ball,))))

    with VisionClient(port) as client, multicast_sender() as other:
        sender.sendto(frame_of(0, 1.0), (VISION_GROUP, port))
        assert client.receive(WAIT_S).detection.camera_id == 0
        assert client.problem == ""
        other.sendto(frame_of(0, 5.0), (VISION_GROUP, port))
        assert client.receive(0.05) is None
        assert [ball.x_m for ball in client.overview.balls] == pytest.approx([1.0])
        assert client.problem.startswith("another sender of frames of camera 0 is not followed: ")
        # a second machine of the same vision has cameras of its own
        other.sendto(frame_of(1, 3.0), (VISION_GROUP, port))
        assert client.receive(WAIT_S).detection.camera_id == 1
        assert [ball.x_m for ball in client.overview.balls] == pytest.approx([3.0])


def test_referee_distinguishes_new_commands_from_repeated_ones(sender):
    port = free_port()
    with RefereeClient(port) as client:
        seen = []
        for counter in (7, 7, 8):
            sender.sendto(encode(dataclasses.replace(REFEREE, command_counter=counter)), ("224.5.23.1", port))
            assert client.receive(WAIT_S).command_counter == counter
            seen.append(client.new_command)
    assert seen == [True, False, True]
    assert client.newest.command_counter == 8


class LoopWithoutReaders(asyncio.SelectorEventLoop):
    """Watches no sockets for its users, as the usual loop on Windows does not."""

    def add_reader(self, *_):
        """Refuse, as that loop does."""
        raise NotImplementedError


@pytest.fixture(params=[asyncio.SelectorEventLoop, LoopWithoutReaders])
def run(request):
    loop = request.param()
    yield loop.run_until_complete
    loop.run_until_complete(loop.shutdown_default_executor())
    loop.close()


def test_asyncio_receives_too(sender, run):
    port = free_port()
    packet = TrackerPacket("a", "b", TRACKED)

    async def listen(client):
        assert await client.receive_async(0.0) is None
        assert await client.receive_async(0.02) is None
        asyncio.get_running_loop().call_later(0.02, sender.sendto, encode(packet), (VISION_GROUP, port))
        return await client.receive_async(WAIT_S)

    with TrackerClient(port) as client:
        received = run(listen(client))
    assert received.uuid == packet.uuid


def test_a_wait_in_asyncio_without_end_can_be_cancelled_and_begun_anew(sender, run):
    port = free_port()
    packet = TrackerPacket("a", "b", TRACKED)

    async def listen(client):
        waiting = asyncio.create_task(client.receive_async())
        await asyncio.sleep(0.02)
        waiting.cancel()
        with pytest.raises(asyncio.CancelledError):
            await waiting
        sender.sendto(encode(packet), (VISION_GROUP, port))
        return await client.receive_async(WAIT_S)

    with TrackerClient(port) as client:
        assert run(listen(client)).uuid == packet.uuid


@pytest.fixture
def echo():
    """Answer three datagrams with what a function makes of them."""
    with server(0) as listening:
        listening.settimeout(WAIT_S)

        def run(answer):
            def serve():
                for _ in range(3):
                    try:
                        data, peer = listening.recvfrom(65507)
                    except TimeoutError:
                        return
                    if data == b"end":
                        return
                    for reply in answer(data):
                        listening.sendto(reply, peer)

            thread = threading.Thread(target=serve)
            thread.start()
            return thread

        yield listening.getsockname()[1], run


def test_robots_are_commanded_and_answer(echo):
    port, run = echo
    commands = (sim.RobotCommand(3, sim.MoveCommand(world=sim.GlobalVelocity(1.0, 0.0, 0.0)), kick_mps=2.0),)
    feedback = sim.RobotControlResponse(feedback=(sim.RobotFeedback(3, True),))
    heard = []

    def answer(data):
        heard.append(data)
        return b"\xff", encode(feedback)

    thread = run(answer)
    with RobotClient(sim.Team.BLUE, port=port) as client:
        client.send(commands)
        assert client.receive(WAIT_S) == feedback
        assert client.bad_datagrams == 1
        end(port)
    thread.join(WAIT_S)
    assert decode(sim.RobotControl, heard[0]).commands == commands


def test_a_simulator_is_controlled_stepped_and_answers_asyncio(echo):
    port, run = echo
    heard = []

    def answer(data):
        heard.append(data)
        if len(heard) == 1:
            return [encode(sim.SimulatorResponse((sim.SimulatorError("CODE", "words"),)))]
        return [encode(sim.SyncResponse((FRAME,)))]

    thread = run(answer)
    with SimulatorClient(port=port) as client:
        client.place_robot(sim.Team.YELLOW, 2, 1.0, 2.0, 0.5)
        told = asyncio.run(client.receive_async(WAIT_S))
        assert told.errors[0].code == "CODE"
        assert client.step(0.5, timeout_s=WAIT_S).detections[0].camera_id == FRAME.camera_id
        end(port)
        thread.join(WAIT_S)
    placed = decode(sim.SimulatorCommand, heard[0]).control.robots[0]
    assert (placed.robot.number, placed.robot.team, placed.present) == (2, sim.Team.YELLOW, True)
    assert decode(sim.SyncRequest, heard[1]).step_s == 0.5


def test_nobody_there_is_silence():
    with SimulatorClient(port=free_port()) as client:
        client.place_ball(0.0, 0.0)
        client.remove_robot(sim.Team.BLUE, 1)
        assert client.receive(0.05) is None
        assert asyncio.run(client.receive_async(0.05)) is None


def test_what_a_user_can_mend_is_reported():
    with pytest.raises(ArgumentError, match="no network interface 'nothere0'"):
        interface_address("nothere0")
    assert interface_address("lo") == interface_address("loopback") == interface_address("127.0.0.1") == "127.0.0.1"
    with pytest.raises(ArgumentError, match=r"cannot listen to 224\.5\.23\.2:70000.*port must be"):
        multicast_receiver(VISION_GROUP, 70000)
    with pytest.raises(ArgumentError, match=r"cannot send on 203\.0\.113\.9"):
        multicast_sender("203.0.113.9")
    with pytest.raises(ArgumentError, match="team must be yellow or blue"):
        RobotClient(sim.Team.UNKNOWN)
    with pytest.raises(ArgumentError, match="cannot reach"):
        SimulatorClient("300.300.300.300")
    with server(0) as taken, pytest.raises(ArgumentError, match=r"cannot listen on 127\.0\.0\.1"):
        server(taken.getsockname()[1])
    with SimulatorClient(port=free_port()) as client, pytest.raises(PacketError, match="cannot be written"):
        client.send(sim.SimulatorCommand(config=sim.SimulatorConfig(vision_port=-1)))

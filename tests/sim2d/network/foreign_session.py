"""Run a match and a foreign client of its vision, and compare what that client read with the truth.

Called with the client's own interpreter and the client's program, in a network namespace of its own. Prints how many
frames and things agreed, as JSON.
"""

import itertools
import json
import math
import subprocess
import sys
import threading
import time

import numpy as np

from field_models import load_field
from robocup_vision.ssl.protocol.mapping import encode
from robocup_vision.ssl.values import simulation as sim
from sim2d.network.league import STEPS_A_FRAME, LeagueSimulator
from sim2d.network.realism import Realism
from sim2d.network.server import LeagueServer
from sim2d.network.world import TEAM_OF

LIMIT_S = 60.0


def drive(simulator):
    t_s = simulator.world.t_s
    for team in (sim.Team.YELLOW, sim.Team.BLUE):
        commands = tuple(
            sim.RobotCommand(
                number,
                sim.MoveCommand(world=sim.GlobalVelocity(math.sin(t_s + number), math.cos(2 * t_s + number), 1.0)),
                kick_mps=3.0,
            )
            for number in range(6)
        )
        simulator.answer_robots(team, encode(sim.RobotControl(commands)))


def main(python, program):
    simulator = LeagueSimulator(load_field("ssl_division_b"), 6, Realism(), epoch_s=time.time())
    simulator.vision_port = 10006
    truths = {}
    stop = threading.Event()
    end_s = time.monotonic() + LIMIT_S

    def goes_on():
        if simulator.world.steps % STEPS_A_FRAME == 0:
            truths[simulator.epoch_s + simulator.world.t_s] = simulator.world.state
            drive(simulator)
        return not stop.is_set() and time.monotonic() < end_s

    with LeagueServer(simulator) as server:
        thread = threading.Thread(target=server.run, args=(goes_on,))
        thread.start()
        done = subprocess.run([python, "-c", program], capture_output=True, text=True, timeout=LIMIT_S, check=False)
        stop.set()
        thread.join(LIMIT_S)
    if done.returncode:
        raise SystemExit(done.stderr)
    frames = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    things = wrong = 0
    for frame in frames:
        truth = truths[frame["t"]]
        seen = {(team, number): place for team, number, *place in frame["robots"]}
        for robot in truth.robots:
            pose = robot.pose
            want = [1000 * pose.x_m, 1000 * pose.y_m, pose.theta_rad]
            things += 1
            wrong += np.float32(seen[TEAM_OF[robot.side], robot.number]).tolist() != np.float32(want).tolist()
        things += 1
        wrong += (
            np.float32(frame["ball"]).tolist() != np.float32([1000 * truth.ball.x_m, 1000 * truth.ball.y_m]).tolist()
        )
    numbers = [frame["n"] for frame in frames]
    consecutive = all(b - a == 1 for a, b in itertools.pairwise(numbers))
    print(json.dumps({"frames": len(frames), "consecutive": consecutive, "things": things, "wrong": wrong}))


main(*sys.argv[1:])

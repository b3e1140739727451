"""A team of the small-size league in a few lines: a robot drives to the ball and kicks it.

Starts a simulator of its own on the loopback; with another one running, leave that line out.
"""

import math
import subprocess
import sys

from robocup_vision.ssl import (
    GlobalVelocity,
    MoveCommand,
    RobotClient,
    RobotCommand,
    SimulatorClient,
    Team,
    VisionClient,
)

PORTS = ["--vision-port=30020", "--control-port=30300", "--tracker-port=30010", "--referee-port=30003"]
simulator = subprocess.Popen([sys.executable, "-m", "robocup_vision.cli", "simulate", "--seconds=60", *PORTS])

with VisionClient(port=30020) as vision, RobotClient(Team.YELLOW, port=30302) as robots:
    vision.receive(timeout_s=20.0)  # it runs
    with SimulatorClient(port=30300) as control:
        control.place_ball(-0.2, 0.5)
    away_m = 0.0
    while vision.receive(timeout_s=1.0) and away_m < 1.0:
        if vision.overview is not None and vision.overview.balls:
            ball, me = vision.overview.balls[0], vision.overview.yellow[1]
            assert me.orientation_rad is not None  # a robot on the field has one
            dx_m, dy_m = ball.x_m - me.x_m, ball.y_m - me.y_m
            away_m = math.hypot(dx_m, dy_m)
            turn_rps = 4.0 * math.remainder(math.atan2(dy_m, dx_m) - me.orientation_rad, math.tau)
            move = MoveCommand(world=GlobalVelocity(1.5 * dx_m, 1.5 * dy_m, turn_rps))
            robots.send([RobotCommand(1, move, kick_mps=3.0)])
            answer = robots.receive(timeout_s=0.1)
    print(f"kicked from {me.x_m:+.2f} m, {me.y_m:+.2f} m; the ball is at {ball.x_m:+.2f} m, {ball.y_m:+.2f} m already")
    print("the robot answers:", answer.feedback[0] if answer else "nothing")
simulator.kill()
simulator.wait()

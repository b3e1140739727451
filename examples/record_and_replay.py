"""Records a robot's loop and replays it: bit for bit, and then with another method, to see what that had changed."""

import math
from pathlib import Path

import numpy as np

from field_models import load_field
from robocup_vision import Memory, MotionLimits, Steering, Vision
from robocup_vision.recording import Recorder, Recording
from robocup_vision.recording.loops import Changes
from robocup_vision.recording.replay import Differences, replay
from robocup_vision.recording.replay_files import summary_lines
from sim2d.match.arena import Arena
from sim2d.robot_link import Command

PATH = Path("out/record_and_replay.mcap")
PATH.parent.mkdir(exist_ok=True)

# the simulator stands in for the robot: its camera, its wheels, and where it truly is
arena = Arena(load_field("ssl_2001"), players=2, seed=3)
vision = Vision(arena.field, arena.camera, memory=Memory.of_everything(arena.field))
steering = Steering(robot_radius_m=0.1, limits=MotionLimits(speed_mps=0.5, acceleration_mps2=0.5))

with Recorder(PATH, vision, steering) as recorder:
    velocity_mps = np.zeros(2)
    for _ in range(60):
        senses, truth = arena.senses()[0], arena.state.robots[0].pose
        view = recorder.look(senses.frame, t_s=senses.t_s, odometry=senses.odometry)
        target_rad = 0.0 if view.ball is None else math.atan2(view.ball.y_m, view.ball.x_m)
        velocity_mps = recorder.steer(view.free_space, velocity_mps, target_rad).velocity_mps
        recorder.add_truth(truth, senses.t_s)
        arena.step({0: Command(*velocity_mps), 1: Command(), 2: Command(), 3: Command()})
print(f"recorded: {PATH}, {PATH.stat().st_size / 2**20:.1f} MiB")

for title, changes in (("as it was", Changes()), ("by the published method", Changes(method="hull"))):
    differences = Differences()
    for call in replay(Recording(PATH), changes):
        differences.add(call)
    print(f"replayed {title}:")
    for label, text in summary_lines(differences):
        print(f"  {label:<34} {text}")

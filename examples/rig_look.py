"""A middle-size robot with four fisheye cameras: one pose, the floor all around, and what happens without a camera.

Frames come from the renderer of matches, so that the truth is known. out/rig.png shows the four pictures side by side.
"""

import math
from pathlib import Path

import cv2
import numpy as np

from field_models import load_field
from robocup_vision import Memory, MotionLimits, Pose2, Steering, Vision, draw
from sim2d.match.arena import Arena
from sim2d.match.setups import setup_for

OUT = Path("out")
STEP_S, LOOKS = 1 / 30, 6

field = load_field("msl_6x4")
rig = setup_for(field, camera="msl_fisheyes").rig  # on a robot: load_rig("rig.toml")
assert rig is not None
arena = Arena(field, 2, seed=3, camera=rig)
vision = Vision(field, rig, memory=Memory(field, half="own"))
steering = Steering(0.25, MotionLimits(speed_mps=1.5, acceleration_mps2=1.5))

for number in range(LOOKS):
    senses, truth = arena.senses()[0], arena.state.robots[0].pose
    frames = senses.rig_frames
    assert frames is not None
    if number == 3:
        # the camera behind gives no frame this time
        frames = tuple(None if name == "behind" else frame for name, frame in zip(rig.names, frames, strict=True))
    view = vision.look(frames, t_s=number * STEP_S, odometry=Pose2(0.0, 0.0, 0.0))
    command = steering.steer(view.free_space, (0.0, 0.0), target_bearing_rad=math.pi)
    text = (
        view.pose.reason if not view.pose else f"{1e3 * view.pose.pose.error_to(truth, symmetric=True)[0]:.1f} mm off"
    )
    given = sum(frame is not None for frame in frames)
    free = f"{np.isfinite(view.free_space.range_m).sum()} of {len(view.free_space.range_m)} directions seen"
    print(f"{given} frames: {text}, {free}, backwards at {-command.velocity_mps[0]:.1f} m/s")

    if number == LOOKS - 1:
        OUT.mkdir(exist_ok=True)
        cv2.imwrite(str(OUT / "rig.png"), draw(view, frames, vision))

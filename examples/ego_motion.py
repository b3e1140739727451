"""How a robot moves, estimated from what its camera shows alone: without wheels, and with wheels that slip.

Each frame's floor edge is compared with those of earlier frames. The simulator plays the robot: a mirror camera's
frames and the wheels' odometry are all that the code gets; the true pose is read for the comparison only.
"""

import numpy as np

from field_models import load_field
from robocup_vision import Memory, Pose2, Vision
from robocup_vision.mapping import ViewMotion
from sim2d.match.arena import Arena
from sim2d.robot_link import Command

SPINNING = 1.1  # the wheels report a tenth more than the robot drives

field = load_field("ssl_2001")
arena = Arena(field, players=2, seed=5)
memory = Memory(field, ego_motion=ViewMotion())  # goes from frame to frame by the views
vision = Vision(field, arena.camera, memory=memory)
without_wheels, with_wheels = ViewMotion(), ViewMotion()
reported = Pose2(0.0, 0.0, 0.0)
start = None

for period in range(90):
    senses = arena.senses()[0]
    truth = arena.state.robots[0].pose
    start = truth if start is None else start
    step = senses.odometry
    slipped = Pose2(SPINNING * step.x_m, SPINNING * step.y_m, SPINNING * step.theta_rad)
    reported = reported.compose(slipped)
    view = vision.look(senses.frame, senses.t_s)
    seen = without_wheels.update(view)
    fused = with_wheels.update(view, slipped)
    if period % 30 == 29:
        moved = start.inverse().compose(truth)
        print(f"{senses.t_s:.1f} s: really at {moved.x_m:+.3f} m, {moved.y_m:+.3f} m from the start")
        if view.belief and view.belief.pose:
            off_m, _ = view.belief.pose.pose.error_to(truth)
            print(f"    its pose in the field, estimated without odometry: off by {1000 * off_m:.1f} mm")
        for name, pose in (("views alone", seen.pose), ("wheels alone", reported), ("both", fused.pose)):
            off_m, off_rad = pose.error_to(moved)
            print(f"    {name:12} off by {1000 * off_m:5.1f} mm, {np.degrees(off_rad):4.1f} deg")
    arena.step({0: Command(0.3, 0.0, 0.4), 1: Command(0.3, 0.0, -0.9), 2: Command(0.3, 0.0, 0.9)})
std_mm = 1000 * np.sqrt(np.diag(seen.covariance)[:2])
print(f"the last step by views alone: {seen.motion}, sure to {std_mm.max():.1f} mm, by {seen.profiles} earlier frames")

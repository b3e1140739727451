"""Which gap, whence to look, how fast, where to turn the head, where to shoot: planners on made-up scenes."""

from itertools import pairwise
from pathlib import Path

import numpy as np

from field_models import load_field
from robocup_vision import Pose2, PoseEstimate, load_camera
from robocup_vision.camera import PinholeCamera
from robocup_vision.planning import (
    GOAL_DETECTORS,
    Disc,
    GatePlanner,
    MotionLimits,
    Neck,
    PassageTimes,
    PathFollower,
    PoseGaze,
    PoseNoise,
    ShotPlanner,
    SpeedPlanner,
    UndecidedFloor,
    UndecidedSpeed,
    WidthSensor,
    choose_gap,
    cover_goal,
    gap_between,
)

ROBOT_M, LOOK_S = 0.09, 0.6
limits = MotionLimits(speed_mps=1.0, acceleration_mps2=1.2, dead_time_s=0.03)

# three opponents as a tracker has them, the robot on its way to a goal behind them
opponents = [Disc(2.0, y, 0.09, np.diag([0.04, 0.015]) ** 2) for y in (-0.5, 0.0, 0.62)]
gaps = [gap_between(a, b) for a, b in pairwise(opponents)]
robot, goal = Pose2(0.0, 0.0, 0.0), (4.0, 0.0)
covariance = np.diag([0.02, 0.02, 0.02]) ** 2

# of several gaps the one with the least expected time, by the speeds that are safe at each width
follower = PathFollower(limits)
speeds = SpeedPlanner(follower, ROBOT_M, PoseNoise(0.05, 0.1, covariance), LOOK_S)
times = PassageTimes(speeds, opponent_radius_m=0.09, opponent_sigma_m=0.015)
choice = choose_gap(times, (robot.x_m, robot.y_m), goal, gaps)
print("gap", choice.index, "-", choice.reason)

# a single gap against a sure way round: through, round, or look first, and whence
gate = GatePlanner(limits, WidthSensor(angle_rad=0.005, height_m=0.3), needed_m=times.narrowest_m)
for gap in gaps:
    print(gate.plan((robot.x_m, robot.y_m), gap, goal, [(2.0, -1.2)]).reason)

# on the way through the chosen one: as fast as the next viewpoint is safe
x, y = gaps[choice.index].center_m
path = np.array([(0.0, 0.0), (x - 0.4, y), (x + 0.4, y), goal])
for here in (robot, Pose2(1.4, y, 0.0)):
    plan = speeds.plan(path, here, covariance, (0.5, 0.0), opponents)
    print(f"at x = {here.x_m:g} m: {plan.reason}; command", follower.command(path, here, plan.speed_mps).round(2))

# and as fast as floor that is hidden by now will have been looked at in time
looks = np.full((60, 100), -1, dtype=np.int16)  # all free, but for a strip behind the opponents
looks[30:36, 52:60] = 4
floor = UndecidedFloor(looks, corner_m=(-0.5, -1.5), cell_m=0.05)
print(UndecidedSpeed(limits, ROBOT_M, LOOK_S).plan(np.array([(1.2, 0.2), goal]), floor).reason)

# a four-legged robot turns its head to where landmarks leave its pose least uncertain, past an opponent
head = load_camera(Path(__file__).parents[1] / "images" / "goal_four_legged" / "camera.toml")
assert isinstance(head, PinholeCamera)
gaze = PoseGaze(load_field("four_legged_2007"), head, Neck(1.4), detectors=GOAL_DETECTORS)
belief = PoseEstimate(Pose2(0.5, -0.8, 0.6), np.diag([0.1, 0.1, 0.05]) ** 2, 1.0, 0.0)
opponent = Disc(1.5, -0.5, 0.15, np.diag([0.05, 0.05]) ** 2, height_m=0.28)
print(gaze.choose(belief, t_s=0.0, blockers=[opponent]).reason)

# with the ball: kick now, turn first, or go nearer, past a keeper that runs for the ball once it has seen it
runners = MotionLimits(speed_mps=1.0, acceleration_mps2=1.2, dead_time_s=0.15)
posts = ((4.5, 0.3), (4.5, -0.3))
shots = ShotPlanner(posts, 0.0215, 1.4, 0.03, runners, dribble_mps=0.5, turn_rps=2.0, lost_s=1.0, slips_s=8.0)
keeper = Disc(4.35, 0.05, 0.09, np.diag([0.02, 0.02]) ** 2, vy_mps=0.2)
for ball in ((3.2, 0.0), (4.0, -0.1)):
    shot = shots.plan(ball, heading_rad=0.0, defenders=[keeper], place_std_m=0.01, heading_std_rad=0.02)
    print(f"{shot.action}: {shot.reason}")

# and the keeper that it shoots at: where nothing of the goal is open to a ball that another one has
cover = cover_goal((3.9, 0.2), posts, reach_m=0.09 + 0.0215, room_m=0.03)
x, y = cover.place_m
print(f"keep the goal at ({x:.2f}, {y:.2f}): it is {cover.open_rad:.2f} rad wide from the ball")

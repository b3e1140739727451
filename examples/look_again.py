"""Where to look: which half of the field this is, and which undecided floor lies on the way.

First a four-legged robot sees a goal, forgets which one it was, and turns away: by that frame and odometry it knows its
pose but for the half of the field. It pans its head until a goal's colour decides.
Then a robot with a mirror camera knows part of the floor, and asks what to look at before it drives on. The simulator
plays both robots; the code gets frames, odometry and the head's pan only.
"""

import math

import numpy as np

from field_models import load_field
from robocup_vision import Memory, Vision
from robocup_vision.belief import Hypothesis
from robocup_vision.camera import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import half_turn_covariance
from robocup_vision.localization.goal.pose_estimator import GoalPoseEstimator
from robocup_vision.mapping.occupancy import FREE, NO_GO
from robocup_vision.planning import GoalQuestion, SelectiveLook
from robocup_vision.planning.gaze.goal_question import identified_goal
from sim2d.match.arena import Arena
from sim2d.robot_link import Command

# which half: a look at a time, until little entropy is left or no look would help
field = load_field("four_legged_2007")
arena = Arena(field, players=1, seed=3)
assert isinstance(arena.camera, PinholeCamera)
estimator, question = GoalPoseEstimator(field, arena.camera), GoalQuestion(field, arena.camera)
seen: PoseEstimate | NotLocated = NotLocated("no frame yet")
while not isinstance(seen, PoseEstimate):
    senses = arena.senses()[0]
    if senses.frame is not None:
        seen = estimator.locate(senses.frame)
    arena.step({0: Command()})
pose, covariance = seen.seen_from(arena.camera.camera_in_robot.inverse()).pose, np.diag([0.05, 0.05, 0.05]) ** 2
for _ in range(30):  # it turns away from both goals
    pose = pose.compose(arena.senses()[0].odometry)
    arena.step({0: Command(turn_rps=2.0)})
pose = pose.compose(arena.senses()[0].odometry)
halves = [(pose.half_turn(), half_turn_covariance(covariance)), (pose, covariance)]
probability, pan_rad = np.array([0.5, 0.5]), 0.0
for _ in range(6):
    hypotheses = [Hypothesis(*half, p) for half, p in zip(halves, probability.tolist(), strict=True)]
    fixation = question.choose(hypotheses, pan_rad)
    print(fixation.reason)
    if fixation.pan_rad is None:
        break
    for _ in range(20):  # until the head is there
        arena.step({0: Command(pan_rad=fixation.pan_rad)})
    senses = arena.senses()[0]
    while senses.frame is None:  # frames come late, and now and then not at all
        arena.step({0: Command(pan_rad=fixation.pan_rad)})
        senses = arena.senses()[0]
    assert senses.frame_pan_rad is not None
    pan_rad = senses.frame_pan_rad
    goal = identified_goal(field, estimator.locate(senses.frame))
    print(f"    at {math.degrees(pan_rad):+.0f} deg:", {1: "goal at +x", -1: "goal at -x", 0: "no goal"}[goal])
    probability = question.observe(hypotheses, pan_rad, goal)
print("the half of that first frame has probability", probability[1].round(3))

# which floor: as a map of what the camera has seen so far has it, a few metres ahead
field = load_field("ssl_2001")
arena = Arena(field, players=2, seed=5)
vision = Vision(field, arena.camera, memory=Memory.of_everything(field))
for period in range(60):
    senses = arena.senses()[0]
    view = vision.look(senses.frame, senses.t_s, odometry=senses.odometry)
    arena.step({0: Command(0.2, 0.0, 0.3)})
    belief = view.belief
    if period % 20 == 19 and belief and belief.pose and belief.free_map:
        here, picture = belief.pose.pose, belief.free_map
        planner = SelectiveLook(picture.cell_m, robot_radius_m=0.09, half_view_rad=0.2)
        corner, side_m = np.array(picture.corner_m), picture.cell_m * len(picture.state)
        target = np.clip((0.9, 0.4), corner + 0.05, corner + side_m - 0.05).tolist()
        place = (here.x_m, here.y_m)
        x, y = (corner[k] + picture.cell_m * (np.arange(len(picture.state)) + 0.5) for k in (0, 1))
        free = picture.state == FREE
        free |= np.hypot(x[:, None] - here.x_m, y - here.y_m) < 0.2  # it stands there
        for _ in range(3):
            no_go = (picture.state == NO_GO) & ~free
            chosen = planner.choose(free, no_go, picture.corner_m, place, (target[0], target[1]))
            print(f"{senses.t_s:.1f} s: {chosen.reason}")
            if chosen.at_m is None:
                break
            planner.observe(chosen.at_m, place)

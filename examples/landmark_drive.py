"""Drive a robot through a lecture hall by a landmark map alone: one camera, no odometry, people in the way.

Three cameras go ahead once and make the map. `--whole` maps and drives all 9.9 m, which takes some minutes.
"""

import sys

import numpy as np

from robocup_vision import Pose2
from robocup_vision.landmarks.mapping.stereo_mapper import StereoMapper
from robocup_vision.landmarks.vision import LandmarkVision
from sim2d.hall_drive import SPEED_MPS, drive
from sim2d.rendering.hall.lecture_hall import LECTURE_SENSOR, WAY_M, make_lecture_hall, visit, way
from sim2d.rendering.hall.runs import HALL_CAMERA, HALL_RIG, take

MOMENTS = 143
moments = MOMENTS if "--whole" in sys.argv[1:] else 12
places = way(MOMENTS)[:moments]

empty = make_lecture_hall(1)
hall, mapped_among = visit(empty, 1)
mapper = StereoMapper(HALL_RIG, start=places[0])
rig = (HALL_RIG.right, HALL_RIG.left, HALL_RIG.top)
interval_s = WAY_M / SPEED_MPS / MOMENTS
for moment in take(hall, rig, places, 1, bustle=mapped_among, interval_s=interval_s, sensor=LECTURE_SENSOR):
    right, left, top = moment.images
    mapper.add(right, left, top)
landmarks = mapper.finish()
print(len(landmarks), "landmarks")

# on another visit, with other people and less light, it starts 0.1 m beside the map's run
hall, bustle = visit(empty, 2, level=0.5)
start = places[0].compose(Pose2(0.0, 0.1, 0.0))
vision = LandmarkVision(landmarks, HALL_CAMERA)
for step in drive(vision, hall, bustle, mapper.poses, start, LECTURE_SENSOR, np.random.default_rng(1)):
    believed = f"{1e3 * step.pose.pose.error_to(step.truth)[0]:.0f} mm wrong" if step.pose else step.pose.reason
    print(f"{step.t_s:5.2f} s: {1e3 * step.off_path_m:.0f} mm off the path, {believed}")

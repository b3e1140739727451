"""Where a robot is by what hangs on the walls: a map from three cameras, then poses from one, in less light.

A rendered hall stands in for a real one. A whole round of it: robocup-vision render-hall, map build and evaluate.
"""

import math
from pathlib import Path

import cv2

from robocup_vision.landmarks.landmark_map import load_map, save_map
from robocup_vision.landmarks.mapping.stereo_mapper import StereoMapper
from robocup_vision.landmarks.vision import LandmarkVision, draw_landmarks
from sim2d.rendering.hall.hall import HallLight, loop_path, make_hall
from sim2d.rendering.hall.runs import HALL_CAMERA, HALL_RIG, take

OUT = Path("out")
OUT.mkdir(exist_ok=True)
hall = make_hall(1)
turns = 12 / 143  # of a round of 10 m

cameras = (HALL_RIG.right, HALL_RIG.left, HALL_RIG.top)
places = loop_path(12, turns=turns)
mapper = StereoMapper(HALL_RIG, start=places[0])
for moment in take(hall, cameras, places, seed=1):
    right, left, top = moment.images
    step = mapper.add(right, left, top)
    print(f"{step.stereo_points} features seen by all three cameras, {step.matched} of them on the map")
save_map(mapper.finish(), OUT / "landmarks.npz")

vision = LandmarkVision(load_map(OUT / "landmarks.npz"), HALL_CAMERA)
shifted = loop_path(4, shift_m=0.1, turns=turns)
for moment in take(hall, (HALL_CAMERA,), shifted, seed=2, light=HallLight(level=0.5)):
    view = vision.look(moment.images[0])
    if not view.pose:
        print("not located:", view.pose.reason)
        continue
    error_m, error_rad = view.pose.pose.error_to(moment.pose)
    print(f"{len(view.match.matched)} of {len(view.match.expected)} landmarks found", end=", ")
    print(f"off by {1e3 * error_m:.1f} mm and {math.degrees(error_rad):.3f} deg")

cv2.imwrite(str(OUT / "landmarks.png"), draw_landmarks(view, moment.images[0]))
print("the last picture with its landmarks:", OUT / "landmarks.png")

"""Where a camera stands, from one picture of a goal: nothing of its neck's angles is known.

The pictures are rendered ones of a four-legged robot, whose truth is known; each stands alone.
"""

import csv
import math
from pathlib import Path

import cv2

from field_models import load_field
from robocup_vision import Pose2, Vision, draw, load_camera

DATASET = Path(__file__).parents[1] / "images" / "goal_four_legged"
OUT = Path("out")

vision = Vision(load_field("four_legged_2007"), load_camera(DATASET / "camera.toml"))

with (DATASET / "truth.csv").open(encoding="utf-8") as stream:
    rows = list(csv.DictReader(stream))[::8]
for row in rows:
    frame = cv2.imread(str(DATASET / "images" / row["image"]))
    assert frame is not None
    vision.forget()
    view = vision.look(frame)
    if not view.pose:
        print(f"{row['image']}  not located: {view.pose.reason}")
        continue
    pose, std = view.pose.pose, view.pose.std
    truth = Pose2(float(row["x_m"]), float(row["y_m"]), float(row["theta_rad"]))
    error_m, error_rad = pose.error_to(truth)
    print(f"{row['image']}  {pose.x_m:+.3f} m, {pose.y_m:+.3f} m (+- {std[0]:.3f}, {std[1]:.3f})", end="  ")
    print(f"off by {error_m:.3f} m and {math.degrees(error_rad):.1f} deg")

OUT.mkdir(exist_ok=True)
assert frame is not None
cv2.imwrite(str(OUT / "goal_pose.png"), draw(view, frame, vision))
print("overlay of the last picture:", OUT / "goal_pose.png")

"""A robot's loop with a page: open the address that it prints in a browser.

The camera is played by the sample images, ten times a second. On a robot, show each frame after `look`.
"""

import time
from pathlib import Path

import cv2

from field_models import load_field
from robocup_vision import MotionLimits, Steering, Vision, load_camera
from robocup_vision.live import Viewer

DATASET = Path(__file__).parents[1] / "images" / "omni_ssl_2001"
ROUNDS = 3


def main() -> None:
    """Show the sample images some times over."""
    vision = Vision(load_field("ssl_2001"), load_camera(DATASET / "camera.toml"))
    steering = Steering(
        robot_radius_m=0.09, limits=MotionLimits(speed_mps=0.4, acceleration_mps2=0.3, dead_time_s=0.03)
    )
    frames = [cv2.imread(str(path)) for path in sorted((DATASET / "images").glob("*.png"))]
    with Viewer(vision, port=0) as viewer:
        print("open", viewer.address)
        slowest_s = 0.0
        for number in range(ROUNDS * len(frames)):
            frame = frames[number % len(frames)]
            assert frame is not None
            view = vision.look(frame, t_s=number / 10)
            command = steering.steer(view.free_space, (0.0, 0.0), 0.0)
            begin_s = time.perf_counter()
            viewer.show(frame, view, command=(*command.velocity_mps, 0.0), reasons=[command.reason])
            slowest_s = max(slowest_s, time.perf_counter() - begin_s)
            time.sleep(0.1)
    print(f"{ROUNDS * len(frames)} frames shown; the slowest took {1e3 * slowest_s:.2f} ms of the loop's time")


if __name__ == "__main__":
    main()

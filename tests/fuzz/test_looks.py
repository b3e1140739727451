"""Frames, times, odometry and priors of wrong programs: `look` and `steer` answer, or raise an error of the family.

No other test hands over arguments that are wrong in several ways at once.
"""

from pathlib import Path

import cv2
import numpy as np
import pytest
from mutations import mutate_frame, strange_number, strange_pose

from field_models import load_field
from field_models.errors import RobocupVisionError
from robocup_vision import Memory, MotionLimits, PoseEstimate, Steering, Vision, draw, load_camera

IMAGES = Path(__file__).resolve().parents[2] / "images"
REAL = Path(__file__).resolve().parents[3] / "shared" / "real" / "negatives" / "images"
LIMITS = MotionLimits(speed_mps=0.4, acceleration_mps2=0.3, dead_time_s=0.03)
pytestmark = pytest.mark.slow


def frames_of(name, count):
    paths = sorted((IMAGES / name / "images").iterdir())[:count]
    return [np.asarray(cv2.imread(str(path), cv2.IMREAD_COLOR)) for path in paths]


def photographs(size_px):
    return [cv2.resize(cv2.imread(str(path)), size_px) for path in sorted(REAL.glob("*"))[:20]] if REAL.is_dir() else []


def some_prior(rng):
    pose = strange_pose(rng)
    if rng.random() < 0.5:
        return pose
    scale = float(rng.choice([0.0, 1e-12, 0.1, 1e6, np.nan]))
    return PoseEstimate(pose, scale * np.eye(3), 1.0, 0.0)


def look_and_steer(vision, steering, frame, t_s, rng):
    """Look once, with arguments of any kind, and use the view."""
    arguments = {}
    if rng.random() < 0.3:
        arguments["odometry"] = strange_pose(rng)
    if rng.random() < 0.2:
        arguments["prior"] = some_prior(rng)
    if rng.random() < 0.1:
        arguments["pan_rad"] = strange_number(rng)
    view = vision.look(frame, strange_number(rng) if rng.random() < 0.1 else t_s, **arguments)
    assert np.isfinite(view.free_space.range_m).all()
    if view.pose:
        assert np.isfinite(view.pose.pose.array).all()
        assert np.isfinite(view.pose.covariance).all()
    if isinstance(frame, np.ndarray) and rng.random() < 0.05:
        draw(view, frame, vision)
    velocity, bearing = (strange_number(rng), strange_number(rng)) if rng.random() < 0.1 else (0.2, 0.3)
    # a camera of unknown tilt sees no floor
    if len(view.free_space.range_m):
        steering.steer(view.free_space, (velocity, 0.0), bearing)


def drive(vision, frames, count, seed):
    """Look `count` times at mutated frames; return how many looks answered, and how many were refused."""
    rng = np.random.default_rng(seed)
    steering = Steering(robot_radius_m=0.09, limits=LIMITS)
    messages = []
    for index in range(count):
        frame = frames[int(rng.integers(len(frames)))]
        try:
            look_and_steer(vision, steering, frame if rng.random() < 0.2 else mutate_frame(frame, rng), index / 30, rng)
        except RobocupVisionError as error:
            messages.append(str(error))
        if rng.random() < 0.02:
            vision.forget()
    assert not [message for message in messages if "\n" in message]
    return count - len(messages), len(messages)


@pytest.mark.parametrize(
    ("folder", "field_name", "tilt_rad", "memory", "count"),
    [
        ("omni_ssl_2001", "ssl_2001", None, False, 300),
        ("omni_ssl_2001", "ssl_2001", None, True, 100),
        ("goal_four_legged", "four_legged_2007", None, False, 40),
        ("goal_four_legged", "four_legged_2007", -0.15, False, 60),
    ],
)
def test_looks_end_in_views_or_in_errors_of_the_family(folder, field_name, tilt_rad, memory, count):
    """Only this finds a look that a strange frame, prior or step ends with a traceback."""
    field, camera = load_field(field_name), load_camera(IMAGES / folder / "camera.toml")
    if tilt_rad is not None:
        camera = camera.with_orientation(0.0, tilt_rad, 0.0)
    vision = Vision(field, camera, memory=Memory.of_everything(field) if memory else None)
    frames = frames_of(folder, 20) + photographs(camera.size_px)
    answered, refused = drive(vision, frames, count, seed=18)
    assert answered > 0.4 * count
    assert refused > 0.1 * count


def test_what_is_constructed_of_anything_is_refused_in_one_line():
    """Only this finds an argument of `Vision` that is taken whatever it is."""
    rng = np.random.default_rng(4)
    field, camera = load_field("ssl_2001"), load_camera(IMAGES / "omni_ssl_2001" / "camera.toml")
    things = (
        field, camera, None, 3, "ssl_2001", "nowhere", np.zeros((220, 256), np.uint8), (0.1, 0.5), -1, 1e9, [], {},
        float("nan"),
    )  # fmt: skip
    names = ("method", "mask", "directions", "rings", "free_ratio", "memory", "channels")

    def thing():
        return things[int(rng.integers(len(things)))]

    for _ in range(300):
        given = {name: thing() for name in names if rng.random() < 0.5}
        # `online` is never right: a right line would make a whole Vision each time
        with pytest.raises(RobocupVisionError) as raised:
            Vision(thing(), thing(), thing(), online=3, **given)
        assert "\n" not in str(raised.value)

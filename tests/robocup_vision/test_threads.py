"""Several threads, each with its own `Vision` and `Steering`: every one gets what it would get alone."""

import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import cv2
import pytest

from field_models import load_field
from robocup_vision import Memory, MotionLimits, Pose2, Steering, Vision, load_camera

IMAGES = Path(__file__).parents[2] / "images"
LIMITS = MotionLimits(speed_mps=0.4, acceleration_mps2=0.3, dead_time_s=0.03)
STEP = Pose2(0.01, 0.002, 0.01)
THREADS = 4


@pytest.fixture
def hasty_switches():
    """Threads take turns a hundred times as often as usual: a shared buffer would be found in the other's hands."""
    usual = sys.getswitchinterval()
    sys.setswitchinterval(5e-5)
    yield
    sys.setswitchinterval(usual)


def sample_frames(name, count):
    return [cv2.imread(str(path)) for path in sorted((IMAGES / name / "images").iterdir())[:count]]


def answers(field, camera, frames, with_memory):
    """Everything that a robot's loop is told of frames, as plain values."""
    vision = Vision(field, camera, memory=Memory(field) if with_memory else None)
    steering = Steering(robot_radius_m=0.09, limits=LIMITS)
    told = []
    for index, frame in enumerate(frames):
        view = vision.look(frame, t_s=0.1 * index, odometry=STEP)
        pose = view.pose
        told.append((pose.pose, pose.covariance.tobytes(), pose.candidates) if pose else pose.reason)
        told.append((view.free_space.range_m.tobytes(), repr(view.balls), view.marks.tobytes()))
        belief = view.belief
        told.append(belief and [(one.pose, one.covariance.tobytes(), one.probability) for one in belief.hypotheses])
        if len(view.free_space.range_m) >= 3:
            command = steering.steer(view.free_space, (0.2, 0.1), target_bearing_rad=0.3)
            told.append((command.velocity_mps.tobytes(), command.time_to_contact_s.tobytes(), command.reason))
    return told


@pytest.mark.usefixtures("hasty_switches")
def test_four_mirror_cameras_in_four_threads_see_what_each_sees_alone():
    field, camera = load_field("ssl_2001"), load_camera(IMAGES / "omni_ssl_2001" / "camera.toml")
    frames = sample_frames("omni_ssl_2001", THREADS)
    # each begins with another frame, so that no two do the same at the same time
    orders = [[*frames[turn:], *frames[:turn]] for turn in range(THREADS)]
    expected = [answers(field, camera, order, with_memory=True) for order in orders]
    together = Barrier(THREADS)

    def run(order):
        together.wait(timeout=30)
        return answers(field, camera, order, with_memory=True)

    with ThreadPoolExecutor(THREADS) as pool:
        assert list(pool.map(run, orders)) == expected


@pytest.mark.usefixtures("hasty_switches")
def test_mirror_and_forward_cameras_work_side_by_side():
    robots = [("omni_ssl_2001", "ssl_2001"), ("goal_four_legged", "four_legged_2007")]
    tasks = [
        (load_field(field), load_camera(IMAGES / name / "camera.toml"), sample_frames(name, 1), False)
        for name, field in robots
    ]
    expected = [answers(*task) for task in tasks] * 2
    with ThreadPoolExecutor(THREADS) as pool:
        assert list(pool.map(lambda task: answers(*task), tasks * 2)) == expected

"""A robot on the small field: frames of the sample images, a `Vision`, and moments of them."""

from pathlib import Path

import cv2
import pytest

from field_models import load_field
from robocup_vision import Memory, Pose2, Vision, load_camera
from robocup_vision.live.handover.moment import Moment, RobotSetup
from robocup_vision.live.page.feed import Feed

DATASET = Path(__file__).parents[3] / "images" / "omni_ssl_2001"


@pytest.fixture(scope="session")
def dataset():
    return DATASET


@pytest.fixture(scope="session")
def frames():
    return [cv2.imread(str(path)) for path in sorted((DATASET / "images").glob("*.png"))[:4]]


@pytest.fixture
def vision():
    return Vision(load_field("ssl_2001"), load_camera(DATASET / "camera.toml"))


@pytest.fixture(scope="session")
def setup():
    field = load_field("ssl_2001")
    return RobotSetup("robot", field, load_camera(DATASET / "camera.toml"), field.robot_radius_m)


@pytest.fixture
def feed(setup):
    made = Feed()
    made.set_robots((setup,))
    yield made
    made.close()


@pytest.fixture
def moment(vision, frames):
    """Return a function that makes the moment of a time."""

    def make(t_s=0.0, robot="robot"):
        view = vision.look(frames[0], t_s)
        return Moment(robot, frames[0], t_s, view, colors=vision.colors, settings={"method": vision.method})

    return make


@pytest.fixture
def remembered(frames):
    """Return a moment with a belief: hypotheses, tracks and a map."""
    field = load_field("ssl_2001")
    looking = Vision(field, load_camera(DATASET / "camera.toml"), memory=Memory.of_everything(field))
    for number in range(3):
        view = looking.look(frames[0], t_s=number / 30, odometry=Pose2(0.0, 0.0, 0.0))
    return Moment("robot", frames[0], 2 / 30, view, colors=looking.colors, truth=Pose2(0.1, 0.2, 0.3))

"""The search over the whole field finds the pose that an outline was made from, without a guess that leads there."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from strategies import PAPER_MIRROR, numbers

from field_models import load_field
from robocup_vision.camera import OmniCamera
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.walls.fit import empty_prediction, predict_walls
from robocup_vision.localization.outline_model import OutlineModel
from robocup_vision.localization.outline_search import FINE_SCALES, OutlineSearch
from robocup_vision.perception.polar_view import PolarView

CAMERA = OmniCamera((256, 220), (127.5, 109.5), (26.0, 112.0), PAPER_MIRROR)
MODEL = OutlineModel(load_field("ssl_2001"), CAMERA, PolarView(CAMERA))
SEARCH = OutlineSearch(MODEL)
places = st.builds(Pose2, numbers(-1.25, 1.25), numbers(-0.65, 0.65), numbers(-3.1, 3.1))


@given(places, st.integers(0, 2**32 - 1))
def test_an_outline_is_found_from_the_middle_of_the_field(pose, seed):
    prediction = empty_prediction(MODEL.scene)
    predict_walls(pose.array, MODEL.scene, prediction)
    noise = np.random.default_rng(seed).normal(0.0, 0.1, len(prediction.q))
    radius_px = np.where(prediction.wall < 0, np.nan, PAPER_MIRROR.radius_px(prediction.q) + noise)
    middle = MODEL.fit((0.0, 0.0, 0.0), radius_px, MODEL.scales(FINE_SCALES))[0]
    found = SEARCH.candidates(middle, radius_px)
    errors = [Pose2(*one.pose).error_to(pose, symmetric=True) for one in found]
    assert any(off_m < 0.01 and off_rad < 0.01 for off_m, off_rad in errors)

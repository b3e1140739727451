"""A frame as goals are searched in it: each part is made once, and a bent lens is straightened before edges are."""

from dataclasses import replace

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.localization.goal.search import GoalSearch
from sim2d.rendering.goal.scenes import GOAL_CONDITIONS, sample_goal

FIELD = load_field("four_legged_2007")
CLEAN = GOAL_CONDITIONS["clean_416x320"]


@pytest.fixture(scope="module")
def sample():
    return next(sample_goal(FIELD, CLEAN, 11, 1, supersample=2))


def test_parts_are_made_once_and_reduced_as_the_search_says(sample):
    picture = GoalSearch(FIELD, CLEAN.camera).picture(sample.frame)
    assert picture.factor == 2
    assert picture.small.shape == (160, 208, 3)
    assert picture.masks is picture.masks
    assert set(picture.masks.paint) == {"cyan", "yellow", "white"}
    assert picture.evidence("cyan") is picture.evidence("cyan")


def test_only_a_bent_lens_is_straightened(sample):
    plain = GoalSearch(FIELD, CLEAN.camera).picture(sample.frame)
    assert plain.straight is sample.frame
    assert plain.straight_masks is plain.masks
    bent = GoalSearch(FIELD, replace(CLEAN.camera, distortion=(-0.2, 0.0, 0.0, 0.0))).picture(sample.frame)
    assert not np.array_equal(bent.straight, sample.frame)


def test_the_whole_picture_speaks_for_the_true_camera_alone(sample):
    search = GoalSearch(FIELD, CLEAN.camera)
    picture = search.picture(sample.frame)
    found = search.candidates(picture)[0][0]
    true = search.nats(picture, found, found.fit.unknowns)
    for at, off in ((0, 0.3), (1, 0.3), (2, 0.1), (3, 0.1)):
        other = found.fit.unknowns.copy()
        other[at] += off
        assert search.nats(picture, found, other) < true - 50.0
    behind = found.fit.unknowns.copy()
    behind[2] += np.pi
    assert search.nats(picture, found, behind) == -np.inf


def test_paint_may_be_washed_white_but_has_no_more_of_another_colour(sample):
    search = GoalSearch(FIELD, CLEAN.camera)
    frame = np.full((320, 416, 3), (40, 120, 40), np.uint8)
    shades = {"cyan": (200, 160, 20), "white": (250, 250, 250), "orange": (20, 120, 240), "dark": (20, 20, 20)}
    for k, bgr in enumerate(shades.values()):
        frame[20:60, 100 * k + 10 : 100 * k + 90] = bgr
    mask = search.picture(frame).washable("cyan")
    assert [bool(mask[20, 50 * k + 25]) for k in range(4)] == [True, True, False, False]
    found = search.candidates(search.picture(sample.frame))[0][0]
    assert search.washable(search.picture(sample.frame), found.sides, found.fit.unknowns).min() > 0.9

"""Cameras proposed by silhouettes: the true one is among them where lamps wash the goal, also behind a bent lens."""

import math
from dataclasses import replace

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.geometry import Pose2
from robocup_vision.localization.goal.geometry import HEADING, TILT
from robocup_vision.localization.goal.search import GoalSearch
from robocup_vision.localization.goal.silhouettes import SilhouetteSearch
from robocup_vision.perception.goal_region import carpet_mask, hue_masks
from sim2d.match.setups import camera_for
from sim2d.rendering.goal.scenes import GOAL_CONDITIONS, paper_places, sample_goal
from sim2d.rendering.pinhole import render_pinhole
from sim2d.rendering.scene import Scene
from sim2d.sensors.match_camera import MATCH_LIGHT, MATCH_ROOM, MATCH_SENSOR

FIELD = load_field("four_legged_2007")
STREAKS = GOAL_CONDITIONS["streaks_416x320"]


def searched(camera):
    search = GoalSearch(FIELD, camera)
    return search, SilhouetteSearch(search.colored_model, camera, search.extent_m)


def proposed(search, silhouettes, frame):
    picture = silhouettes.picture(frame)
    masks = hue_masks(picture, search.families)
    carpet = carpet_mask(picture, np.bitwise_or.reduce(list(masks.values())))
    gradients = silhouettes.gradients(picture)
    found = [one for mask in masks.values() for one in silhouettes.propose(gradients, mask, carpet)]
    return [unknowns for _, unknowns in sorted(found, key=lambda one: -one[0])]


def is_near(unknowns, pose, goal_m):
    """Whether a fit may begin there: a tenth of the distance off, and two degrees."""
    away = math.dist(goal_m, (pose.x_m, pose.y_m))
    off = math.dist(unknowns[:2], (pose.x_m, pose.y_m))
    return off < max(0.15 * away, 0.15) and abs(math.remainder(unknowns[HEADING] - pose.theta_rad, math.tau)) < 0.1


@pytest.mark.slow
def test_the_true_camera_is_among_those_proposed_for_a_washed_goal():
    """Only this finds proposals that the search's other stages make up for."""
    search, silhouettes = searched(STREAKS.camera)
    indices = [1, 9, 17, 25, 33, 41, 49, 57]
    shots = list(sample_goal(FIELD, STREAKS, 905, 66, places=paper_places(FIELD), indices=indices, supersample=2))
    goal = (search.shape.line_x_m, 0.0)
    near = [
        any(is_near(unknowns, shot.pose, goal) for unknowns in proposed(search, silhouettes, shot.frame))
        for shot in shots
    ]
    assert len(near) == len(indices)
    assert sum(near) >= len(indices) - 1


@pytest.mark.parametrize("distortion", [(), (-0.25, 0.08, 0.0, 0.0)])
def test_a_bent_lens_is_straightened_first(distortion):
    camera = replace(camera_for(FIELD), distortion=distortion)
    search, silhouettes = searched(camera)
    pose = Pose2(1.3, -0.5, math.atan2(0.5, 1.4) - 0.1)
    scene = Scene(FIELD, (), (), None, MATCH_LIGHT, MATCH_ROOM, 0.5)
    frame = MATCH_SENSOR.expose(render_pinhole(camera, scene, pose, supersample=2), np.random.default_rng(3))
    goal = (search.shape.line_x_m, 0.0)
    first = proposed(search, silhouettes, frame)[:3]
    assert any(is_near(unknowns, pose, goal) for unknowns in first)
    tilts = [unknowns[TILT] for unknowns in first if is_near(unknowns, pose, goal)]
    assert min(abs(tilt - camera.tilt_rad) for tilt in tilts) < 0.04


def test_a_picture_without_edges_or_paint_proposes_nothing_that_fits():
    search, silhouettes = searched(STREAKS.camera)
    frame = np.full((320, 416, 3), (40, 120, 40), np.uint8)
    assert all(
        nats < 0 for nats, _ in silhouettes.propose(silhouettes.gradients(frame), *np.zeros((2, 320, 416), np.uint8))
    )
    candidates, reason = search.candidates(search.picture(frame))
    assert candidates == []
    assert reason.startswith("no goal")

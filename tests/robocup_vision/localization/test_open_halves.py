"""Law of the field's halves: a frame that does not tell them apart names none, whatever camera, prior and memory."""

import math
from dataclasses import replace

import numpy as np
import pytest

from field_models import field_names, load_field
from field_models.errors import ArgumentError
from robocup_vision.camera import OmniCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.field_half import in_both_halves
from robocup_vision.localization.filter.errors import FORWARD_FRAME_ERRORS, FrameErrors
from robocup_vision.localization.filter.pose_filter import PoseFilter
from robocup_vision.localization.model_edges.field_edges import field_edges, telling_features
from robocup_vision.memory import Memory
from robocup_vision.vision import Vision
from sim2d.match.setups import CAMERAS
from sim2d.rendering.mirror import MirrorRenderer
from sim2d.rendering.pinhole import render_pinhole
from sim2d.rendering.scene import Room, Scene
from sim2d.rendering.sensor import Sensor

SYMMETRIC = [name for name in field_names() if not load_field(name).halves_differ]
STILL = Pose2(0.0, 0.0, 0.0)
SMALL = np.diag([0.01, 0.01, 0.01]) ** 2


def take(field, camera, pose):
    scene = Scene(field, room=Room(seed=3), carpet_margin_m=0.2)
    is_mirror = isinstance(camera, OmniCamera)
    light = MirrorRenderer(camera).render(scene, pose) if is_mirror else render_pinhole(camera, scene, pose)
    return Sensor(noise_sigma=3.0, blur_px=0.6).expose(light, np.random.default_rng(3))


def probabilities(belief):
    return [hypothesis.probability for hypothesis in belief]


@pytest.mark.parametrize("name", ["msl_6x4", "spl_2020"])
@pytest.mark.parametrize("errors", [FrameErrors(), FORWARD_FRAME_ERRORS])
def test_a_hundred_frames_of_either_half_leave_both_equally_probable(name, errors):
    rng, field = np.random.default_rng(7), load_field(name)
    filter_ = PoseFilter(frames=errors, field=field)
    truth = Pose2(0.3 * field.length_m, -0.2 * field.width_m, 2.0)
    for k in range(100):
        step = Pose2(0.02, 0.0, rng.normal(0.0, 0.1))
        truth = truth.compose(step)
        filter_.predict(step, 0.04 * k)
        seen = Pose2(*(truth.array + rng.normal(0.0, 0.01, 3)))
        near = filter_.prior(0.04 * k)
        filter_.update(in_both_halves(PoseEstimate(seen, SMALL, 1.0, 0.2), near), 0.04 * k)
        p = probabilities(filter_.hypotheses)
        assert p[::2] == pytest.approx(p[1::2], abs=1e-9)
        assert p[0] > 0.45
    assert len(filter_.belief.candidates) == 2
    assert filter_.belief.pose.error_to(truth, symmetric=True)[0] < 0.05


@pytest.mark.parametrize(
    ("name", "camera_name", "method"),
    [
        ("spl_2020", "nao", None),
        ("ssl_division_b", "ssl_forward", None),
        pytest.param("ssl_division_b", "ssl_forward", "field", marks=pytest.mark.slow),
        pytest.param("ssl_division_b", "ssl_forward", "floor", marks=pytest.mark.slow),
        pytest.param("spl_2020", "nao", "goal", marks=pytest.mark.slow),
        pytest.param("msl_6x4", "msl_mirror", None, marks=pytest.mark.slow),
    ],
)
def test_frames_followed_through_a_memory_name_no_half(name, camera_name, method):
    """The slow cases alone find floor, goal or mirror that lets a half creep in, frame by frame."""
    field, camera = load_field(name), CAMERAS[camera_name]()
    truth = Pose2(0.3 * field.length_m, 0.12 * field.width_m, -0.35)
    frame, memory = take(field, camera, truth), Memory(field)
    vision = Vision(field, camera, method=method, memory=memory)
    # these methods need a prior at first
    prior = truth if method else None
    for k in range(4):
        view = vision.look(frame, 0.05 * k, odometry=STILL if k else None, prior=prior)
        prior = None
        assert view.pose
        for estimate in (view.pose, view.measurement or view.pose):
            best, turned, *_ = estimate.candidates
            assert best.error_to(truth, symmetric=True)[0] < 0.15
            assert turned.error_to(best.half_turn()) == pytest.approx((0.0, 0.0), abs=1e-9)
        assert probabilities(view.belief.hypotheses)[:2] == pytest.approx([0.5, 0.5], abs=0.01)
    # a prior orders the two, and is no evidence
    for near in (truth, truth.half_turn()):
        told = vision.look(frame, 1.0, prior=near)
        assert told.pose.pose.error_to(near)[0] < 0.15
        assert told.pose.candidates[1].error_to(near.half_turn())[0] < 0.15
        assert told.measurement is None or told.measurement.pose.error_to(near)[0] < 0.15
        assert probabilities(told.belief.hypotheses)[:2] == pytest.approx([0.5, 0.5], abs=0.01)


def test_where_colours_differ_a_frame_tells_the_half_by_what_it_shows():
    field, camera = load_field("four_legged_2007"), CAMERAS["nao"]()
    camera = replace(camera, height_m=0.185, tilt_rad=-0.17)
    vision = Vision(field, camera)
    before_goal, aside = Pose2(-1.2, -0.3, math.pi - 0.1), Pose2(0.1, -0.9, -1.3)
    for truth, candidates in ((before_goal, 1), (aside, 2)):
        frame = take(field, camera, truth)
        vision.forget()
        for _ in range(2):
            # by a bare prior and followed
            view = vision.look(frame, prior=truth)
            assert view.pose.pose.error_to(truth)[0] < 0.1
            assert len(view.pose.candidates) == len(view.measurement.candidates) == candidates


def test_the_edges_that_tell_the_half_are_those_of_colours_that_the_other_half_has_not():
    assert not any(telling_features(field_edges(load_field(name))).any() for name in SYMMETRIC)
    field = load_field("four_legged_2007")
    edges = field_edges(field)
    tells = telling_features(edges)
    assert not tells[edges.segments[:, 11].astype(int)].any()
    assert tells[edges.bars[:, 6].astype(int)].all()
    # white and pink bands stand at both ends, at other heights
    colors = {name: (foot, top) for b in field.beacons for name, foot, top in _bands(b)}
    assert len(colors) == 4
    one_color = replace(field, goals=tuple(replace(goal, color="yellow") for goal in field.goals), beacons=())
    assert not telling_features(field_edges(one_color)).any()
    assert not one_color.halves_differ


def _bands(beacon):
    band = beacon.height_m / len(beacon.colors)
    return [(name, k * band, (k + 1) * band) for k, name in enumerate(beacon.colors)]


def test_a_line_or_a_goal_in_one_half_only_tells_the_half():
    field = load_field("spl_2020")
    assert not field.shows_half
    assert replace(field, goals=field.goals[:1]).shows_half
    wide = replace(field.goals[0], width_m=2 * field.goals[0].width_m)
    assert replace(field, goals=(wide, field.goals[1])).shows_half
    lines = np.vstack([field.lines, [[1.0, 0.5, 2.0, 0.5]]])
    assert replace(field, lines=lines).shows_half
    assert not replace(field, lines=np.vstack([lines, [[-2.0, -0.5, -1.0, -0.5]]])).shows_half
    assert telling_features(field_edges(replace(field, lines=lines))).sum() == 2


@pytest.mark.parametrize("x_m", [-2.0, 2.0])
def test_a_robot_known_to_begin_in_its_own_half_is_there(x_m):
    field = load_field("spl_2020")
    memory = Memory(field, half="own")
    pose = Pose2(x_m, 0.4, 0.3)
    for _ in range(2):
        memory.poses.update(in_both_halves(PoseEstimate(pose, SMALL, 1.0, 0.2)), 0.0)
        best = memory.poses.hypotheses[0]
        assert best.pose.x_m == pytest.approx(-2.0)
        assert best.probability > 0.999
        # and again after all is forgotten
        memory.forget()
    assert Memory.of_everything(field, half="own").poses.half == "own"


def test_on_the_centre_line_the_own_half_is_as_probable_as_the_error_of_the_position_leaves_it():
    filter_ = PoseFilter(half="own")
    filter_.update(in_both_halves(PoseEstimate(Pose2(-0.01, 0.4, 0.3), SMALL, 1.0, 0.2)), 0.0)
    best, other = filter_.hypotheses
    # one standard deviation
    assert (best.probability, other.probability) == pytest.approx((0.8413, 0.1587), abs=1e-3)
    # what comes later is told by frames and odometry alone
    filter_.predict(STILL, 0.0)
    for k in range(1, 20):
        filter_.predict(Pose2(0.1, 0.0, 0.0), 0.1 * k)
        filter_.update(NotLocated("dark"), 0.1 * k)
    assert filter_.hypotheses[0].probability == pytest.approx(0.8413, abs=1e-3)


def test_a_half_that_is_none_is_refused():
    with pytest.raises(
        ArgumentError, match="half must be 'own', for a robot that begins at x < 0, or None, got 'left'"
    ):
        Memory("spl_2020", half="left")
    with pytest.raises(ArgumentError, match="leave out poses or half"):
        Memory("spl_2020", half="own", poses=PoseFilter())

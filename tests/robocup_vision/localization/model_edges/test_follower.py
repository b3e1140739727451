"""Followed frames: right priors refined, wrong ones refused, and what evidence weighs."""

import math

import numpy as np
import pytest

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.kernels.model_edges.follow import MODES
from robocup_vision.localization.model_edges.field_edges import field_edges
from robocup_vision.localization.model_edges.follower import EdgeFollower

STD = np.array([0.05, 0.05, math.radians(2.0)])


def near(pose, off=(0.0, 0.0, 0.0), std=STD):
    return PoseEstimate(Pose2(*(pose.array + off)), np.diag(std**2), 1.0, 0.0)


@pytest.mark.parametrize("shot_name", ["fl_shot", "spl_shot"])
@pytest.mark.parametrize("off", [(0.04, -0.03, 0.03), (-0.03, 0.04, -0.02)])
def test_a_prior_is_refined_with_tilt(shot_name, off, request):
    shot = request.getfixturevalue(shot_name)
    follower = EdgeFollower(shot.field, shot.camera)
    answer = follower.follow(shot.frame, near(shot.pose, off))
    assert answer
    away, turn = answer.estimate.pose.error_to(shot.pose)
    assert away < 0.03
    assert turn < math.radians(1.0)
    nod = 0.017 if shot_name == "fl_shot" else -0.012
    assert answer.as_fitted(shot.camera).tilt_rad - shot.camera.tilt_rad == pytest.approx(nod, abs=0.004)
    error = answer.estimate.pose.array - shot.pose.array
    assert error @ np.linalg.solve(answer.estimate.covariance, error) < 16.0
    assert answer.evidence.found_ratio > 0.7
    assert answer.evidence.explained > 0.7 * answer.evidence.points
    # the next frame begins with the nod just seen
    again = follower.follow(shot.frame, PoseEstimate(shot.pose, np.diag(STD**2), 1.0, 0.0), 0.001)
    assert again.evidence.prior_distance2 < answer.evidence.prior_distance2


@pytest.mark.parametrize("shot_name", ["fl_shot", "spl_shot"])
def test_a_prior_far_off_converges(shot_name, request):
    shot, good = request.getfixturevalue(shot_name), 0
    std = np.array([0.10, 0.10, math.radians(6.0)])
    follower = EdgeFollower(shot.field, shot.camera)
    for direction in np.arange(8) * math.tau / 8:
        for sense in (-1.0, 1.0):
            follower.forget()
            off = 0.10 * math.cos(direction), 0.10 * math.sin(direction), sense * math.radians(6.0)
            answer = follower.follow(shot.frame, near(shot.pose, off, std))
            away, turn = answer.estimate.pose.error_to(shot.pose) if answer else (1.0, 1.0)
            good += away < 0.05 and turn < math.radians(2.0)
    assert good >= 15


def test_a_fit_is_as_sure_where_other_modes_were_looked_at_in_vain(take_shot):
    shot, rng, same = take_shot("four_legged_2007", Pose2(-1.19, -0.33, -1.22)), np.random.default_rng(8), 0
    follower = EdgeFollower(shot.field, shot.camera)
    for _ in range(100):
        prior = near(shot.pose, 3.0 * STD * rng.standard_normal(3))
        alone, among = (follower_after(follower, shot, prior, modes) for modes in (1, MODES))
        if alone[0] == among[0]:
            same += 1
            np.testing.assert_allclose(among[1].information, alone[1].information)
    assert same > 20


def follower_after(follower, shot, prior, modes):
    """Return the pose that a follower fits, accepted or not, and its likelihood."""
    follower.forget()
    follower.follow(shot.frame, prior, modes=modes)
    return follower.pose, follower.likelihood_under(np.array([0.02, 0.02, 0.006, 0.01]))


def test_prior_times_likelihood_is_the_posterior(fl_shot):
    prior = near(fl_shot.pose, (0.02, 0.02, -0.01))
    answer = EdgeFollower(fl_shot.field, fl_shot.camera).follow(fl_shot.frame, prior)
    assert answer
    joined = np.linalg.inv(prior.covariance) + answer.likelihood.information
    np.testing.assert_allclose(np.linalg.inv(joined), answer.estimate.covariance, rtol=1e-4, atol=1e-9)
    # at the posterior's mean the likelihood pulls as the prior pulls back
    off = answer.estimate.pose.array - prior.pose.array
    off[2] = wrap_angle(off[2])
    pull = answer.likelihood.gradient - np.linalg.solve(prior.covariance, off)
    # what is left after the last step is a small part of the posterior's deviation
    assert math.sqrt(pull @ answer.estimate.covariance @ pull) < 0.1
    # what the frame says alone does not depend much on how sure the prior was
    other = EdgeFollower(fl_shot.field, fl_shot.camera).follow(fl_shot.frame, near(fl_shot.pose, std=4 * STD))
    assert other
    away, turn = answer.measurement.pose.error_to(other.measurement.pose)
    assert away < 0.02
    assert turn < math.radians(0.5)
    assert np.all(np.linalg.eigvalsh(answer.measurement.covariance) > 0)
    assert answer.measurement.std[0] >= answer.estimate.std[0]
    assert answer.measured_pose == answer.measurement.pose


def test_what_a_blank_frame_leaves_is_not_located(fl_shot):
    follower = EdgeFollower(fl_shot.field, fl_shot.camera)
    for level in (0, 90, 255):
        answer = follower.follow(np.full_like(fl_shot.frame, level), near(fl_shot.pose))
        assert isinstance(answer, NotLocated)
        assert not answer
    carpet = np.full_like(fl_shot.frame, 0) + np.array([50, 130, 45], dtype=np.uint8)
    assert not follower.follow(carpet, near(fl_shot.pose))


def test_wrong_priors_are_refused(fl_shot, spl_shot):
    for shot in (fl_shot, spl_shot):
        follower, accepted = EdgeFollower(shot.field, shot.camera), 0
        for angle in np.linspace(0.0, math.tau, 12, endpoint=False):
            off = (0.7 * math.cos(angle), 0.7 * math.sin(angle), 0.05)
            follower.forget()
            answer = follower.follow(shot.frame, near(shot.pose, off), 1.0)
            accepted += bool(answer) and answer.estimate.pose.error_to(shot.pose)[0] > 0.1
        assert accepted <= 1


def test_a_prior_without_a_covariance_is_refused(fl_shot):
    follower = EdgeFollower(fl_shot.field, fl_shot.camera)
    with pytest.raises(ArgumentError, match="not positive definite"):
        follower.follow(fl_shot.frame, PoseEstimate(fl_shot.pose, np.zeros((3, 3)), 1.0, 0.0))


def test_a_hidden_view_is_followed_on(fl_shot):
    follower = EdgeFollower(fl_shot.field, fl_shot.camera)
    # a robot that stands close before the camera leaves a strip of the picture
    hidden = fl_shot.frame.copy()
    hidden[40:, 60:] = (30, 30, 34)
    alone = follower.follow(hidden, near(fl_shot.pose))
    follower.forget()
    assert follower.follow(fl_shot.frame, near(fl_shot.pose))
    followed = follower.follow(hidden, near(fl_shot.pose))
    assert followed or not alone


@pytest.mark.parametrize(
    "name", ["four_legged_2007", "spl_2020", "ssl_2001", "ssl_division_b", "msl_6x4", "four_legged_2005"]
)
def test_every_field_has_its_edges(name):
    field = load_field(name)
    edges = field_edges(field)
    on_floor = edges.segments[edges.segments[:, 13] > 0]
    assert len(on_floor) == len(field.lines)
    np.testing.assert_allclose(on_floor[:, [0, 1, 3, 4]], field.lines)
    np.testing.assert_allclose(np.hypot(on_floor[:, 6], on_floor[:, 7]), 1.0)
    assert (len(edges.segments) > len(on_floor)) == (
        field.is_bounded or any(goal.kind == "panels" for goal in field.goals)
    )
    assert len(edges.bars) == sum(goal.kind == "posts" for goal in field.goals)
    assert len(edges.cylinders) == 2 * len(edges.bars) + sum(len(b.colors) for b in field.beacons)
    assert len(edges.corners) == 4 * sum(goal.kind == "panels" for goal in field.goals)
    parts = (edges.segments[:, 11], edges.cylinders[:, 6], edges.corners[:, 5], edges.bars[:, 6], edges.rings[:, 6])
    features = np.concatenate(parts)
    assert len(np.unique(features)) == len(features)
    assert edges.channels[0, 3] > 100
    assert np.all(edges.channels[:, 3] > 0)
    assert len(edges.silent) == sum(goal.net is not None for goal in field.goals)
    # the floor around it, in four parts
    assert len(field_edges(field, 0.3).silent) == len(edges.silent) + 4

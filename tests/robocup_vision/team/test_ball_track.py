"""A robot's own ball over time: far sightings average out, kicks and single wrong sightings are told apart."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robocup_vision.team.ball_track import BallTrack

SURE = 1e-4 * np.eye(2)
FRAME_S = 1 / 30


def track_of(places, covariance=SURE, start_s=0.0):
    track = BallTrack()
    for k, place in enumerate(places):
        track.update(place, covariance, start_s + k * FRAME_S)
    return track


def test_before_any_sighting_there_is_none_and_after_it_is_forgotten():
    track = BallTrack()
    assert track.sighting is None
    track.update((0.5, 0.2), SURE, 1.0)
    assert (track.sighting.x_m, track.sighting.t_s) == (0.5, 1.0)
    track.forget()
    assert track.sighting is None


def test_a_rolling_ball_has_its_place_and_velocity():
    sighting = track_of([(0.03 * k, -0.01 * k) for k in range(40)]).sighting
    assert (sighting.x_m, sighting.y_m) == pytest.approx((1.17, -0.39), abs=0.02)
    assert (sighting.vx_mps, sighting.vy_mps) == pytest.approx((0.9, -0.3), abs=0.1)
    # less than that of a new track
    assert 0.0 < sighting.velocity_std_mps < 0.5


def test_the_errors_of_a_nodding_camera_average_out_and_are_stated():
    # half a second of nodding by which a far ball comes nearer and goes farther, correlated from frame to frame
    covariance, squared = np.diag([0.3**2, 0.02**2]), []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        phase = rng.uniform(0.0, math.tau)
        nods = 0.3 * math.sqrt(2) * np.sin(math.tau * 1.7 * FRAME_S * np.arange(60) + phase)
        places = [(1.0 + nod, 0.5 + 0.02 * rng.standard_normal()) for nod in nods]
        sighting = track_of(places, covariance).sighting
        error = np.array([sighting.x_m - 1.0, sighting.y_m - 0.5])
        squared.append(float(error @ np.linalg.solve(sighting.covariance, error)))
        assert abs(error[0]) < 0.3
    assert np.mean(squared) < 3.0


def test_one_wrong_sighting_is_left_out_and_a_second_one_is_believed():
    track = track_of([(0.5, 0.0)] * 10)
    track.update((-1.5, 0.0), SURE, 10 * FRAME_S)
    assert track.sighting.x_m == pytest.approx(0.5, abs=0.01)
    track.update((0.5, 0.0), SURE, 11 * FRAME_S)
    track.update((-1.5, 0.0), SURE, 12 * FRAME_S)
    assert track.sighting.x_m == pytest.approx(0.5, abs=0.01)
    track.update((-1.4, 0.0), SURE, 13 * FRAME_S)
    assert track.sighting.x_m == -1.4
    assert track.sighting.vx_mps == 0.0


def test_after_a_gap_it_begins_anew_and_older_sightings_change_nothing():
    track = track_of([(0.02 * k, 0.0) for k in range(20)])
    track.update((0.0, 1.0), SURE, 5.0)
    assert (track.sighting.x_m, track.sighting.y_m, track.sighting.vx_mps) == (0.0, 1.0, 0.0)
    track.update((0.5, 0.5), SURE, 4.9)
    assert track.sighting.t_s == 5.0


def test_the_covariance_stays_positive_for_a_ball_that_is_seen_for_long():
    track = track_of([(0.1, 0.1)] * 300, np.diag([1e-8, 1e-2]))
    assert np.linalg.eigvalsh(track.sighting.covariance)[0] > 0.0


def test_the_covariance_stays_symmetric_where_it_is_large():
    track, ray = BallTrack(), np.array([0.6, 0.8])
    for k in range(200):
        range_m = 4.0 + 2.0 * math.sin(0.3 * k)
        track.update(tuple((range_m * ray).tolist()), 40.0 * np.outer(ray, ray) + SURE, k * FRAME_S)
    covariance = track.sighting.covariance
    np.testing.assert_array_equal(covariance, covariance.T)


def test_a_covariance_that_is_symmetric_but_for_rounding_can_be_told():
    track = BallTrack()
    for t_s in (1.0, 1.03, 9.0):
        track.update((0.4, 0.1), np.array([[1e-3, 2e-4 * (1 + 1e-9)], [2e-4, 1e-3]]), t_s)
        covariance = track.sighting.covariance
        assert np.array_equal(covariance, covariance.T)

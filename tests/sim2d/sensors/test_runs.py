"""Sensor runs: same seed, same run; reflections, movers and truth are what they say; the command that learns."""

import argparse
import dataclasses

import numpy as np
import pytest

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.mapping.occupancy import FreeSpaceMap
from robocup_vision.mapping.sensor_model import load_sensors
from sim2d.commands.sensors import add_parser, run_sensors
from sim2d.rendering.cameras import sekimori_camera
from sim2d.sensors.runs import KINDS, map_vision, sensor_run

FIELD, CAMERA = load_field("ssl_2001"), sekimori_camera()


@pytest.fixture(scope="module")
def vision():
    return map_vision(FIELD, CAMERA)


def drive(kind, vision, seed=4, frames=8):
    return list(sensor_run(FIELD, CAMERA, KINDS[kind], np.random.default_rng(seed), frames=frames, vision=vision))


def test_the_same_seed_drives_the_same_run(vision):
    first, second = drive("movers", vision), drive("movers", vision)
    for a, b in zip(first, second, strict=True):
        assert a.pose == b.pose
        np.testing.assert_array_equal(a.floor.range_m, b.floor.range_m)
        np.testing.assert_array_equal(a.scan.range_m, b.scan.range_m)
        np.testing.assert_array_equal(a.movers_m, b.movers_m)


def test_the_robot_drives_clear_of_everything_and_knows_where_it_is(vision):
    frames = drive("glare", vision, frames=15)
    for frame in frames:
        assert frame.scene.clearance_m(frame.pose.x_m, frame.pose.y_m) > FIELD.robot_radius_m
        assert frame.estimated is not None
        assert frame.pose.error_to(frame.estimated)[0] < 0.03
    assert np.diff([frame.t_s for frame in frames]) == pytest.approx(0.1)
    assert np.hypot(*(frames[-1].pose.array - frames[0].pose.array)[:2]) > 0.1


def test_reflections_move_with_the_viewpoint_and_sun_patches_do_not(vision):
    first, *_, last = drive("glare", vision, frames=12)
    sun, *lamps = first.scene.light.highlights
    assert last.scene.light.highlights[0] == sun
    way = (last.pose.array - first.pose.array)[:2]
    for before, after in zip(lamps, last.scene.light.highlights[1:], strict=True):
        moved = np.array([after.x_m - before.x_m, after.y_m - before.y_m])
        # the lamp hangs higher than the viewpoint by far: nearly all the way
        np.testing.assert_allclose(moved, way * 2.5 / (2.5 + CAMERA.height_m), atol=1e-9)


def test_movers_move_and_are_seen(vision):
    first, *_, last = drive("movers", vision, frames=12)
    assert first.movers_m.shape == (2, 3)
    assert (np.hypot(*(last.movers_m - first.movers_m).T[:2]) > 0.1).all()
    alone = dataclasses.replace(last.scene, robots=())
    met = last.scan.hit & (last.scan.range_m < alone.free_range_m(last.pose, last.scan.bearing_rad, 0.08) - 0.05)
    direction = last.pose.theta_rad + last.scan.bearing_rad[met]
    ends = last.scan.range_m[met, None] * np.stack([np.cos(direction), np.sin(direction)], axis=1)
    ends += (last.pose.x_m, last.pose.y_m)
    gap = np.linalg.norm(ends[:, None] - last.movers_m[:, :2], axis=-1) - last.movers_m[:, 2]
    assert met.any()
    assert (gap.min(axis=1) < 0.05).all()


@pytest.mark.slow
def test_a_field_without_room_is_refused(vision):
    """Only this finds a search for room that never ends."""
    crowd = dataclasses.replace(KINDS["plain"], boxes=80)
    with pytest.raises(ArgumentError, match="has no room for all that shall stand on it"):
        next(sensor_run(FIELD, CAMERA, crowd, np.random.default_rng(0), frames=1, vision=vision))


def learn(*words):
    parser = argparse.ArgumentParser()
    add_parser(parser.add_subparsers())
    return run_sensors(parser.parse_args(["sensors", "learn", *map(str, words)]))


def test_the_command_writes_what_a_map_reads(tmp_path, capsys):
    out = tmp_path / "sensors.toml"
    assert learn("--out", out, "--runs", 1, "--frames", 3, "--seed", 2) == 0
    printed = capsys.readouterr().out
    assert "floor: has hits in" in printed
    assert "learnt from 4 runs" in printed
    models = load_sensors(out)
    assert FreeSpaceMap(models).sensors == models
    assert models["floor"].reach_m == pytest.approx(1.11)
    assert models["range"].reach_m == pytest.approx(0.04 * 240 / (2 * np.pi), abs=1e-3)
    assert "sensors learn --field ssl_2001" in out.read_text()

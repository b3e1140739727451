"""Pictures of a goal: what each promises to show, that each repeats, and the command that writes them."""

from __future__ import annotations

import argparse
import csv
import dataclasses
import math
import shlex
from pathlib import Path

import cv2
import numpy as np
import pytest

from field_models import load_field
from field_models.errors import ArgumentError
from field_models.toml_file import read_toml
from robocup_vision.camera import PinholeCamera, load_camera
from sim2d.commands.render_goal import GOAL_CONDITION_NAMES, add_parser, run_render_goal
from sim2d.rendering.goal.scenes import (
    GOAL_CONDITIONS,
    NEGATIVE_VIEWS,
    GoalSample,
    ers7_camera,
    paper_places,
    sample_goal,
)
from sim2d.rendering.goal.surroundings import Glare, goal_outline, lamp_glare
from sim2d.rendering.pinhole import render_pinhole
from sim2d.rendering.scene import Scene

DOGS, NAOS = load_field("four_legged_2007"), load_field("spl_2020")
TINY = {
    name: dataclasses.replace(GOAL_CONDITIONS[f"{name}_416x320"], camera=ers7_camera(104, 80))
    for name in ("clean", "mild_glare", "heavy_glare")
}


# for those that ask only where things are: the hall's wall is the dearest part of so small a picture
PLAIN = dataclasses.replace(TINY["clean"], backdrop="plain")


def outline_pixels(sample: GoalSample) -> np.ndarray:
    """(2, N, 2): pixels around the feet and tops of the post at negative and at positive y."""
    outline = goal_outline(sample.goal)
    flat = sample.pose.inverse().transform(outline[:, :2])
    return sample.camera.point_to_pixel(np.column_stack([flat, outline[:, 2]])).reshape(2, -1, 2)


def inside(sample: GoalSample) -> np.ndarray:
    pixels = outline_pixels(sample)
    return np.asarray(((pixels >= 0) & (pixels <= np.array(sample.camera.size_px) - 1)).all(axis=-1))


def shows(sample: GoalSample, member: str, scene: Scene) -> np.ndarray:
    """(H, W) bool: pixels that show nearly nothing but a member of the goal."""
    shine = Glare(sample.goal.side, member, 0.5, 100.0, 0.0, 100.0, 1e5)  # type: ignore[arg-type]
    light = render_pinhole(sample.camera, scene, sample.pose, glare=(shine,), supersample=2)
    return np.asarray(light[..., 0] > 0.9e5)


def shown(sample: GoalSample, member: str, *, alone: bool = False) -> float:
    """Share of the picture that a member shows, with what stands before it or `alone`."""
    scene = dataclasses.replace(sample.scene, robots=(), boxes=(), ball=None) if alone else sample.scene
    return float(shows(sample, member, scene).mean())


def test_the_66_places_of_the_paper():
    places = paper_places(DOGS)
    assert len(places) == len(set(places)) == 66
    assert places[0] == (pytest.approx(2.2), -1.5)
    assert places[-1] == (pytest.approx(-2.3), 1.5)
    depth = [round(2.7 - x, 9) for x, _ in places]
    assert {d: depth.count(d) for d in (0.5, 1.0, 1.5, 5.0)} == {0.5: 4, 1.0: 6, 1.5: 7, 5.0: 7}
    assert (pytest.approx(1.7), 0.0) not in places


@pytest.mark.slow
def test_goal_is_wholly_in_view_from_each_of_the_66_places():
    """Only this finds a place of the paper from which the goal is cut off."""
    places = paper_places(DOGS)
    for sample in sample_goal(DOGS, PLAIN, 3, 66, places=places, supersample=2):
        assert inside(sample).all()
        assert (sample.pose.x_m, sample.pose.y_m) == places[sample.index]
        assert sample.goal.side == 1
        assert sample.camera.pan_rad == 0.0


@pytest.mark.slow
@pytest.mark.parametrize(("field", "name"), [(DOGS, "clean_208x160"), (NAOS, "white_640x480")])
def test_goal_anywhere_is_in_view_and_no_robot_hides_a_post(field, name: str):
    """Only this finds pictures told as of a whole goal that show less."""
    condition = GOAL_CONDITIONS[name]
    camera = (
        ers7_camera(104, 80)
        if field is DOGS
        else dataclasses.replace(condition.camera, size_px=(128, 96), focal_px=(123.2, 123.2), center_px=(63.5, 47.5))
    )
    sides = set()
    condition = dataclasses.replace(condition, camera=camera, backdrop="plain")
    for sample in sample_goal(field, condition, 5, 12, supersample=2):
        assert inside(sample).all()
        assert field.contains([sample.pose.x_m, sample.pose.y_m])
        sides.add(sample.goal.side)
        for member in ("positive_y", "negative_y"):
            assert shown(sample, member) > 0.7 * shown(sample, member, alone=True)
    assert sides == {1, -1}


@pytest.mark.slow
def test_negative_views_show_no_whole_goal():
    """Only this finds pictures told as negative that show a whole goal."""
    samples = list(sample_goal(DOGS, TINY["mild_glare"], 1, 12, views=NEGATIVE_VIEWS, supersample=2))
    assert [s.view for s in samples] == [NEGATIVE_VIEWS[i % 4] for i in range(12)]
    for sample in samples:
        if sample.view in ("no_goal", "orange_wall"):
            assert sample.scene.field.goals == ()
        elif sample.view == "half_goal":
            in_view = inside(sample).mean(axis=1)
            assert in_view.min() <= 0.25
            assert in_view.max() > 0
        else:
            assert min(shown(sample, member) for member in ("positive_y", "negative_y")) == 0.0
            assert min(shown(sample, member, alone=True) for member in ("positive_y", "negative_y")) > 0.0


@pytest.mark.slow
def test_orange_wall_is_orange_where_a_plain_hall_is_not():
    """Only this finds a wall that misleads nobody."""

    def orange_share(view) -> float:
        frames = [s.frame for s in sample_goal(DOGS, TINY["clean"], 2, 4, views=(view,), supersample=2)]
        hsv = cv2.cvtColor(np.vstack(frames), cv2.COLOR_BGR2HSV)
        return float(((hsv[..., 0] > 4) & (hsv[..., 0] < 16) & (hsv[..., 1] > 170)).mean())

    assert orange_share("orange_wall") > 4 * orange_share("no_goal")


def test_sample_depends_on_seed_and_index_alone():
    def draw(seed: int, count: int, indices=None) -> list[GoalSample]:
        return list(sample_goal(DOGS, TINY["heavy_glare"], seed, count, indices=indices, supersample=2))

    first, again, other = draw(7, 3), draw(7, 100, indices=[2, 1]), draw(8, 1)
    for a, b in ((first[2], again[0]), (first[1], again[1])):
        assert a.index == b.index
        np.testing.assert_array_equal(a.frame, b.frame)
        assert a.pose == b.pose
    assert not np.array_equal(first[0].frame, other[0].frame)


def test_frames_have_the_cameras_size_and_the_camera_handed_out_knows_no_angles():
    assert set(GOAL_CONDITIONS) == set(GOAL_CONDITION_NAMES)
    for name, condition in GOAL_CONDITIONS.items():
        assert name.endswith("x".join(map(str, condition.camera.size_px)))
        assert not condition.camera.known_orientation
    sample = next(iter(sample_goal(DOGS, GOAL_CONDITIONS["clean_208x160"], 0, 1, supersample=2)))
    assert sample.frame.shape == (160, 208, 3)
    assert sample.frame.dtype == np.uint8


def test_ers7_sees_56_9_degrees_across():
    camera = ers7_camera()
    left, right = camera.pixel_to_camera_ray([[-0.5, 159.5], [415.5, 159.5]])
    assert math.degrees(math.acos(left @ right)) == pytest.approx(56.9)


@pytest.mark.slow
def test_heavier_glare_washes_out_more_paint():
    """Only this finds glare that does not spoil paint as its name says."""
    rng = np.random.default_rng(0)

    def area(level) -> float:
        return sum(g.half_length * g.half_width_rad for _ in range(200) for g in lamp_glare(level, DOGS.goals[0], rng))

    assert lamp_glare("none", DOGS.goals[0], rng) == ()
    assert 0 < 4 * area("mild") < area("heavy")

    def washed_out(name: str) -> float:
        pale, paint = 0, 0
        for sample in sample_goal(DOGS, TINY[name], 4, 6, places=paper_places(DOGS), supersample=2):
            for member in ("positive_y", "negative_y", "bar"):
                goal = shows(sample, member, sample.scene)
                pale += np.count_nonzero(np.ptp(sample.frame[goal], axis=1) < 60)
                paint += np.count_nonzero(goal)
        return pale / paint

    assert washed_out("clean") < 0.01
    assert washed_out("clean") < washed_out("mild_glare") < 0.5 * washed_out("heavy_glare")


def test_streaks_run_along_whole_members():
    rng = np.random.default_rng(0)
    drawn = [lamp_glare("streaks", DOGS.goals[0], rng) for _ in range(50)]
    assert {len(streaks) for streaks in drawn} >= {1, 2, 3, 4}
    for streak in (s for streaks in drawn for s in streaks):
        assert streak.middle - streak.half_length < 0 < 1 < streak.middle + streak.half_length


def test_true_height_strays_as_set():
    strays = dataclasses.replace(PLAIN, height_std_m=0.01)
    heights = [s.camera.height_m for s in sample_goal(DOGS, strays, 0, 6, supersample=2)]
    assert 0.003 < np.std(heights) < 0.03
    assert {s.camera.height_m for s in sample_goal(DOGS, PLAIN, 0, 2, supersample=2)} == {0.185}


def test_what_cannot_be_drawn_is_refused():
    with pytest.raises(ArgumentError, match="'ssl_2001' has no goals of posts"):
        next(iter(sample_goal(load_field("ssl_2001"), TINY["clean"], 0, 1)))
    with pytest.raises(ArgumentError, match="places must not be empty"):
        next(iter(sample_goal(DOGS, TINY["clean"], 0, 1, places=[])))


@pytest.mark.slow
def test_a_place_too_near_the_goal_is_refused():
    """Only this finds a search for a view that never ends."""
    with pytest.raises(ArgumentError, match=r"never in view from \(2\.60, 0\.00\)"):
        next(iter(sample_goal(DOGS, TINY["clean"], 0, 1, places=[(2.6, 0.0)])))


# ---- the command


def render_goal(*words: str | Path) -> int:
    parser = argparse.ArgumentParser()
    add_parser(parser.add_subparsers())
    return run_render_goal(parser.parse_args(["render-goal", *map(str, words)]))


@pytest.mark.slow
def test_dataset_holds_pictures_and_their_truth(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """Only this finds a dataset whose truth, camera or noted command is of other pictures."""
    out, again = tmp_path / "data", tmp_path / "again"
    words = ["--condition", "mild_glare_208x160", "--count", "3", "--seed", "5", "--jpeg", "90"]
    assert render_goal(*words, out) == 0
    assert "3 images of four_legged_2007 in" in capsys.readouterr().out
    dataset = read_toml(out / "dataset.toml")
    assert (dataset["field"], dataset["symmetry"]) == ("four_legged_2007", "none")
    camera = load_camera(out / "camera.toml")
    assert isinstance(camera, PinholeCamera)
    assert camera.size_px == (208, 160)
    with (out / "truth.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["image"] for row in rows] == ["0000.jpg", "0001.jpg", "0002.jpg"]
    assert (float(rows[0]["x_m"]), float(rows[0]["y_m"])) == paper_places(DOGS)[0]
    frame = cv2.imread(str(out / "images" / "0002.jpg"))
    assert frame.shape == (160, 208, 3)
    command = (out / "dataset.toml").read_text().splitlines()[0].removeprefix("# made by: ")
    assert render_goal(*shlex.split(command)[2:-1], again) == 0
    assert (again / "images" / "0002.jpg").read_bytes() == (out / "images" / "0002.jpg").read_bytes()


def test_negative_dataset_is_exact_png(tmp_path: Path):
    words = ["--condition", "clean_208x160", "--views", "negative", "--count", "1"]
    assert render_goal(*words, tmp_path / "data") == 0
    frame = cv2.imread(str(tmp_path / "data" / "images" / "0000.png"))
    sample = next(iter(sample_goal(DOGS, GOAL_CONDITIONS["clean_208x160"], 0, 1, views=NEGATIVE_VIEWS)))
    np.testing.assert_array_equal(frame, sample.frame)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--jpeg", "101"], "--jpeg must be within 1 to 100, got 101"),
        (["--field", "ssl_2001"], "has no goals of posts"),
    ],
)
def test_bad_options_are_refused(tmp_path: Path, words: list[str], message: str):
    with pytest.raises(ArgumentError, match=message):
        render_goal(*words, tmp_path / "data")

"""The colour table, white balance from the frame itself, and colors.toml with its one-line errors."""

import math
import re

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from field_models import load_field
from field_models.errors import FileError
from field_models.field import COLOR_NAMES
from robocup_vision.perception.color_table import (
    CLASS_NAMES,
    LLR_CLIP,
    LLR_PER_UNIT,
    Colors,
    build_color_table,
    learn_colors,
    load_colors,
    save_colors,
)
from robocup_vision.perception.floor_color import LEVELS, FloorColor, PaintColor
from robocup_vision.perception.polar_view import PolarView

positive = st.floats(1e-3, 50)
paints = st.builds(PaintColor, positive, positive)
ratios = st.lists(positive, min_size=len(LEVELS), max_size=len(LEVELS)).map(np.array)
floors = st.builds(
    FloorColor,
    st.floats(1, 255),
    st.floats(0, 60),
    ratios,
    ratios,
    st.tuples(st.floats(0.01, 1), st.floats(0.01, 1)).map(np.array),
)
colors_of_any_frame = st.builds(Colors, floors, paints, paints, paints, paints)


@pytest.fixture(scope="session")
def learnt(ssl_field, paper_camera, nominal_samples):
    view = PolarView(paper_camera)
    samples = cv2.blur(view.sample(nominal_samples[0].frame), (3, 3))
    return learn_colors(samples, view.valid, ssl_field)


def test_pure_colours_get_their_classes(learnt):
    table = build_color_table(learnt)
    frame = np.array(
        [[COLOR_NAMES[n] for n in ("green", "white", "orange", "yellow", "blue", "black")]], dtype=np.uint8
    )
    found = [CLASS_NAMES[i] for i in table.segment(frame)[0]]
    assert found == ["floor", "line", "ball", "goal_positive_x", "goal_negative_x", "other"]


@pytest.mark.parametrize("cast", [(0.8, 0.95, 1.25), (1.25, 0.95, 0.8), (0.4, 0.4, 0.4)])
def test_colours_follow_the_light(ssl_field, paper_camera, nominal_samples, cast):
    view = PolarView(paper_camera)
    frame = np.clip(nominal_samples[0].frame * np.array(cast), 0, 255).astype(np.uint8)
    colors = learn_colors(cv2.blur(view.sample(frame), (3, 3)), view.valid, ssl_field)
    assert colors.line.red_ratio == pytest.approx(cast[2] / cast[1], rel=0.1)
    assert colors.line.blue_ratio == pytest.approx(cast[0] / cast[1], rel=0.1)
    names = ("green", "orange", "yellow", "blue")
    row = np.array([[np.array(COLOR_NAMES[n]) * cast for n in names]]).clip(0, 255).astype(np.uint8)
    found = [CLASS_NAMES[i] for i in build_color_table(colors).segment(row)[0]]
    assert found == ["floor", "ball", "goal_positive_x", "goal_negative_x"]


@settings(max_examples=25)
@given(
    cast=st.tuples(*[st.floats(0.8, 1.2)] * 3), filled=st.floats(0.4, 1.0), paint=st.sampled_from(["yellow", "blue"])
)
def test_white_is_that_of_lines_though_a_goal_is_brighter(cast, filled, paint):
    """Lines that fill their pixels in part do not say how white is, but with what carpet is mixed."""
    carpet, white, goal = (np.array(COLOR_NAMES[name]) * cast for name in ("green", "white", paint))
    frame = np.empty((160, 83, 3))
    frame[:] = carpet
    frame[:, 30:33] = carpet + filled * (white - carpet)
    frame[:, 70:] = goal
    frame[::4, 70:76] = white
    noise = np.random.default_rng(3).normal(0.0, 2.0, frame.shape)
    samples = np.clip(frame * 0.8 + noise, 0, 255).astype(np.uint8)
    colors = learn_colors(samples, np.ones((160, 83), dtype=np.uint8), load_field("ssl_2001"))
    assert colors.line.red_ratio == pytest.approx(cast[2] / cast[1], rel=0.06)
    assert colors.line.blue_ratio == pytest.approx(cast[0] / cast[1], rel=0.06)


def test_a_bright_red_lamp_does_not_spoil_white(ssl_field):
    """Pixels without any green have no ratios to it; they once made white, and all colours after it, NaN."""
    samples = np.empty((160, 83, 3), dtype=np.uint8)
    samples[:] = (12, 30, 10)
    samples[:, 60:] = (0, 0, 240)
    with np.errstate(all="raise"):
        colors = learn_colors(samples, np.ones((160, 83), dtype=np.uint8), ssl_field)
        table = build_color_table(colors)
    assert np.isfinite([colors.line.red_ratio, colors.line.blue_ratio, colors.ball.blue_ratio]).all()
    assert colors.line.blue_ratio > 0
    assert table.classes.shape == (65536,)


def test_without_anything_bright_white_is_neutral(ssl_field):
    samples = np.empty((160, 83, 3), dtype=np.uint8)
    samples[:] = (50, 130, 45)
    colors = learn_colors(samples, np.ones((160, 83), dtype=np.uint8), ssl_field)
    assert colors.line == PaintColor(1.0, 1.0)
    blue, green, red = COLOR_NAMES["orange"]
    assert colors.ball == PaintColor(red / green, blue / green)
    assert learn_colors(samples * 0, np.ones((160, 83), dtype=np.uint8), ssl_field) is None


@settings(max_examples=15)
@given(colors_of_any_frame)
def test_the_table_says_what_the_model_says(colors):
    table = build_color_table(colors)
    assert table.packing.max(axis=1).sum() <= 65535
    assert (np.diff(table.packing.astype(int), axis=1) >= 0).all()
    rng = np.random.default_rng(0)
    samples = rng.integers(0, 256, (200, 3), dtype=np.uint8)
    # the mean of all bytes that share its bin stands for a byte
    centers = [[np.flatnonzero(row == row[s]).mean() for s in samples[:, i]] for i, row in enumerate(table.packing)]
    exact = np.clip(colors.floor.log_likelihood_ratio(*np.array(centers), colors.line), -LLR_CLIP, LLR_CLIP)
    found = table.floor_llr[table.pack(samples)] * LLR_PER_UNIT
    np.testing.assert_allclose(found, exact, atol=0.5 * LLR_PER_UNIT + 1e-9)


@pytest.mark.parametrize("level", [60.0, 130.0, 200.0])
@pytest.mark.parametrize("darkness", [0.18, 0.25, 0.35])
def test_a_black_board_is_no_floor_in_shadow(level, darkness):
    """Neighbours of a colour that share its bin must not blur a third of its ratio to green away."""
    red_ratio, blue_ratio = np.full(len(LEVELS), 0.6), np.full(len(LEVELS), 0.75)
    floor = FloorColor(level, 1.0, red_ratio, blue_ratio, np.array([0.05, 0.05]))
    white = PaintColor(1.0, 1.0)
    table = build_color_table(Colors(floor, white, white, white, white))
    # a count up or down is noise, and where the bins' bounds lie is luck
    green = np.arange(math.ceil(level * darkness), math.ceil(1.2 * level * darkness) + 2)[:, None, None]
    step = np.arange(-1, 2)
    board = np.stack(np.broadcast_arrays(green + step[:, None], green, green + step), axis=-1).astype(np.uint8)
    assert table.floor_llr[table.pack(board)].max() < 0
    shadow = np.rint(green * np.array([0.75, 1.0, 0.6])).astype(np.uint8)
    assert (table.floor_llr[table.pack(shadow)] > 0).mean() > 0.9


@given(colors_of_any_frame)
def test_a_colour_file_comes_back_the_same(tmp_path_factory, colors):
    path = tmp_path_factory.mktemp("colors") / "colors.toml"
    save_colors(colors, path)
    back = load_colors(path)
    for name in ("line", "ball", "goal_positive_x", "goal_negative_x"):
        assert getattr(back, name) == getattr(colors, name)
    assert (back.floor.level, back.floor.noise) == (colors.floor.level, colors.floor.noise)
    for name in ("red_ratio", "blue_ratio", "spread"):
        np.testing.assert_array_equal(getattr(back.floor, name), getattr(colors.floor, name))
        with pytest.raises(ValueError, match="read-only"):
            getattr(back.floor, name)[0] = 1.0


@pytest.fixture
def text(learnt, tmp_path):
    save_colors(learnt, tmp_path / "good.toml")
    return (tmp_path / "good.toml").read_text()


def without(text, key):
    return re.sub(rf"^{key} = .*\n", "", text, count=1, flags=re.M)


def replaced(text, key, value):
    return re.sub(rf"^{key} = .*$", f"{key} = {value}", text, count=1, flags=re.M)


SHORT = [0.4] * 12
BROKEN = {
    "missing format": (lambda t: without(t, "format"), "key 'format': is missing"),
    "another format": (lambda t: replaced(t, "format", 2), "key 'format': invalid enum value|key 'format': is not a"),
    "missing ratio": (lambda t: t[: t.rindex("blue_ratio")], "key 'goal_negative_x.blue_ratio': is missing"),
    "unknown number": (lambda t: t + "hue = 3.5\n", "key 'goal_negative_x.hue': is unknown, got 3.5"),
    "too few ratios": (
        lambda t: replaced(t, "red_ratio", SHORT),
        "key 'floor.red_ratio': must have 13 entries, got 12",
    ),
    "too many ratios": (
        lambda t: replaced(t, "blue_ratio", [1.0] * 14),
        "key 'floor.blue_ratio': must have 13 .* got 14",
    ),
    "one spread": (lambda t: replaced(t, "spread", [0.1]), r"key 'floor.spread': .*length 2.*got \[0.1\]"),
    "NaN": (lambda t: replaced(t, "noise", "nan"), "key 'floor.noise': must be a finite number, got nan"),
    "negative": (lambda t: replaced(t, "level", -5.0), "key 'floor.level': must be above 0.0, got -5.0"),
    "over a byte": (lambda t: replaced(t, "level", 256.0), "key 'floor.level': must be at most 255.0, got 256.0"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_file_is_reported_in_one_line(name, text, tmp_path):
    change, message = BROKEN[name]
    path = tmp_path / "colors.toml"
    path.write_text(change(text))
    assert path.read_text() != text
    with pytest.raises(FileError, match=message) as error:
        load_colors(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_files_that_cannot_be_read_or_written(learnt, tmp_path):
    with pytest.raises(FileError, match=r"none\.toml: cannot be read"):
        load_colors(tmp_path / "none.toml")
    with pytest.raises(FileError, match="cannot be written"):
        save_colors(learnt, tmp_path / "no" / "folder.toml")
    (tmp_path / "bad.toml").write_text("format = ")
    with pytest.raises(FileError, match="is not valid TOML"):
        load_colors(tmp_path / "bad.toml")

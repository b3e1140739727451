"""What counts as carpet and as a mark's paint, and what a picture tells of its carpet."""

import numpy as np
import pytest

from robocup_vision.arrays import read_only
from robocup_vision.kernels.model_edges.carpet import (
    carpet_ends,
    carpet_look,
    carpet_marks,
    is_carpet,
    is_paint,
    other_light,
)

CARPET = np.array([45.0, 125.0, 42.0])
GLARE = np.array([135.0, 187.0, 142.0])


@pytest.mark.parametrize(
    ("paint", "shown", "is_one"),
    [
        ((35, 205, 225), (30, 190, 215), True),
        ((35, 205, 225), (18, 105, 112), True),  # in shadow
        ((35, 205, 225), (30, 30, 33), False),
        ((170, 90, 225), (150, 80, 190), True),
        ((170, 90, 225), (30, 110, 235), False),
        ((230, 230, 230), (200, 215, 225), True),
        ((230, 230, 230), (40, 40, 40), False),
        ((230, 230, 230), (30, 110, 235), False),
        ((35, 35, 35), (200, 10, 10), True),  # nothing is known of black but its step
    ],
)
def test_paint_is_recognised_by_its_hue(paint, shown, is_one):
    mean = np.array(paint).mean()
    white = mean if min(paint) > 150 else 0.0
    hue = np.array(paint) - mean if np.ptp(paint) > 60 else np.zeros(3)
    assert is_paint(*map(float, shown), read_only([1.0, 0.0, 1.0, 100.0, *hue, white]), 1.0) == is_one


def test_the_carpet_is_the_commonest_tone_and_noise_is_reported():
    picture = np.tile(CARPET, (160, 208, 1))
    picture[:, 90:96] = 230.0
    picture[:50] = 90.0
    picture[50:] += np.random.default_rng(1).normal(0.0, 4.0, (110, 208, 3))
    carpet = np.zeros(8)
    carpet_look(np.clip(picture, 0, 255).astype(np.uint8), 50, carpet)
    np.testing.assert_allclose(carpet[:3], CARPET, atol=6.0)
    assert carpet[3] == pytest.approx(4.0, rel=0.35)
    assert is_carpet(45.0, 125.0, 42.0, carpet)
    assert is_carpet(30.0, 85.0, 28.0, carpet)
    assert not is_carpet(230.0, 230.0, 230.0, carpet)
    assert not is_carpet(20.0, 20.0, 20.0, carpet)


@pytest.mark.parametrize("gain", [1.0, 0.25, 0.12])
def test_a_dark_hall_s_carpet_has_a_tone_too(gain):
    picture = np.tile(CARPET, (160, 208, 1))
    picture[:, 90:96] = 230.0
    picture = gain * picture + np.random.default_rng(2).normal(0.0, 1.0, picture.shape)
    carpet = np.zeros(8)
    carpet_look(np.clip(np.rint(picture), 0, 255).astype(np.uint8), 0, carpet)
    np.testing.assert_allclose(carpet[:3], gain * CARPET, atol=1.0)
    assert carpet[4] > 0.8


# the tone of whoever is near may be a little green
@pytest.mark.parametrize("tone", [(36.0, 36.0, 36.0), (80.0, 105.0, 80.0)])
@pytest.mark.parametrize(("beside", "is_green"), [(0.8, True), (0.95, False)])
def test_somebody_near_does_not_hide_the_carpet_s_colour_while_some_of_it_is_in_view(beside, is_green, tone):
    rng = np.random.default_rng(2)
    picture = CARPET * rng.normal(1.0, 0.1, (160, 208, 1))
    picture[:, : round(208 * beside)] = tone
    picture += rng.normal(0.0, 3.0, picture.shape)
    carpet = np.zeros(8)
    carpet_look(np.clip(picture, 0, 255).astype(np.uint8), 0, carpet)
    np.testing.assert_allclose(carpet[:3], CARPET if is_green else tone, atol=8.0)


def test_a_mean_of_pixels_is_held_to_its_own_noise():
    carpet = np.array([42.0, 110.0, 38.0, 3.2, 0.5, 42.0, 110.0, 38.0])
    dark_robot = (31.0, 33.0, 29.0)
    # a pixel so dark may be shaded carpet; nine of them are a robot
    assert is_carpet(*dark_robot, carpet)
    assert not is_carpet(*dark_robot, carpet, 1.0 / 3.0)
    assert is_carpet(25.0, 66.0, 23.0, carpet, 1.0 / 3.0)


def test_a_carpet_in_sun_and_shade_has_the_tones_between_both_and_no_grey_is_one():
    rng = np.random.default_rng(4)
    picture = np.tile(CARPET * 0.6, (160, 208, 1))
    picture[:, 120:] = GLARE
    picture = np.clip(picture + rng.normal(0.0, 3.0, picture.shape), 0, 255).astype(np.uint8)
    carpet = np.zeros(8)
    carpet_look(picture, 0, carpet)
    np.testing.assert_allclose(carpet[:3], CARPET * 0.6, atol=4.0)
    np.testing.assert_allclose(carpet[5:], GLARE, atol=4.0)
    for share in np.linspace(0.0, 1.0, 5):
        assert is_carpet(*(CARPET * 0.6 + share * (GLARE - CARPET * 0.6)).tolist(), carpet)
    for grey in (40.0, 90.0, 150.0, 180.0, 255.0):
        # the mean of nine pixels
        assert not is_carpet(grey, grey, grey, carpet, 1.0 / 3.0)


@pytest.mark.parametrize("saturation", [0.5, 0.8, 1.0, 1.6])
@pytest.mark.parametrize("light", [0.9, 1.0, 1.3])
def test_a_pale_or_deep_tone_of_the_carpet_s_hue_is_carpet_and_plain_only_if_it_is_as_green(saturation, light):
    carpet = np.array([*CARPET, 1.5, 0.5])
    grey = CARPET.mean()
    shown = light * (grey + saturation * (CARPET - grey))
    assert is_carpet(*shown.tolist(), carpet)
    assert is_carpet(*shown.tolist(), carpet, 1.0, 1.0) == (saturation >= 0.7)
    assert carpet_marks(np.clip(shown, 0, 255).astype(np.uint8)[None, None], carpet, 1, 1).all()
    # another hue as far from grey
    assert not is_carpet(*(light * (grey + saturation * (CARPET[[2, 0, 1]] - grey))).tolist(), carpet)


@pytest.mark.parametrize("light", [0.5, 0.7])
def test_what_is_darker_than_the_carpet_and_grey_is_none(light):
    carpet = np.array([*CARPET, 1.5, 0.5])
    grey = light * CARPET.mean()
    assert not is_carpet(grey, 1.1 * grey, grey, carpet)


def test_a_carpet_of_one_tone_has_no_other_light():
    assert other_light(np.array([*CARPET, 1.0, 0.5])) == pytest.approx(CARPET.sum())
    assert other_light(np.array([*CARPET, 1.0, 0.5, *GLARE])) == pytest.approx(GLARE.sum())


def test_a_few_leaves_of_another_green_are_no_carpet():
    picture = np.tile(CARPET, (160, 208, 1))
    picture[:60, :16] = GLARE
    carpet = np.zeros(8)
    carpet_look(picture.astype(np.uint8), 0, carpet)
    np.testing.assert_array_equal(carpet[5:], carpet[:3])
    assert not is_carpet(*GLARE.tolist(), carpet)


def test_lines_that_blur_mixes_with_the_carpet_are_no_other_light():
    picture = np.tile(CARPET, (160, 208, 1))
    for row in range(5, 160, 16):
        picture[row : row + 3] = GLARE
    carpet = np.zeros(8)
    carpet_look(picture.astype(np.uint8), 0, carpet)
    np.testing.assert_array_equal(carpet[5:], carpet[:3])


def test_the_carpet_ends_where_a_wall_stands_and_at_no_horizon():
    picture = np.tile(CARPET, (160, 208, 1))
    # a wall from the horizon down to row 70, and a column of carpet up to the horizon
    picture[:70, :104] = 200.0
    ends = carpet_ends(picture.astype(np.uint8), 30)
    assert set(ends[:, 1]) == {69.5}
    assert ends[:, 0].max() < 104
    assert len(ends) == 26
    assert not len(carpet_ends(picture.astype(np.uint8), 159))


def test_marks_of_an_image_are_taken_so_many_rows_and_columns_apart():
    rng = np.random.default_rng(3)
    carpet = np.array([*CARPET, 1.5, 0.5])
    image = np.where(rng.random((41, 60, 1)) < 0.5, CARPET, 200.0).astype(np.uint8)
    every = carpet_marks(image, carpet, 1, 1)
    np.testing.assert_array_equal(every == 1, (image == CARPET.astype(np.uint8)).all(axis=-1))
    np.testing.assert_array_equal(carpet_marks(image, carpet, 3, 4), every[::3, ::4])
    assert not carpet_marks(image, np.zeros(8), 1, 1).any()

"""What the ball classifier learns from is what it says it is, and the file that is written is the network."""

import cv2
import numpy as np
import pytest
from dataset_folders import write_dataset

from field_models.errors import ArgumentError
from robocup_vision import cli
from robocup_vision.camera import PinholeCamera
from robocup_vision.perception.balls.network import CROP_RADIUS_PX
from robocup_vision.perception.networks import Shrunk
from sim2d.training.ball_crops import BANK_PX, apart, rendered_pictures, scene_crops
from sim2d.training.ball_scenes import SCENE_PX, Scene, draw_scene
from sim2d.training.onnx_file import Convolution, write_onnx


def convolved(picture, layer):
    stride = layer.stride
    kernel = layer.weight.shape[2:]
    windows = np.lib.stride_tricks.sliding_window_view(picture, kernel, axis=(1, 2))[:, ::stride, ::stride]
    return np.einsum("bijyx,cbyx->cij", windows, layer.weight) + layer.bias[:, None, None]


def test_opencv_runs_the_written_file_as_numpy_does(tmp_path):
    rng = np.random.default_rng(3)
    shapes = ((6, 3, 3, 3, 2), (4, 6, 3, 2, 1), (3, 4, 1, 1, 1))
    layers = [Convolution(rng.normal(size=shape), rng.normal(size=shape[0]), stride) for *shape, stride in shapes]
    write_onnx(tmp_path / "net.onnx", layers)
    network = cv2.dnn.readNetFromONNX(str(tmp_path / "net.onnx"))
    for height, width in ((19, 30), (40, 21)):
        picture = rng.uniform(0, 255, (3, height, width)).astype(np.float32)
        expected = picture.astype(np.float64)
        for number, layer in enumerate(layers):
            expected = convolved(expected if number == 0 else np.maximum(expected, 0), layer)
        network.setInput(picture[None])
        assert network.forward()[0] == pytest.approx(expected, rel=1e-4, abs=1e-2)


def test_scenes_depend_on_the_seed_alone():
    first, again, other = (draw_scene(np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert np.array_equal(first.image, again.image)
    assert np.array_equal(first.balls, again.balls)
    assert not np.array_equal(first.image, other.image)


def test_balls_of_scenes_are_in_the_picture_and_of_the_size_that_the_network_looks_at():
    rng = np.random.default_rng(4)
    scenes = [draw_scene(rng) for _ in range(20)]
    assert all(scene.image.shape == (*SCENE_PX, 3) for scene in scenes)
    balls = np.concatenate([scene.balls for scene in scenes])
    assert len(balls) > 20
    assert (np.abs(np.log(balls[:, 2] / CROP_RADIUS_PX)) < 0.4).all()
    assert (balls[:, :2] > -4).all()
    assert (balls[:, :2] < (SCENE_PX[1] + 4, SCENE_PX[0] + 4)).all()


@pytest.mark.parametrize("scale", [0.6, 1.0, 1.7, 3.3, 9.0])
def test_a_part_of_a_picture_shows_what_lies_there_at_any_scale(scale):
    ramp = np.zeros((320, 480, 3), np.uint8)
    ramp[..., 0], ramp[..., 1] = np.arange(480) / 2, np.arange(320)[:, None] / 2
    part = Shrunk(ramp).part(120.0, 90.0, scale, (9, 7)).astype(float)
    assert part[..., 0] == pytest.approx(np.broadcast_to((120 + scale * np.arange(9)) / 2, (7, 9)), abs=1.0)
    assert part[..., 1] == pytest.approx(np.broadcast_to(((90 + scale * np.arange(7)) / 2)[:, None], (7, 9)), abs=1.0)


def test_beyond_a_picture_all_is_black():
    part = Shrunk(np.full((40, 60, 3), 200, np.uint8)).part(-20.0, 5.0, 2.0, (20, 10))
    assert (part[:, :9] == 0).all()
    assert (part[:, 11:] == 200).all()


def test_crops_of_balls_show_them_in_the_middle_and_others_lie_apart():
    image = np.full((*SCENE_PX, 3), 60, np.uint8)
    balls = np.array([(60.0, 50.0, 9.0), (150.0, 100.0, 4.5)])
    for u, v, radius in balls:
        cv2.circle(image, (int(u), int(v)), int(radius), (255, 255, 255), -1)
    crops = scene_crops(np.random.default_rng(2), [Scene(image, balls, np.empty((0, 3)))], 60)
    assert crops.is_ball.sum() == 2
    assert (~crops.is_ball).sum() > 30
    bright = crops.images[..., 0] > 150
    middle = (BANK_PX - 1) / 2
    for shown in bright[crops.is_ball]:
        v, u = np.nonzero(shown)
        near = np.hypot(u - middle, v - middle) < 12
        assert (u[near].mean(), v[near].mean()) == pytest.approx((middle, middle), abs=1.0)
        assert near.sum() == pytest.approx(np.pi * CROP_RADIUS_PX**2, rel=0.25)
    # a ball's own radius away from a place's middle nothing of it is left
    assert not bright[~crops.is_ball][:, 22:26, 22:26].all(axis=(1, 2)).any()


def test_places_near_a_ball_are_not_apart_from_it():
    balls = np.array([(100.0, 100.0, 10.0)])
    places = np.array([(100.0, 100.0, 5.0), (112.0, 100.0, 5.0), (118.0, 100.0, 5.0), (118.0, 100.0, 20.0)])
    assert apart(places, balls).tolist() == [False, False, True, False]


@pytest.mark.slow
def test_rendered_fields_show_a_ball_where_they_say():
    """Only this finds training pictures whose balls are of another size than their places ask for."""
    # compiles the renderer
    pictures = rendered_pictures(np.random.default_rng(5), 3)
    for one in pictures:
        for u, v, radius in one.balls:
            places = one.strips.places_px
            nearest = places[np.argmin(np.hypot(places[:, 0] - u, places[:, 1] - v))]
            assert abs(np.log(nearest[2] / radius)) < 0.3


@pytest.mark.parametrize("command", [("train-balls", "--photographs", "{}", "{}/out"), ("train-kinds", "{}/out", "{}")])
def test_photographs_without_boxes_are_refused(tmp_path, command):
    camera = PinholeCamera((320, 240), (300.0, 300.0), (159.5, 119.5), 0.5)
    write_dataset(tmp_path, [np.zeros((240, 320, 3), np.uint8)], camera, "spl_2020")
    arguments = cli.command_parser().parse_args([part.format(tmp_path) for part in command])
    with pytest.raises(ArgumentError, match="need a boxes"):
        arguments.run(arguments)
    (tmp_path / "boxes.csv").write_text("image,kind,xmin,ymin,xmax,ymax\n0.png,ball,10,10,30,30\n")
    with pytest.raises(ArgumentError, match="whose tilt is known"):
        arguments.run(arguments)
    assert not (tmp_path / "out").exists()

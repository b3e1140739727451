"""What the kind classifier learns from: what boxes mark, and places of the floor apart from them."""

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.camera import FisheyeCamera
from robocup_vision.evaluation.boxes import Box
from robocup_vision.vision import Vision
from sim2d.training.kind_crops import OTHER, apart, photograph_crops

CAMERA = FisheyeCamera((304, 400), (163.0, 163.0), (151.5, 199.5), 0.77, pan_rad=0.0, tilt_rad=-0.05, roll_rad=0.0)


def test_places_aside_or_far_before_and_behind_are_apart_from_a_foot():
    foot = np.array([(3.0, 0.0)])
    places = np.array([(3.0, 0.0), (2.6, 0.1), (3.5, -0.2), (3.0, 0.7), (1.5, 0.0), (4.5, 0.0), (-3.0, 0.0)])
    assert apart(places, foot).tolist() == [False, False, False, True, True, True, True]


def test_crops_are_of_what_boxes_mark_and_of_other_places_of_the_floor():
    rays = CAMERA.pixel_to_ray(np.stack(np.meshgrid(np.arange(304), np.arange(400)), axis=-1))
    # carpet up to a wall 5 m away
    down = -rays[..., 2] / np.hypot(rays[..., 0], rays[..., 1])
    frame = np.where((down > CAMERA.height_m / 5.0)[..., None], (60.0, 130.0, 70.0), (150.0, 150.0, 150.0))
    frame = np.clip(frame + np.random.default_rng(0).normal(0, 3, frame.shape), 0, 255).astype(np.uint8)
    (u, v), *others = CAMERA.floor_to_pixel(np.array([(2.5, 0.0), (2.5, 1.2), (3.0, -1.3)]))
    frame[int(v) - 35 : int(v), int(u) - 15 : int(u) + 15] = 20
    boxes = [Box("robot", u - 15, v - 35, u + 15, v + 2)]
    for kind, (u, v) in zip(("human", "obstacle"), others, strict=True):
        boxes.append(Box(kind, u - 5, v - 30, u + 5, v + 2))
    # its feet are not in the picture
    boxes.append(Box("person", 10.0, 200.0, 40.0, 400.0))
    crops = photograph_crops(np.random.default_rng(1), Vision(load_field("msl_18x12"), CAMERA), [(frame, boxes)])
    counts = np.bincount(crops.kinds, minlength=OTHER + 1)
    assert counts[0] in (1, 2)
    assert counts[1] == 1
    assert counts[OTHER] > 8
    # the robot stands in the middle of its picture, on its foot; it is in no other one there
    dark = crops.images[:, 42:48, 23:29].max(axis=(1, 2, 3)) < 60
    assert dark.tolist() == (crops.kinds == 0).tolist()


@pytest.mark.slow
def test_a_network_learns_to_tell_what_it_is_shown(tmp_path):
    """Only this finds a training that does not learn, or writes a network that OpenCV runs otherwise."""
    # torch is imported and trained
    pytest.importorskip("torch")
    from robocup_vision.perception.kinds.network import KindNetwork
    from sim2d.training.kind_crops import RIM_PX, KindCrops
    from sim2d.training.kind_training import train

    kinds = np.arange(90) % 3
    images = np.random.default_rng(2).integers(80, 120, (90, 64, 52, 3)).astype(np.uint8)
    images[kinds == 0, 30:52] = 20
    images[kinds == 1, :, 20:32] = 220
    train(tmp_path / "kind.onnx", KindCrops(images, kinds), seed=1, steps=60, tell=lambda line: None)
    network = KindNetwork((tmp_path / "kind.onnx").read_bytes())
    nats = network.nats(images[:, RIM_PX:-RIM_PX, RIM_PX:-RIM_PX])
    told = np.where(nats.max(axis=1) > 0, nats.argmax(axis=1), OTHER)
    assert np.mean(told == kinds) > 0.9

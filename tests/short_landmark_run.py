"""A short run of three cameras through a hall and the map it makes, rendered once for all tests of this folder."""

from dataclasses import dataclass

import pytest

from robocup_vision.landmarks.landmark_map import LandmarkMap
from robocup_vision.landmarks.mapping.stereo_mapper import MapStep, StereoMapper
from sim2d.rendering.hall.hall import Hall, HallLight, loop_path, make_hall
from sim2d.rendering.hall.runs import HALL_CAMERA, HALL_RIG, HallFrame, take

MOMENTS = 6


@dataclass(frozen=True)
class ShortRun:
    """What the fixture holds."""

    hall: Hall
    frames: list[HallFrame]
    second: list[HallFrame]
    steps: list[MapStep]
    mapper: StereoMapper
    landmarks: LandmarkMap


@pytest.fixture(scope="session")
def short_run() -> ShortRun:
    hall = make_hall(7)
    turns = MOMENTS / 143
    frames = list(take(hall, (HALL_RIG.right, HALL_RIG.left, HALL_RIG.top), loop_path(MOMENTS, turns=turns), 1))
    shifted = loop_path(3, shift_m=0.1, turns=turns)
    second = list(take(hall, (HALL_CAMERA,), shifted, 2, light=HallLight(level=0.6)))
    mapper = StereoMapper(HALL_RIG, frames[0].pose)
    steps = [mapper.add(*frame.images) for frame in frames]
    return ShortRun(hall, frames, second, steps, mapper, mapper.finish())

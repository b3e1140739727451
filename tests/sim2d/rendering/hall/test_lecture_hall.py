"""The lecture hall: its things repeat, people walk to and fro and step aside, light changes, depths are right."""

import math

import numpy as np
import pytest

from field_models.errors import ArgumentError
from robocup_vision.camera import PinholeCamera
from robocup_vision.geometry import Pose2, wrap_angle
from sim2d.rendering.hall.bustle import Bustle, Passer
from sim2d.rendering.hall.hall import Hall, HallCamera, HallLight
from sim2d.rendering.hall.lecture_hall import SIZE_M, WAY_M, make_lecture_hall, visit, way
from sim2d.rendering.hall.runs import take
from sim2d.rendering.hall.solids import Panel, box, panel_arrays, prism, swung

CAMERA = PinholeCamera((40, 30), (35.0, 35.0), (19.5, 14.5), 0.6, tilt_rad=0.0)
FAR_AWAY = Pose2(100.0, 0.0, 0.0)


def person(**changes) -> Passer:
    return Passer(**({"start_m": (0.0, 0.0), "end_m": (3.0, 0.0), "speed_mps": 1.0, "wait_s": 2.0, "late_s": 1.0,
                      "height_m": 1.8, "jacket": 0, "trousers": 1, "face": 2, "nape": 3} | changes))  # fmt: skip


def middle(panels: list[Panel]) -> np.ndarray:
    arrays = panel_arrays(panels)
    return (arrays.origin + (arrays.along * arrays.size[:, :1] + arrays.up * arrays.size[:, 1:]) / 2).mean(axis=0)


@pytest.mark.parametrize("solid", [box(Pose2(1.0, 2.0, 0.5), (0.4, 0.6, 0.8), (0,)),
                                   prism(Pose2(1.0, 2.0, 0.5), (0.2, 0.3), (0.0, 0.8), (0,) * 7)])  # fmt: skip
def test_the_fronts_of_a_solid_look_outwards(solid):
    arrays = panel_arrays(solid)
    normal = np.cross(arrays.along, arrays.up)
    center = arrays.origin + (arrays.along * arrays.size[:, :1] + arrays.up * arrays.size[:, 1:]) / 2
    assert ((center - (1.0, 2.0, 0.4)) * normal).sum(axis=1).min() > 0
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0)


def test_what_swings_keeps_its_shape_and_its_foot_goes_ahead():
    leg = prism(Pose2(0.0, 0.0, 0.0), (0.1, 0.1), (0.0, 1.0), (0,) * 6)
    ahead = swung(leg, (0.0, 0.0, 1.0), math.pi / 2, 0.3)
    before, after = panel_arrays(leg), panel_arrays(ahead)
    np.testing.assert_allclose((after.along * after.up).sum(axis=1), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(after.origin - (0, 0, 1), axis=1),
                               np.linalg.norm(before.origin - (0, 0, 1), axis=1))  # fmt: skip
    assert after.origin.mean(axis=0) == pytest.approx((0.0, math.sin(0.3), 1 - math.cos(0.3)), abs=1e-9)


def test_people_walk_to_and_fro_and_wait():
    walker = person()
    at = [middle(walker.panels(t, FAR_AWAY))[0] for t in (1.0, 2.5, 4.0, 5.9, 7.5, 9.0, 11.0)]
    assert at == pytest.approx([0.0, 1.5, 3.0, 3.0, 1.5, 0.0, 0.0], abs=0.05)
    arrays = panel_arrays(walker.panels(2.0, FAR_AWAY))
    assert (arrays.origin + arrays.up * arrays.size[:, 1:])[:, 2].max() == pytest.approx(1.8)


@pytest.mark.parametrize("robot", [Pose2(1.4, 0.3, 0.0), Pose2(1.6, -0.1, 2.0)])
def test_people_step_aside_for_the_robot(robot):
    x, y, _ = middle(person().panels(2.5, robot))
    assert math.hypot(x - robot.x_m, y - robot.y_m) == pytest.approx(0.9, abs=0.05)


def test_light_rises_and_falls_and_lamps_go_off_by_turns():
    lamps = tuple((float(x), 0.0, 2.0, 1.0) for x in range(4))
    bustle = Bustle((), HallLight(ambient=0.5, lamps=lamps))
    lights = [bustle.light_at(t) for t in np.linspace(0, 155, 311)]
    ambient = [light.ambient for light in lights]
    assert (min(ambient), max(ambient)) == (pytest.approx(0.35, abs=1e-3), pytest.approx(0.65, abs=1e-3))
    on = np.array([[lamp[3] == 1.0 for lamp in light.lamps] for light in lights])
    assert (on.any(axis=0) & ~on.all(axis=0)).all()
    assert len({tuple(row) for row in on.tolist()}) > 2


def test_the_hall_repeats_itself():
    hall = make_lecture_hall(3)
    posters = [panel for panel in hall.panels if panel.is_poster]
    assert len(posters) > 25
    assert len({panel.texture for panel in posters}) == 3
    assert hall.panels == make_lecture_hall(3).panels
    corners = panel_arrays(hall.panels).origin
    assert (np.abs(corners) <= (SIZE_M[0] / 2, SIZE_M[1] / 2, SIZE_M[2])).all()


def test_nothing_stands_in_the_way():
    floor_m = panel_arrays([p for p in make_lecture_hall(3).panels if p.origin_m[2] < 0.5 and p.up[2] == 1.0])
    ends = np.concatenate([floor_m.origin, floor_m.origin + floor_m.along * floor_m.size[:, :1]])[:, :2]
    for pose in way(60) + way(60, shift_m=0.2):
        assert np.hypot(*(ends - pose.array[:2]).T).min() > 0.3


def test_the_way_is_as_long_and_as_far_aside_as_said():
    path, aside = way(2000), way(2000, shift_m=0.2)
    places = np.array([pose.array[:2] for pose in path])
    assert np.hypot(*np.diff(places, axis=0).T).sum() == pytest.approx(WAY_M, rel=1e-4)
    for pose, other in list(zip(path, aside, strict=True))[::100]:
        there = pose.inverse().compose(other)
        assert (there.x_m, there.y_m, there.theta_rad) == (pytest.approx(0, abs=1e-9), pytest.approx(0.2), 0.0)
    ahead = np.diff(places, axis=0)
    turned = np.arctan2(ahead[:, 1], ahead[:, 0]) - [pose.theta_rad for pose in path[:-1]]
    assert max(abs(wrap_angle(float(v))) for v in turned) < 0.01


def test_people_hide_the_hall_and_depths_tell_how_far_they_are():
    far = Panel((4.0, 3.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0), (6.0, 3.0), 4)
    textures = tuple(np.full((8, 8, 3), level, dtype=np.uint8) for level in (200, 200, 200, 200, 60))
    hall, light = Hall((far,), textures), HallLight(ambient=1.0, lamps=())
    crossing = person(start_m=(2.0, -1.5), end_m=(2.0, 1.5), late_s=0.0)
    camera, robot = HallCamera(CAMERA), Pose2(0.0, 0.0, 0.0)
    bustle = Bustle((crossing,), light)
    frames = list(take(hall, (CAMERA,), [robot] * 3, 1, bustle=bustle, interval_s=1.5, depths=True))
    aside, ahead, _ = (frame.images[0][14, 20].astype(int).mean() for frame in frames)
    assert aside == pytest.approx(60, abs=10)
    # daylight has risen a little by then
    assert ahead == pytest.approx(200 * bustle.light_at(1.5).ambient, abs=10)
    assert frames[0].depths_m[0][14, 20] == pytest.approx(4.0)
    assert 1.7 < frames[1].depths_m[0][14, 20] < 2.3
    camera.render(hall, robot, light)
    np.testing.assert_allclose(camera.depths_m()[:15], 4.0, rtol=1e-6)


def test_a_visit_brings_people_whose_clothes_are_at_hand():
    hall = make_lecture_hall(3)
    other, bustle = visit(hall, 4)
    assert other.panels == hall.panels
    used = {panel.texture for panel in bustle.panels(5.0, FAR_AWAY)}
    assert len(hall.textures) <= min(used) <= max(used) < len(other.textures)
    assert bustle.people != visit(hall, 5)[1].people


def test_wrong_people_are_refused():
    with pytest.raises(ArgumentError, match="positive speed and height"):
        person(speed_mps=0.0)

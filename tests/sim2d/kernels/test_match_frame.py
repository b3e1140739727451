"""A mirror camera's match frame in one call is what its loops draw one after the other."""

from __future__ import annotations

import math

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.geometry import Pose2
from sim2d.kernels import bearing_profile, floor_lines, match_frame, match_pixels
from sim2d.match.setups import camera_for
from sim2d.rendering.fast import frames as fast
from sim2d.rendering.scene import Ball, Robot, Scene
from sim2d.rendering.sensor import Sensor


def one_after_the_other(standing, things, paint, ball, walls, light, eye, bearings, rays, plain, room, out):
    crossings = room.crossings
    crossings.lengths[:] = 0
    bearing_profile.meet_walls(standing.walls, 0, eye, bearings, crossings)
    bearing_profile.meet_boxes(standing.boxes, standing.first_face, eye, bearings, crossings)
    lamp_rad = light.lamp_rad
    bearing_profile.meet_cylinders(standing.cylinders, standing.first_cylinder, eye, lamp_rad, bearings, crossings)
    bearing_profile.stack_spans(crossings, things, bearings, eye, light, walls, ball, room.spans)
    floor_lines.floor_until(room.spans, eye.height_m, paint.farthest_m, room.until_m)
    seen = rays, eye, room.until_m, paint.half_line_m
    count = floor_lines.mark_lines(*seen, paint.lines, room.marks, 0)
    count = floor_lines.mark_arcs(*seen, paint.arcs, room.marks, count)
    match_pixels.paint_marked(rays, light, eye, plain, room.marks, count, out)
    match_pixels.draw_pixels(rays, eye, room.spans, ball, plain, light, out)


@pytest.mark.parametrize("name", ["ssl_2001", "msl_18x12"])
def test_one_call_draws_what_all_loops_draw(name, monkeypatch):
    field = load_field(name)
    frames = fast.FastFrames(Scene(field), camera_for(field), Sensor(vignette=0.2))
    robots = (Robot(0.3, 0.2, 0.09, 0.14), Robot(-0.5, 0.4, 0.09, 0.14))
    ball = Ball(0.2, -0.3, field.ball_radius_m)
    pose = Pose2(0.1, 0.05, math.radians(40.0))
    drawn = [frames.draw(robots, ball, pose) for _ in range(2)]
    monkeypatch.setattr(fast, "draw_over_carpet", one_after_the_other)
    apart = frames.draw(robots, ball, pose)
    for frame in drawn:
        np.testing.assert_array_equal(frame, apart)
    # lines, robots and room are there, not carpet alone
    assert len(np.unique(apart.reshape(-1, 3), axis=0)) > 100
    assert match_frame.draw_over_carpet is not one_after_the_other

"""Goal nets: their rectangles, and the light of rays through them.

A net covers what is behind it by the fraction of a ray's patch that is cord. With cords of width d at a distance s,
that is 1 - (1 - d / s)^2 if a patch is wider than many meshes; nearer cords are drawn as lines. The order of two nets
on a ray does not matter, because their cords have one colour and nearly the same light.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from field_models import COLOR_NAMES, Field
from robocup_vision.arrays import FloatArray
from sim2d.kernels.frame_values import Nets
from sim2d.kernels.ray_casting import cross_net
from sim2d.rendering.light import TracedLight, illuminate
from sim2d.rendering.scene import Scene
from sim2d.rendering.scene_table import WHITE

# range beyond which the floor patch of a ray does not grow
_FARTHEST_M = 1e3


def net_rows(field: Field) -> FloatArray:
    """Return the rectangles of a field's nets, (P, 14) float64: see `Nets.rows`."""
    rows = []
    for goal in field.goals:
        if goal.net is None:
            continue
        net, half = goal.net, goal.width_m / 2
        for x0, y0, x1, y1 in goal.panels.tolist():
            length = np.hypot(x1 - x0, y1 - y0)
            along = (x1 - x0) / length, (y1 - y0) / length
            rows.append([x0, y0, 0, *along, 0, 0, 0, 1, length, net.height_m])
        rows.append([goal.line_x_m, -half, net.height_m, goal.side, 0, 0, 0, 1, 0, goal.depth_m, goal.width_m])
        for row in rows[-4:]:
            # a whole number of meshes
            row += [size / max(round(size / net.mesh_m), 1) for size in row[9:11]] + [net.cord_m]
    return np.array(rows, dtype=np.float64).reshape(-1, 14)


def nets_of(field: Field, cast_bgr: npt.NDArray[np.float64]) -> Nets:
    """Return a field's nets in the format of the compiled loops, in a sensor's colours."""
    colors = [COLOR_NAMES[goal.net.color] for goal in field.goals if goal.net is not None]
    color = np.array(colors[0] if colors else (0.0, 0.0, 0.0)) * cast_bgr
    return Nets(net_rows(field), color.astype(np.float32))


def lay_nets(traced: TracedLight, scene: Scene) -> None:
    """Cover the light of rays by the nets in front of what they meet, in place."""
    if not len(net_rows(scene.field)):
        return
    rays, nets = traced.rays, nets_of(scene.field, WHITE)
    eye_m = np.array([traced.eye.x_m, traced.eye.y_m, rays.height_m], dtype=np.float32)
    floor_m = np.minimum(rays.floor_m, np.float32(_FARTHEST_M))
    radial_m, tangential_m = rays.patch_m
    steps = np.stack([tangential_m / floor_m, radial_m * np.float32(rays.height_m) / floor_m**2])
    distance_m, covered = np.empty((2, len(floor_m)), dtype=np.float32)
    for which in range(len(nets.rows)):
        cross_net(nets, which, eye_m, traced.directions, steps, distance_m, covered)
        met = np.flatnonzero((covered > 0) & (distance_m < traced.distance_m))
        x, y = (eye_m[k] + distance_m[met] * traced.directions[k, met] for k in (0, 1))
        light = np.tile(nets.color, (len(met), 1))
        illuminate(light, np.ones(len(met), dtype=np.float32), scene, x, y)
        traced.light[met] += covered[met, None] * (light - traced.light[met])

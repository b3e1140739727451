"""Goal nets: the rectangles they hang in, and how the ray caster sees through them.

A net covers what is behind it by the cords' fraction of a ray's patch. With cords d thick, s apart, that is
1 - (1 - d / s)^2 where a patch is wider than many meshes; nearer cords are seen as lines. Where a ray meets two
nets their order makes no difference, as their cords have one colour and nearly the same light.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from field_models import COLOR_NAMES, Field
from robocup_vision.arrays import FloatArray
from sim2d.kernels.frame_values import Nets
from sim2d.rendering.light import TracedLight, illuminate
from sim2d.rendering.scene import Scene

# range beyond which the patch of floor that a ray covers does not grow any more
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
            # whole meshes
            row += [size / max(round(size / net.mesh_m), 1) for size in row[9:11]] + [net.cord_m]
    return np.array(rows, dtype=np.float64).reshape(-1, 14)


def nets_of(field: Field, cast_bgr: npt.NDArray[np.float64]) -> Nets:
    """Return a field's nets as the compiled loops take them, in a sensor's colours."""
    colors = [COLOR_NAMES[goal.net.color] for goal in field.goals if goal.net is not None]
    color = np.array(colors[0] if colors else (0.0, 0.0, 0.0)) * cast_bgr
    return Nets(net_rows(field), color.astype(np.float32))


def lay_nets(traced: TracedLight, scene: Scene) -> None:
    """Cover by nets, in place, the light of rays that meet something behind them."""
    rows = net_rows(scene.field)
    if not len(rows):
        return
    hits, rays = traced.hits, traced.hits.rays
    c, s = np.cos(hits.eye.theta_rad), np.sin(hits.eye.theta_rad)
    color = nets_of(scene.field, np.ones(3)).color
    for row in rows:
        for window in hits.window_of(_corners(row)[:, :2]):
            direction = np.stack(
                [
                    rays.cos[window] * c - rays.sin[window] * s,
                    rays.cos[window] * s + rays.sin[window] * c,
                    rays.slope[window],
                ]
            ).astype(np.float64)
            floor_m = np.minimum(rays.floor_m[window], _FARTHEST_M)
            floor_m = floor_m.astype(np.float64)
            steps = rays.tangential_m[window] / floor_m, rays.radial_m[window] * (rays.height_m / floor_m**2)
            distance, covered = _meet(row, np.array([hits.eye.x_m, hits.eye.y_m, rays.height_m]), direction, steps)
            met = np.flatnonzero((covered > 0) & (distance < hits.distance_m[window]))
            if not len(met):
                continue
            x, y = (
                (at + distance[met] * along[met]).astype(np.float32)
                for at, along in ((hits.eye.x_m, direction[0]), (hits.eye.y_m, direction[1]))
            )
            light = np.tile(color, (len(met), 1))
            illuminate(light, np.ones(len(met), dtype=np.float32), scene, x, y)
            index = met + window.start
            fraction = covered[met, None].astype(np.float32)
            traced.light[index] += fraction * (light - traced.light[index])


def _corners(row: FloatArray) -> FloatArray:
    """Return a rectangle's corners (4, 3), metres."""
    return np.asarray(row[:3] + np.outer((0, 0, 1, 1), row[3:6] * row[9]) + np.outer((0, 1, 0, 1), row[6:9] * row[10]))


def _meet(
    row: FloatArray, eye: FloatArray, direction: FloatArray, steps: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Return horizontal distances (N,) at which rays (3, N) meet a net, and the fraction of their patches it covers.

    `steps`: (N,), (N,) float64: angle to the ray beside each (rad), and difference of slope to the one above.
    """
    along, up = row[3:6], row[6:9]
    normal, start = np.cross(along, up), row[:3] - eye
    beside = np.stack([-direction[1], direction[0], np.zeros(direction.shape[1])]) * steps[0]
    above = np.outer((0, 0, 1), steps[1])
    with np.errstate(divide="ignore", invalid="ignore"):
        facing = normal @ direction
        distance = (normal @ start) / facing
        inside, free = [], []
        for axis, size, mesh in ((along, row[9], row[11]), (up, row[10], row[12])):
            at = distance * (axis @ direction) - axis @ start
            wide = np.hypot(
                *(distance * (axis @ step - axis @ direction * (normal @ step) / facing) for step in (beside, above))
            )
            low, high = (np.clip(at + side * wide / 2, 0, size) for side in (-1, 1))
            inside.append((high - low) / wide)
            free.append(inside[-1] - (_cord_width_m(high, mesh, row[13]) - _cord_width_m(low, mesh, row[13])) / wide)
        covered = inside[0] * inside[1] - free[0] * free[1]
    is_met = (distance > 0) & np.isfinite(covered)
    return np.where(is_met, distance, np.inf), np.where(is_met, covered, 0.0)


def _cord_width_m(at_m: FloatArray, mesh_m: float, cord_m: float) -> FloatArray:
    """Return the total width of cords from half a mesh before 0 to a place; one lies at every multiple of a mesh."""
    meshes = at_m / mesh_m + 0.5
    whole = np.floor(meshes)
    in_cord = (meshes - whole - 0.5) * mesh_m + cord_m / 2
    return np.asarray(whole * cord_m + np.clip(in_cord, 0.0, cord_m))

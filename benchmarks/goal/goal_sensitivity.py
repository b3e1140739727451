"""How far a goal's pose moves when the camera file, the goal or the edges are off by a little.

Perfect edges of the paper's 66 places are fitted with one number wrong at a time; no picture is rendered.
"""

from __future__ import annotations

import dataclasses
import math
from argparse import Namespace

import numpy as np
import numpy.typing as npt

from benchmarks.harness import Table, program
from field_models import load_field
from robocup_vision.kernels.goal.edge_places import goal_points
from robocup_vision.localization.goal.edges import FOOT_OFFSETS, EdgeSamples
from robocup_vision.localization.goal.fit import GoalModel, fit, goal_model, weigh
from robocup_vision.localization.goal.geometry import BLOOM, HEIGHT, LOG_FOCAL, goal_shape
from sim2d.rendering.goal.scenes import ers7_camera, paper_places

FIELD = load_field("four_legged_2007")
SCALES = np.full(12, 100.0)


def picture(model: GoalModel, truth: npt.NDArray[np.float64], noise_px: float, rng: np.random.Generator) -> EdgeSamples:
    """Twenty samples of each edge and all feet, every edge and foot off as a whole by the noise."""
    count = len(FOOT_OFFSETS)
    points = np.empty((12 + 4 * count, 2))
    goal_points(model.scene, truth, points)
    edge, uv = [], []
    for e, ends in enumerate(points[:12].reshape(6, 2, 2)):
        along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        shift = noise_px * rng.standard_normal() * np.array([along[1], -along[0]])
        for t in np.linspace(0.02, 0.98, 20):
            edge.append(e)
            uv.append(ends[0] + t * (ends[1] - ends[0]) + shift)
    feet = points[12 : 12 + 2 * count]
    feet[:, 1] += np.repeat(noise_px * rng.standard_normal(2), count)
    return weigh(
        EdgeSamples(
            np.array(edge),
            np.array(uv),
            np.repeat([0, 1], count),
            np.tile(np.arange(count), 2),
            feet,
            np.tile([0.0, 1.0], (2 * count, 1)),
            np.full(len(edge) + 2 * count, 0.05),
            np.full(6, 20),
        )
    )


@program()
def main(arguments: Namespace) -> None:
    """Measure and print."""
    rng = np.random.default_rng(arguments.seed)
    repeats = 1 if arguments.quick else 30 if arguments.full else 8
    camera = ers7_camera()
    shape = goal_shape(FIELD)
    exact = goal_model(shape, camera, 0.0)
    exact.weight[[HEIGHT, LOG_FOCAL, BLOOM]] = np.inf
    wrong = {
        "focal length +1 %": (dataclasses.replace(camera, focal_px=(camera.focal_px[0] * 1.01,) * 2), shape, 0.0),
        "bar height +1 cm": (camera, dataclasses.replace(shape, height_m=shape.height_m + 0.01), 0.0),
        "camera height +1 cm": (dataclasses.replace(camera, height_m=camera.height_m + 0.01), shape, 0.0),
        "edge noise 0.5 px": (camera, shape, 0.5),
    }
    table = Table(
        "what is off           | median m: error | 90 % m: error | worst m: error | median deg: error",
        name="errors",
        samples=len(paper_places(FIELD)),
    )
    for name, (other, goal, noise_px) in wrong.items():
        model = goal_model(goal, other, 0.0)
        model.weight[[HEIGHT, LOG_FOCAL, BLOOM]] = np.inf
        errors, angles = [], []
        for x, y in paper_places(FIELD):
            for _ in range(repeats if noise_px else 1):
                heading = math.atan2(-y, shape.line_x_m - x)
                truth = np.array([x, y, heading, 0.02, 0.0, camera.height_m, 0.0, 0.0])
                samples = picture(exact, truth, noise_px, rng)
                start = truth.copy()
                start[HEIGHT] = other.height_m
                p, cost, _ = fit(model, samples, start, SCALES)
                if math.isfinite(cost):
                    errors.append(math.hypot(p[0] - x, p[1] - y))
                    angles.append(abs(math.degrees(p[2] - heading)))
        table.row(name, *(float(np.percentile(errors, q)) for q in (50, 90, 100)), float(np.median(angles)))

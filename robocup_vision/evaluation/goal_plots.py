"""Plots for cameras placed by a goal: the error over the field, and how many images reach which error.

The second is the form of Figs. 9 and 10 of Yako et al.: images by the size of their error, with the running total.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

from field_models.field import Field
from robocup_vision.evaluation.plots import BLUE, GREY, INK, RED, draw_field, encode, new_figure, tidy
from robocup_vision.evaluation.scoring import Row

_ERRORS_CM = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
_RATIOS = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
_MAP_CAPTION = "Position error where each image was taken; the colours end at 20 cm. Crosses: not located."
_PARETO_CAPTION = (
    "Images by position error, and by that error as a ratio of the distance to the goal in view; bars: images in each "
    "range, line: ratio of all images up to it (dashed: the paper's 20 cm and 10 %)."
)


def draw_goal_plots(field: Field, rows: Sequence[Row]) -> list[tuple[str, str]]:
    """Draw both where there is truth; return the image as a data URI and the caption of each plot."""
    if not any(row.error is not None for row in rows):
        return []
    return [(_error_map(field, rows), _MAP_CAPTION), (_pareto(field, rows), _PARETO_CAPTION)]


def error_ratio(field: Field, row: Row) -> float | None:
    """Position error over the distance to the middle of the goal that the camera looked at; None without an error."""
    if row.error is None or row.truth is None or row.estimate is None or not field.goals:
        return None
    heading = row.truth.theta_rad
    if heading is None:
        heading = row.estimate.pose.theta_rad
    ahead = [(g.line_x_m - row.truth.x_m) * math.cos(heading) - row.truth.y_m * math.sin(heading) for g in field.goals]
    goal = field.goals[int(np.argmax(ahead))]
    return row.error.position_m / max(math.hypot(goal.line_x_m - row.truth.x_m, row.truth.y_m), 1e-9)


def _error_map(field: Field, rows: Sequence[Row]) -> str:
    figure, axes = draw_field(field)
    scored = [(row.truth, row.error) for row in rows if row.truth is not None and row.error is not None]
    dots = axes.scatter(
        [truth.x_m for truth, _ in scored],
        [truth.y_m for truth, _ in scored],
        c=[1e2 * error.position_m for _, error in scored],
        s=46,
        cmap="viridis_r",
        vmin=0.0,
        vmax=20.0,
        edgecolors=INK,
        linewidths=0.4,
        zorder=3,
    )
    lost = [row.truth for row in rows if row.truth is not None and row.estimate is None]
    axes.plot([t.x_m for t in lost], [t.y_m for t in lost], "x", color=RED, markersize=7, zorder=4)
    bar = figure.colorbar(dots, ax=axes, shrink=0.8, extend="max")
    bar.set_label("position error (cm)", color=INK)
    axes.set_aspect("equal")
    axes.autoscale_view()
    tidy(axes, "x (m)", "y (m)")
    axes.grid(visible=False)
    return encode(figure)


def _pareto(field: Field, rows: Sequence[Row]) -> str:
    figure = new_figure(8.0, 3.4)
    errors_cm = [1e2 * row.error.position_m for row in rows if row.error is not None]
    ratios = [1e2 * ratio for ratio in (error_ratio(field, row) for row in rows) if ratio is not None]
    for axes, values, bounds, paper, label in (
        (figure.subplots(1, 2)[0], errors_cm, _ERRORS_CM, 20.0, "position error (cm)"),
        (figure.axes[1], ratios, _RATIOS, 10.0, "error / distance to the goal (%)"),
    ):
        counts = np.histogram(values, [*bounds, math.inf])[0]
        counts = np.append(counts, len(rows) - len(values))
        names = [f"{low:g}–{high:g}" for low, high in itertools.pairwise(bounds)]
        names += [f"> {bounds[-1]:g}", "none"]
        place = np.arange(len(counts))
        axes.bar(place, counts, width=0.8, color=[BLUE] * (len(counts) - 1) + [GREY])
        axes.set_xticks(place, names, rotation=45, ha="right", fontsize=8)
        axes.axvline(bounds.index(paper) - 0.5, color=GREY, linestyle="--", linewidth=1.0)
        tidy(axes, label, "images")
        total = axes.twinx()
        total.plot(place[:-1], 100 * np.cumsum(counts[:-1]) / len(rows), "o-", color=RED, markersize=3.5)
        total.set_ylim(0, 103)
        total.spines[["top", "left"]].set_visible(False)
        total.set_ylabel("up to here (% of all images)", color=RED)
    return encode(figure)

"""The report's plots: the field with truth and estimates, the distribution of errors, and errors at goals.

Figures are made as Figure objects, without pyplot, so they need neither a window system nor global state. The plot of
images by the size of their error, with the cumulative ratio, has the form of Figs. 9 and 10 of Yako et al.
"""

from __future__ import annotations

import base64
import io
import itertools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from field_models.field import Field
from robocup_vision.evaluation.scoring import FAIR_M, NEAR_M, NEAR_RAD, Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK, BLUE, RED, GREY, FLOOR, LINE = "#1f2933", "#1f6feb", "#d1242f", "#8a94a0", "#eef4ee", "#b7c4b7"
_MAP_CAPTION = (
    "True positions (grey rings) and estimated ones (blue dots; red beyond 10 cm, with a line from the "
    "truth). "
    "Crosses: not located."
)
_HISTOGRAM_CAPTION = (
    "Errors of the located images along the field's axes and in heading; the outermost bars hold all that lies beyond."
)
_GOAL_COLORS = {"yellow": "#d4a72c", "blue": "#0969da", "cyan": "#1b9ebd"}
_ERRORS_CM = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
_RATIOS = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
_GOAL_CAPTION = "Position error where each image was taken; the colours end at 20 cm. Crosses: not located."
_PARETO_CAPTION = (
    "Images by position error, and by that error as a ratio of the distance to the goal in view; bars: images in each "
    "range, line: ratio of all images up to it (dashed: the paper's 20 cm and 10 %)."
)


def data_uri(kind: str, data: bytes) -> str:
    """Encode an image's bytes as a data URI for an HTML page; `kind` is "png" or "jpeg"."""
    return f"data:image/{kind};base64,{base64.b64encode(data).decode('ascii')}"


def draw_plots(field: Field, rows: Sequence[Row]) -> list[tuple[str, str]]:
    """Draw the plots for which there is data; return each image as a data URI, with its caption."""
    plots = [(_map(field, rows), _MAP_CAPTION)]
    errors = [row.error for row in rows if row.error is not None]
    if errors:
        plots.append(
            (
                _error_cdf(rows),
                "Fraction of all images, the not located ones included, up to each error (dashed: 5 cm, 3°).",
            )
        )
        plots.append((_error_histogram(rows), _HISTOGRAM_CAPTION))
    elif any(row.estimate is not None for row in rows):
        plots.append((_residual_histogram(rows), "Residual of the fit: there is no truth to compare with."))
    return plots


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of this size, inches."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), dpi=130, layout="constrained")


def encode(figure: Figure) -> str:
    """Encode a figure as a data URI."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return data_uri("png", buffer.getvalue())


def tidy(axes: Axes, x_label: str, y_label: str) -> None:
    """Label the axes, and draw only the left and bottom spines and a light grid."""
    axes.set_xlabel(x_label, color=INK)
    axes.set_ylabel(y_label, color=INK)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="#e3e7eb", linewidth=0.8)
    axes.set_axisbelow(True)


def draw_field(field: Field) -> tuple[Figure, Axes]:
    """Draw a field's floor, walls, lines and goals."""
    from matplotlib.collections import LineCollection
    from matplotlib.patches import Polygon

    extent = np.ptp(np.vstack([field.floor_polygon, field.walls.reshape(-1, 2)]), axis=0)
    figure = new_figure(8.0, float(np.clip(7.4 * extent[1] / extent[0] + 0.7, 3.0, 9.0)))
    axes = figure.subplots()
    axes.add_patch(Polygon(field.floor_polygon, facecolor=FLOOR, edgecolor="none"))
    if field.is_bounded:
        axes.add_collection(LineCollection(list(field.walls.reshape(-1, 2, 2)), colors=INK, linewidths=1.6))
    axes.add_collection(LineCollection(list(field.lines.reshape(-1, 2, 2)), colors=LINE, linewidths=1.4))
    for x, y, radius, start, sweep in field.arcs:
        angles = start + np.linspace(0.0, sweep, 90)
        axes.plot(x + radius * np.cos(angles), y + radius * np.sin(angles), color=LINE, linewidth=1.4)
    for goal in field.goals:
        half = goal.width_m / 2
        color = _GOAL_COLORS.get(goal.color, GREY)
        axes.plot([goal.line_x_m, goal.line_x_m], [-half, half], color=color, linewidth=4.0, alpha=0.6)
    return figure, axes


def _map(field: Field, rows: Sequence[Row]) -> str:
    from matplotlib.collections import LineCollection

    figure, axes = draw_field(field)
    truth = np.array([[row.truth.x_m, row.truth.y_m] for row in rows if row.truth is not None]).reshape(-1, 2)
    axes.plot(truth[:, 0], truth[:, 1], "o", color=GREY, markersize=8, fillstyle="none", zorder=3)
    near: list[tuple[float, float]] = []
    far: list[tuple[float, float]] = []
    vectors: list[tuple[tuple[float, float], tuple[float, float]]] = []
    for row in rows:
        if row.estimate is None:
            continue
        at = (row.estimate.pose.x_m, row.estimate.pose.y_m)
        if row.truth is not None and row.error is not None:
            start_m = (row.truth.x_m, row.truth.y_m)
            # the error may count modulo a half turn: draw the estimate in the truth's half
            at = (start_m[0] + row.error.x_m, start_m[1] + row.error.y_m)
            vectors.append((start_m, at))
        (far if row.error is not None and row.error.position_m > FAIR_M else near).append(at)
    axes.add_collection(LineCollection(vectors, colors=RED, linewidths=1.0, zorder=4))
    for points, color in ((near, BLUE), (far, RED)):
        drawn = np.array(points).reshape(-1, 2)
        axes.plot(drawn[:, 0], drawn[:, 1], ".", color=color, markersize=4, zorder=5)
    lost = [[row.truth.x_m, row.truth.y_m] for row in rows if row.truth is not None and row.estimate is None]
    crosses = np.array(lost).reshape(-1, 2)
    axes.plot(crosses[:, 0], crosses[:, 1], "x", color=RED, markersize=7, zorder=6)
    return _encode_map(figure, axes)


def _encode_map(figure: Figure, axes: Axes) -> str:
    axes.set_aspect("equal")
    axes.autoscale_view()
    tidy(axes, "x (m)", "y (m)")
    axes.grid(visible=False)
    return encode(figure)


def _error_cdf(rows: Sequence[Row]) -> str:
    from matplotlib.ticker import LogLocator, NullFormatter

    figure = new_figure(8.0, 3.4)
    axes = figure.subplots(1, 2, sharey=True)
    errors = [row.error for row in rows if row.error is not None]
    position = [1e3 * error.position_m for error in errors]
    heading = [math.degrees(abs(error.theta_rad)) for error in errors if error.theta_rad is not None]
    for axis, values, near, label in (
        (axes[0], position, 1e3 * NEAR_M, "position error (mm)"),
        (axes[1], heading, math.degrees(NEAR_RAD), "heading error (degrees)"),
    ):
        ordered = np.maximum(np.sort(values), near / 1e3)
        axis.step(ordered, 100 * np.arange(1, len(values) + 1) / len(rows), where="post", color=BLUE)
        axis.axvline(near, color=GREY, linestyle="--", linewidth=1.0)
        axis.set_xscale("log")
        decades = np.ptp(np.log10([near, *ordered]))
        axis.xaxis.set_major_locator(LogLocator(subs=(1.0,) if decades > 2 else (1.0, 2.0, 5.0)))
        axis.xaxis.set_major_formatter("{x:g}")
        axis.xaxis.set_minor_formatter(NullFormatter())
        axis.set_ylim(0, 102)
        tidy(axis, label, "images (%)" if axis is axes[0] else "")
    return encode(figure)


def _error_histogram(rows: Sequence[Row]) -> str:
    figure = new_figure(8.0, 2.8)
    errors = [row.error for row in rows if row.error is not None]
    series: list[tuple[str, list[Any]]] = [
        ("x error (mm)", [1e3 * error.x_m for error in errors]),
        ("y error (mm)", [1e3 * error.y_m for error in errors]),
        ("heading error (degrees)", [math.degrees(e.theta_rad) for e in errors if e.theta_rad is not None]),
    ]
    axes = figure.subplots(1, 3)
    for axis, (label, values) in zip(axes, series, strict=True):
        if values:
            # outliers are counted in the outermost bars, so that they do not squeeze all others into one bar
            reach = max(3.0 * float(np.percentile(np.abs(values), 75)), 1e-6)
            axis.hist(np.clip(values, -reach, reach), bins=31, range=(-reach, reach), color=BLUE)
        axis.yaxis.get_major_locator().set_params(integer=True)
        tidy(axis, label, "images" if axis is axes[0] else "")
    return encode(figure)


def _residual_histogram(rows: Sequence[Row]) -> str:
    figure = new_figure(8.0, 2.8)
    axes = figure.subplots()
    axes.hist([row.estimate.residual_px for row in rows if row.estimate is not None], bins=31, color=BLUE)
    tidy(axes, "residual (px)", "images")
    return encode(figure)


def draw_goal_plots(field: Field, rows: Sequence[Row]) -> list[tuple[str, str]]:
    """Draw the error map and the Pareto plot, if there is truth; return data URI and caption of each."""
    if not any(row.error is not None for row in rows):
        return []
    return [(_error_map(field, rows), _GOAL_CAPTION), (_pareto(field, rows), _PARETO_CAPTION)]


def error_ratio(field: Field, row: Row) -> float | None:
    """Return the position error divided by the distance to the goal that the camera faced; None without an error."""
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
    return _encode_map(figure, axes)


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

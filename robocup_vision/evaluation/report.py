"""Makes report.html: one self-contained page with a run's figures, its failures, and what the localiser saw.

It needs the extra `report` (matplotlib, jinja2), which is imported only when a report is made.
"""

from __future__ import annotations

import math
import platform
import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from importlib.util import find_spec

import cv2
import numpy as np

from robocup_vision.evaluation.dataset import Dataset
from robocup_vision.evaluation.detections import KindFigures
from robocup_vision.evaluation.overlays import WORST_COUNT, Crop
from robocup_vision.evaluation.plots import data_uri, draw_goal_plots, draw_plots
from robocup_vision.evaluation.scoring import FAIR_M, Figures, Row

# a browser cannot open a longer table
_MAX_LISTED = 5000
_NUMBER = re.compile(r"-?\d+(\.\d+)?")


@dataclass(frozen=True, slots=True)
class Found:
    """The comparison of detections with the dataset's boxes."""

    figures: dict[str, KindFigures] | None = None  #: figures by kind; None if the dataset has no boxes
    crops: Sequence[Crop] = ()  #: pictures of missed boxes and of false detections
    crops_left_out: int = 0  #: number of further ones that are not shown


@dataclass(frozen=True, slots=True)
class _Overlay:
    caption: str
    image: str
    is_bad: bool
    source: str


@dataclass(frozen=True, slots=True)
class _Line:
    image: str
    status: str
    cells: tuple[str, ...]
    reason: str
    # the reason without its numbers, by which rows are grouped
    kind: str


def missing_packages() -> tuple[str, ...]:
    """Return the names of packages that a report needs but that are not installed."""
    return tuple(name for name in ("matplotlib", "jinja2") if find_spec(name) is None)


def render_report(
    dataset: Dataset,
    rows: Sequence[Row],
    figures: Figures,
    notes: Sequence[str],
    spread: Mapping[int, bytes],
    worst: Sequence[tuple[int, bytes]],
    moments: Mapping[str, str] | None = None,
    found: Found = Found(),
) -> str:
    """Return the page as HTML text.

    `spread` and `worst`, which begins with the worst, are JPEG overlays by the index of their row. `moments` is, by
    image, the address that opens its moment in the live page.
    """
    ranked = sorted(range(len(rows)), key=lambda index: (rows[index].severity, -index), reverse=True)
    worst_indices = {index for index, _ in worst}
    others = [(index, jpeg) for index, jpeg in sorted(spread.items()) if index not in worst_indices]
    plots = draw_plots(dataset.field, rows)
    if dataset.method == "goal":
        plots += draw_goal_plots(dataset.field, rows)
    return render_page(
        "report.html",
        name=dataset.name,
        notes=notes,
        tiles=_tiles(figures, time_of(dataset.times is not None)),
        summary=_summary(figures, time_of(dataset.times is not None)),
        conditions=_conditions(dataset),
        plots=plots,
        worst_rows=[_line(rows[index]) for index in ranked[:WORST_COUNT]],
        worst_overlays=[_overlay(rows[index], jpeg) for index, jpeg in worst],
        other_overlays=[_overlay(rows[index], jpeg) for index, jpeg in others],
        reasons=_reasons(rows),
        rows=[_line(rows[index]) for index in sorted(ranked[:_MAX_LISTED])],
        images=len(rows),
        moments=moments or {},
        kinds=_kinds(found.figures or {}),
        crops=[(crop.caption, data_uri("jpeg", crop.jpeg)) for crop in found.crops],
        crops_left_out=found.crops_left_out,
    )


def render_page(template: str, package: str = "robocup_vision.evaluation", **values: object) -> str:
    """Return a page as HTML text, by a template of a package; templates that it includes are beside this module."""
    from jinja2 import Environment, FunctionLoader

    def read(name: str) -> str:
        folder = files(package if name == template else "robocup_vision.evaluation")
        return (folder / name).read_text(encoding="utf-8")

    pages = Environment(loader=FunctionLoader(read), autoescape=True, trim_blocks=True, lstrip_blocks=True)
    return pages.get_template(template).render(values)


def _tiles(figures: Figures, time_of_what: str) -> list[tuple[str, str]]:
    located = figures.located / figures.images
    return [
        (f"{figures.located}/{figures.images}", f"located ({100 * located:.1f} %)"),
        (percent(figures.within_5cm_3deg), "within 5 cm and 3°"),
        (percent(figures.within_10cm_5deg), "within 10 cm and 5°"),
        (millimetres(figures.median_error_m), "median position error"),
        (degrees(figures.median_error_rad), "median heading error"),
        ("–" if figures.median_ms is None else f"{figures.median_ms:.2f} ms", f"per frame (median), {time_of_what}"),
    ]


def time_of(is_sequence: bool) -> str:
    """Return the conditions of a time per frame: single images take longer, since nothing is known from another one."""
    return "in a sequence" if is_sequence else "single images, nothing carried on between them"


def percent(ratio: float | None) -> str:
    """Show a ratio, 0 to 1, in per cent, or a dash."""
    return "–" if ratio is None else f"{100 * ratio:.1f} %"


def millimetres(length_m: float | None) -> str:
    """Show a length given in metres, or a dash."""
    return "–" if length_m is None else f"{1e3 * length_m:.1f} mm"


def degrees(angle_rad: float | None) -> str:
    """Show an angle given in radians, or a dash."""
    return "–" if angle_rad is None else f"{math.degrees(angle_rad):.2f}°"


def _plain(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"


def _summary(figures: Figures, time_of_what: str) -> list[tuple[str, str]]:
    return [
        ("Images", str(figures.images)),
        ("Located", f"{figures.located} ({100 * figures.located / figures.images:.1f} %)"),
        ("Within 5 cm and 3° (of all images)", percent(figures.within_5cm_3deg)),
        ("Within 10 cm and 5° (of all images)", percent(figures.within_10cm_5deg)),
        ("Median position error", millimetres(figures.median_error_m)),
        ("Median heading error", degrees(figures.median_error_rad)),
        ("RMS error in x", millimetres(figures.rms_x_m)),
        ("RMS error in y", millimetres(figures.rms_y_m)),
        ("RMS error in heading", degrees(figures.rms_theta_rad)),
        ("NEES, 3 degrees of freedom: mean", _plain(figures.nees_mean)),
        ("NEES: median", _plain(figures.nees_median)),
        ("NEES: inside the 95 % bound", percent(figures.nees_inside_95)),
        (f"Median time per frame, {time_of_what}", "–" if figures.median_ms is None else f"{figures.median_ms:.2f} ms"),
    ]


def _kinds(figures: Mapping[str, KindFigures]) -> list[tuple[str, ...]]:
    return [
        (
            kind,
            f"{one.found} of {one.boxes}",
            percent(one.recall),
            "–" if one.reported is None else str(one.reported),
            percent(one.precision),
            millimetres(one.median_range_error_m),
            "–" if one.kind_reported is None else f"{one.kind_right} of {one.kind_reported} reported",
        )
        for kind, one in figures.items()
    ]


def _conditions(dataset: Dataset) -> list[tuple[str, str]]:
    field, camera = dataset.field, dataset.camera
    masks = [mask for mask in (dataset.mask, *dataset.rig_masks) if mask is not None]
    hidden = float(np.mean([np.mean(mask != 0) for mask in masks])) if masks else 0.0
    cameras = [camera] if dataset.rig is None else [*dataset.rig.cameras]
    lenses = "; ".join(f"{type(one).__name__}, {one.size_px[0]} × {one.size_px[1]} px" for one in cameras)
    versions = {"Python": platform.python_version(), "NumPy": np.__version__, "OpenCV": cv2.__version__}
    return [
        ("Field", f"{field.name}: {field.length_m:g} m × {field.width_m:g} m, {field.boundary} around the floor"),
        ("Camera" if dataset.rig is None else "Cameras", lenses),
        ("Colours", _color_source(dataset)),
        ("Method", dataset.method),
        ("Images", "one sequence" if dataset.times is not None else "each stands alone"),
        ("Truth", f"{len(dataset.truth)} of {len(dataset.image_names)} images"),
        ("Poses", f"of the {dataset.pose_of}"),
        ("Symmetry", "errors modulo a half turn" if dataset.symmetry == "point" else "none"),
        ("Mask", f"hides {100 * hidden:.1f} % of the image" if masks else "none"),
        ("Versions", ", ".join(f"{name} {number}" for name, number in versions.items())),
        ("robocup-vision", package_version()),
        ("Date", time.strftime("%Y-%m-%d %H:%M")),
    ]


def _color_source(dataset: Dataset) -> str:
    if dataset.colors is not None:
        return "from a file"
    # independent images do not pass colours on, and learning them is part of their time
    return "learnt anew from each image, within its time" if dataset.times is None else "learnt from the images"


def package_version() -> str:
    """Return the installed version of this package."""
    try:
        return version("robocup-vision")
    except PackageNotFoundError:
        return "(not installed)"


def _line(row: Row) -> _Line:
    pose = ("–", "–", "–")
    std, inliers = "–", "–"
    if row.estimate is not None:
        x_m, y_m, theta_rad = row.estimate.pose.array
        pose = (f"{x_m:.3f}", f"{y_m:.3f}", f"{math.degrees(theta_rad):.1f}°")
        std = millimetres(float(np.hypot(*row.estimate.std[:2])))
        inliers = f"{100 * row.estimate.inlier_ratio:.0f} %"
    ms = "–" if row.time_s is None else f"{1e3 * row.time_s:.1f}"
    status = "failed" if row.failed and not row.unreadable else row.status.replace("_", " ")
    return _Line(row.image, status, (*pose, std, inliers, *_error_text(row), ms), row.reason, _kind(row))


def _error_text(row: Row) -> tuple[str, str]:
    if row.error is None:
        return millimetres(None), degrees(None)
    heading_rad = row.error.theta_rad
    return millimetres(row.error.position_m), degrees(None if heading_rad is None else abs(heading_rad))


def _overlay(row: Row, jpeg: bytes) -> _Overlay:
    if row.estimate is None:
        caption = row.reason
    elif row.error is None:
        caption = f"residual {row.estimate.residual_px:.2f} px"
    else:
        caption = ", ".join(_error_text(row))
    is_bad = row.estimate is None or (row.error is not None and row.error.position_m > FAIR_M)
    return _Overlay(caption, row.image, is_bad, data_uri("jpeg", jpeg))


def _kind(row: Row) -> str:
    return _NUMBER.sub("…", row.reason)


def _reasons(rows: Sequence[Row]) -> list[tuple[str, int]]:
    """Return the reasons, without their numbers, and the number of rows of each, the most frequent first."""
    counts: dict[str, int] = {}
    for row in rows:
        if row.reason:
            counts[_kind(row)] = counts.get(_kind(row), 0) + 1
    return sorted(counts.items(), key=lambda item: -item[1])

"""Compares two evaluations: their figures, and the outcome of each image in both.

It reads the files that `evaluate` has written. Drawing needs the extra `report` (matplotlib, jinja2).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from field_models.errors import ArgumentError, FileError
from robocup_vision.evaluation.plots import BLUE, GREY, data_uri, encode, new_figure, tidy
from robocup_vision.evaluation.report import degrees, millimetres, percent, render_page
from robocup_vision.evaluation.result_files import RESULT_COLUMNS
from robocup_vision.evaluation.scoring import FAIR_M, FAIR_RAD, NEAR_M
from robocup_vision.files.csv_table import CsvRow, read_csv
from robocup_vision.files.images import read_image

# the outcomes of an image, the best first
LOCATED, WRONG, REFUSED, UNREADABLE = OUTCOMES = ("located", "wrong", "refused", "unreadable")
# number of pictures on the page, which a browser must be able to open, their width and JPEG quality
_MAX_PICTURES, _PICTURE_PX, _PICTURE_QUALITY = 60, 480, 75
_ORANGE = "#d9730d"


@dataclass(frozen=True, slots=True)
class ImageOutcome:
    """The outcome of an image in one evaluation."""

    outcome: str  #: one of `OUTCOMES`: "wrong" is a pose more than 10 cm or 5 degrees from a known truth
    #: distance from the truth, and computing time
    error_m: float | None
    ms: float | None
    reason: str  #: why it was not located; empty otherwise


@dataclass(frozen=True, slots=True, eq=False)
class Evaluation:
    """The files of one evaluation."""

    name: str  #: its folder, as the user named it
    summary: Mapping[str, str | float | int | None]  #: the keys of summary.json
    images: Mapping[str, ImageOutcome]  #: outcomes by the image's name


@dataclass(frozen=True, slots=True)
class ImageChange:
    """An image with different outcomes in the two evaluations."""

    image: str
    before: ImageOutcome
    after: ImageOutcome


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """Two evaluations of the same images."""

    first: Evaluation
    second: Evaluation
    shared: tuple[str, ...]  #: images that both have; only these are compared one by one
    changes: tuple[ImageChange, ...]  #: images with different outcomes: first those that became worse

    @property
    def left_alone(self) -> tuple[int, int]:
        """Numbers of images that only the first has, and only the second."""
        return len(self.first.images) - len(self.shared), len(self.second.images) - len(self.shared)

    def count(self, before: str, after: str) -> int:
        """Return the number of shared images with outcome `before` in the first evaluation and `after` in the other."""
        pairs = ((self.first.images[name].outcome, self.second.images[name].outcome) for name in self.shared)
        return sum(pair == (before, after) for pair in pairs)


def load_evaluation(folder: str | Path) -> Evaluation:
    """Read the files that `evaluate` has written into a folder.

    Raises
    ------
    FileError
        If summary.json or results.csv is missing or wrong.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise FileError(folder, "is not a folder: compare takes two folders that evaluate has written")
    path = folder / "summary.json"
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FileError(path, f"cannot be read ({error.strerror or error}): has `evaluate` written it?") from None
    except ValueError as error:
        raise FileError(path, f"is not valid JSON ({error})") from None
    needed = ("method", *(key for _, key, _ in _FIGURES))
    missing = [key for key in needed if not isinstance(summary, dict) or key not in summary]
    if missing:
        raise FileError(path, f"has no {', '.join(missing)}")
    rows = read_csv(folder / "results.csv", RESULT_COLUMNS)
    return Evaluation(str(folder), summary, {row.entries["image"]: _outcome(row) for row in rows})


def compare(first: Evaluation, second: Evaluation) -> Comparison:
    """Compare two evaluations image by image.

    Raises
    ------
    ArgumentError
        If they have no image in common.
    """
    shared = tuple(name for name in first.images if name in second.images)
    if not shared:
        raise ArgumentError(f"{first.name} and {second.name} have no image in common")
    pairs = (ImageChange(name, first.images[name], second.images[name]) for name in shared)
    changes = [change for change in pairs if change.before.outcome != change.after.outcome]
    # sorting keeps the order of the images
    return Comparison(first, second, shared, tuple(sorted(changes, key=lambda change: not _is_worse(change))))


def render_comparison(comparison: Comparison, pictures: Path | None = None) -> str:
    """Return the page as HTML text.

    Parameters
    ----------
    pictures : Path, optional
        Folder of the images; if given, the page shows those that changed.
    """
    return render_page(
        "comparison.html",
        first=comparison.first.name,
        second=comparison.second.name,
        notes=_notes(comparison),
        figures=figure_rows(comparison),
        outcomes=[outcome for outcome in OUTCOMES if any(comparison.count(outcome, other) for other in OUTCOMES)],
        afters=[outcome for outcome in OUTCOMES if any(comparison.count(other, outcome) for other in OUTCOMES)],
        count=comparison.count,
        changes=[
            (change, _is_worse(change), *map(_outcome_text, (change.before, change.after)))
            for change in comparison.changes
        ],
        pictures=[] if pictures is None else _pictures(comparison, pictures),
        plot=_error_plot(comparison),
    )


def figure_rows(comparison: Comparison) -> list[tuple[str, str, str, str]]:
    """Return name, both values and the difference of each figure, as text."""
    rows = [("Method", str(comparison.first.summary["method"]), str(comparison.second.summary["method"]), "")]
    for label, key, text in _FIGURES:
        values = [comparison.first.summary[key], comparison.second.summary[key]]
        one, other = (float(value) if isinstance(value, int | float) else None for value in values)
        difference = "–" if one is None or other is None else _signed(other - one, text)
        rows.append((label, text(one), text(other), difference))
    return rows


def _outcome(row: CsvRow) -> ImageOutcome:
    status, error_m, error_rad = row.entries["status"], row.number_or_none("error_m"), row.number_or_none("error_rad")
    if status not in ("located", "not_located", "unreadable"):
        raise FileError(row.path, f"line {row.line}: status must be located, not_located or unreadable", value=status)
    is_far = (error_m or 0.0) > FAIR_M or (error_rad or 0.0) > FAIR_RAD
    outcome = {"not_located": REFUSED, "unreadable": UNREADABLE}.get(status, WRONG if is_far else LOCATED)
    return ImageOutcome(outcome, error_m, row.number_or_none("ms"), row.entries["reason"])


def _is_worse(change: ImageChange) -> bool:
    # a wrong pose does more harm than none
    order = (LOCATED, REFUSED, UNREADABLE, WRONG)
    return order.index(change.after.outcome) > order.index(change.before.outcome)


def _notes(comparison: Comparison) -> list[str]:
    alone = zip((comparison.first.name, comparison.second.name), comparison.left_alone, strict=True)
    notes = [
        f"{count} images are in {name} alone; they are in its figures, and not compared."
        for name, count in alone
        if count
    ]
    if not any(
        one.error_m is not None for one in (*comparison.first.images.values(), *comparison.second.images.values())
    ):
        notes.append("There is no truth: whether a pose is wrong is not known.")
    return notes


def _outcome_text(one: ImageOutcome) -> str:
    return one.reason or millimetres(one.error_m)


def _pictures(comparison: Comparison, folder: Path) -> list[tuple[ImageChange, str]]:
    shown = []
    for change in comparison.changes[:_MAX_PICTURES]:
        picture = read_image(folder / change.image)
        ratio = min(1.0, _PICTURE_PX / picture.shape[1])
        small = cv2.resize(picture, None, fx=ratio, fy=ratio, interpolation=cv2.INTER_AREA)
        encoded, jpeg = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, _PICTURE_QUALITY])
        assert encoded, "OpenCV encodes every (H, W, 3) uint8 array"
        shown.append((change, data_uri("jpeg", jpeg.tobytes())))
    return shown


def _error_plot(comparison: Comparison) -> str | None:
    """Draw the fraction of shared images within each error, for both evaluations; None without truth."""
    series = []
    for evaluation, color in ((comparison.first, BLUE), (comparison.second, _ORANGE)):
        errors = [evaluation.images[name].error_m for name in comparison.shared]
        known = np.sort([1e3 * error_m for error_m in errors if error_m is not None])
        series.append((evaluation.name, color, np.maximum(known, NEAR_M)))
    if not any(len(known) for *_, known in series):
        return None
    figure = new_figure(8.0, 3.2)
    axes = figure.subplots()
    for name, color, known in series:
        axes.step(
            known, 100 * np.arange(1, len(known) + 1) / len(comparison.shared), where="post", color=color, label=name
        )
    axes.axvline(1e3 * NEAR_M, color=GREY, linestyle="--", linewidth=1.0)
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_ylim(0, 102)
    axes.legend(frameon=False, loc="lower right")
    tidy(axes, "position error (mm)", "images (%)")
    return encode(figure)


def _whole(value: float | None) -> str:
    return _plain(value, digits=0)


def _plain(value: float | None, *, digits: int) -> str:
    return "–" if value is None else f"{value:.{digits}f}"


def _signed(difference: float, text: Callable[[float | None], str]) -> str:
    digits = text(abs(difference))
    if not any(digit in digits for digit in "123456789"):
        return "0"
    return ("+" if difference > 0 else "−") + digits


# label, key in summary.json and format of each figure that is compared
_FIGURES: Sequence[tuple[str, str, Callable[[float | None], str]]] = (
    ("Images", "images", _whole),
    ("Located", "located", _whole),
    ("Within 5 cm and 3° (of all images)", "within_5cm_3deg", percent),
    ("Within 10 cm and 5° (of all images)", "within_10cm_5deg", percent),
    ("Median position error", "median_error_m", millimetres),
    ("RMS error in heading", "rms_theta_rad", degrees),
    ("NEES, 3 degrees of freedom: mean", "nees_mean", partial(_plain, digits=2)),
    ("Median time per frame", "median_ms", lambda ms: "–" if ms is None else f"{ms:.2f} ms"),
)

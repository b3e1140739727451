"""The files of a replay: replay.csv, a line per call; replay.json, the figures; replay.html, both runs over time."""

from __future__ import annotations

import csv
import html
import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robocup_vision.estimates import PoseEstimate
from robocup_vision.evaluation.plots import BLUE, GREY, INK, data_uri, new_figure
from robocup_vision.evaluation.report import missing_packages
from robocup_vision.files.output_folder import telling_write_errors
from robocup_vision.files.text_files import write_json, write_text
from robocup_vision.recording.replay import Differences, ReplayedCall, Spread

if TYPE_CHECKING:
    from matplotlib.axes import Axes

OUTPUT_NAMES = ("replay.csv", "replay.json", "replay.html")
_COLUMNS = ("x_m", "y_m", "theta_rad", "belief_x_m", "belief_y_m", "belief_theta_rad", "ball_x_m", "ball_y_m")
_COMMAND = ("forward_mps", "left_mps")
_TRACES = (
    ("x of the believed pose, m", "belief", 3),
    ("y of the believed pose, m", "belief", 4),
    ("heading of the believed pose, rad", "belief", 5),
    ("x of the frame's pose, m", "pose", 0),
    ("y of the frame's pose, m", "pose", 1),
    ("ball ahead, m", "ball", 6),
    ("command ahead, m/s", "velocity_mps", 8),
    ("command to the left, m/s", "velocity_mps", 9),
)


def figures(differences: Differences) -> dict[str, Any]:
    """Return the figures of a replay as plain values; None if there was nothing to compute one from."""
    values: dict[str, Any] = {
        "calls": differences.calls,
        "same": differences.same,
        "first_difference_s": differences.first_s,
        "frames": differences.looks,
        "located": list(differences.located),
        "ball_seen": list(differences.seen),
    }
    for name in ("pose_m", "pose_rad", "belief_m", "belief_rad", "ball_m", "command_mps"):
        spread: Spread = getattr(differences, name)
        values[name] = {"median": spread.median, "largest": spread.largest, "count": len(spread.values)}
    return values


def write_files(folder: Path, name: str, calls: Sequence[ReplayedCall], differences: Differences) -> list[str]:
    """Write the files of a replay; return notes on files that could not be made.

    Raises FileError if a file cannot be written.
    """
    notes = []
    missing = missing_packages()
    _write_csv(folder / "replay.csv", calls)
    write_json(folder / "replay.json", figures(differences))
    if missing:
        what = " and ".join(missing)
        notes.append(f"no replay.html: {what} not installed (pip install 'robocup-vision[report]')")
    else:
        write_text(folder / "replay.html", _page(name, calls, differences))
    return notes


def summary_lines(differences: Differences) -> list[tuple[str, str]]:
    """Return the figures as labels and texts, for the terminal and the page."""
    d = differences
    first = "-" if d.first_s is None else f"{d.first_s:.3f} s"
    lines = [
        ("calls the same in every bit", f"{d.same} of {d.calls}"),
        ("first difference at", first),
        ("frames located, then and now", f"{d.located[0]} and {d.located[1]} of {d.looks}"),
        ("frames with a ball, then and now", f"{d.seen[0]} and {d.seen[1]} of {d.looks}"),
    ]
    for label, spread, scale, unit in (
        ("pose of the frame", d.pose_m, 1e3, "mm"),
        ("heading of the frame", d.pose_rad, math.degrees(1.0), "deg"),
        ("believed pose", d.belief_m, 1e3, "mm"),
        ("believed heading", d.belief_rad, math.degrees(1.0), "deg"),
        ("ball", d.ball_m, 1e3, "mm"),
        ("command", d.command_mps, 1e3, "mm/s"),
    ):
        if spread.median is not None and spread.largest is not None:
            text = f"median {scale * spread.median:.3g} {unit}, largest {scale * spread.largest:.3g} {unit}"
            lines.append((f"{label} differs by", text))
    return lines


def _row(outputs: Mapping[str, Any]) -> list[float | None]:
    row: list[float | None] = []
    for name in ("pose", "belief"):
        estimate = outputs.get(name)
        if isinstance(estimate, PoseEstimate):
            row += [estimate.pose.x_m, estimate.pose.y_m, estimate.pose.theta_rad]
        else:
            row += [None] * 3
    ball = outputs.get("ball")
    row += [None, None] if ball is None else [ball.x_m, ball.y_m]
    return [*row, *(outputs.get("velocity_mps") or (None, None))]


def _write_csv(path: Path, calls: Sequence[ReplayedCall]) -> None:
    columns = (*_COLUMNS, *_COMMAND)
    with telling_write_errors(path), path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        now = [f"replayed_{column}" for column in columns]
        writer.writerow(["number", "kind", "t_s", "same", *columns, *now])
        for call in calls:
            cells = [*_row(call.recorded), *_row(call.replayed)]
            texts = ["" if value is None else f"{value:.9g}" for value in cells]
            writer.writerow([call.number, call.kind, f"{call.t_s:.9g}", int(call.is_same), *texts])


def _page(name: str, calls: Sequence[ReplayedCall], differences: Differences) -> str:
    plots = [_plot(label, key, column, calls) for label, key, column in _TRACES]
    rows = "".join(
        f"<tr><th>{html.escape(label)}</th><td>{html.escape(text)}</td></tr>"
        for label, text in summary_lines(differences)
    )
    images = "".join(f'<figure><img src="{uri}" alt=""></figure>' for uri in plots if uri)
    return (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>Replay of {html.escape(name)}</title>'
        f"<style>body{{font:15px/1.5 sans-serif;color:{INK};max-width:60rem;margin:2rem auto;padding:0 1rem}}"
        "th{text-align:left;font-weight:normal;padding-right:2rem}img{max-width:100%}figure{margin:1rem 0}</style>"
        f"<h1>Replay of {html.escape(name)}</h1><table>{rows}</table>"
        "<p>Grey: as recorded. Blue: as replayed. Where both agree, blue lies on grey.</p>"
        f"{images}</html>\n"
    )


def _plot(label: str, key: str, column: int, calls: Sequence[ReplayedCall]) -> str | None:
    chosen = [call for call in calls if call.recorded.get(key) is not None or call.replayed.get(key) is not None]
    if not chosen:
        return None
    figure = new_figure(9.0, 2.2)
    axes: Axes = figure.add_subplot()
    times = [call.t_s for call in chosen]
    for color, width, side in ((GREY, 3.0, "recorded"), (BLUE, 1.0, "replayed")):
        values = [_row(getattr(call, side))[column] for call in chosen]
        axes.plot(times, [math.nan if v is None else v for v in values], color=color, linewidth=width)
    axes.set_xlabel("time, s")
    axes.set_title(label, loc="left", fontsize=10)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    return data_uri("png", buffer.getvalue())

"""Makes report.html of a match: score, film, localisation and actions of each robot, faults.

It needs the extra `report` (matplotlib, jinja2), which is imported only when a report is made.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from field_models.field import Field
from robocup_vision.evaluation.moment_links import moment_link
from robocup_vision.evaluation.plots import GREY, INK, data_uri, draw_field, encode, new_figure, tidy
from robocup_vision.evaluation.report import (
    degrees,
    millimetres,
    missing_packages,
    package_version,
    percent,
    render_page,
)
from robocup_vision.evaluation.scoring import NEAR_M
from sim2d.report.match_figures import MatchFigures
from sim2d.report.robot_figures import FaultFigures, RobotFigures
from sim2d.report.story import ChoiceRate, MatchStory

__all__ = ["missing_packages", "render_report"]

# orange for the side that attacks +x, blue for the other, one shade per robot
_COLORS = {1: ("#b45309", "#d97706", "#f59e0b", "#92400e"), -1: ("#1d4ed8", "#3b82f6", "#60a5fa", "#1e3a8a")}
# links to goals start this long before the goal
_BEFORE_S = 2.0
_WAYS_CAPTION = "Paths of the robots (colours as in the table) and of the ball (grey)."
_SPEEDS_CAPTION = "Speed limit that planning set for each robot (a gap: it planned none)."
_CAMERAS_CAPTION = "How far each player believes its camera's centre to be from the camera file's."
_ERRORS_CAPTION = "Error of each estimated position (dashed: 5 cm; a gap: no estimate)."


def render_report(
    field: Field,
    seed: int,
    figures: MatchFigures,
    story: MatchStory,
    video: Path | None,
    notes: Sequence[str],
    recordings: Sequence[str] = (),
    poster: bytes = b"",
) -> str:
    """Return the page as HTML text.

    Parameters
    ----------
    video : Path or None
        The film, in the page's own folder.
    notes : sequence of str
        Notes on files that could not be written.
    recordings : sequence of str
        Names of the robots' recordings, in the robots' order, in the page's own folder; empty: there are none.
    poster : bytes
        JPEG that is shown until the film is played; empty: the film's first picture is shown.
    """
    plots = [(_ways(field, figures, story), _WAYS_CAPTION), (_errors(figures, story), _ERRORS_CAPTION)]
    if story.calibrates:
        moved = dict(enumerate(story.center_moved_px))
        plots.append((_over_time(figures, story.t_s, moved, "centre moved (px)"), _CAMERAS_CAPTION))
    if story.planners:
        speeds = {index: story.speed_mps[index] for index in story.planners}
        plots.append((_over_time(figures, story.t_s, speeds, "speed allowed (m/s)"), _SPEEDS_CAPTION))

    return render_page(
        "report.html",
        "sim2d.report",
        field=field.name,
        score=figures.score,
        lead=f"{figures.seconds:g} s on {field.name}, {len(figures.robots) // 2} against "
        f"{len(figures.robots) // 2}, seed {seed}; robocup-vision {package_version()}",
        video=None if video is None else video.name,
        poster=data_uri("jpeg", poster) if poster else "",
        notes=notes,
        stopped=[robot for robot in figures.robots if robot.stopped_reason],
        tiles=_tiles(figures),
        recordings=recordings,
        goals=[
            (f"{t_s:.1f} s", "+x" if side > 0 else "-x", _moment_links(recordings, t_s - _BEFORE_S))
            for t_s, side in figures.goals
        ],
        robots=[(_name(robot), _color(robot), _cells(robot)) for robot in figures.robots],
        starts=_moment_links(recordings, 0.0),
        faults=[_fault_cells(fault) for fault in figures.faults],
        planned=[_planned_cells(figures, rate) for rate in story.rates],
        plots=plots,
    )


def _moment_links(recordings: Sequence[str], t_s: float) -> list[tuple[int, str]]:
    """Return the robots' indices and the addresses that open a moment of their recordings."""
    return [(number, moment_link(name, t_s)) for number, name in enumerate(recordings)]


def _tiles(figures: MatchFigures) -> list[tuple[str, str]]:
    robots = figures.robots
    ours, theirs = figures.possession
    medians = [robot.median_error_m for robot in robots if robot.median_error_m is not None]
    return [
        (f"{percent(ours)} : {percent(theirs)}", "possession"),
        (percent(float(np.mean([robot.within_5cm_3deg for robot in robots]))), "of frames within 5 cm and 3°"),
        (millimetres(float(np.median(medians)) if medians else None), "median position error"),
        (f"{max(robot.longest_lost_s for robot in robots):.2f} s", "longest a robot was lost"),
        (str(sum(robot.kicks for robot in robots)), "kicks"),
        # each collision is counted for both robots
        (str(sum(robot.collisions for robot in robots) // 2), "collisions of robots"),
    ]


def _name(robot: RobotFigures) -> str:
    return f"{robot.robot} ({'+' if robot.side > 0 else '-'}x, {robot.number})"


def _color(robot: RobotFigures) -> str:
    shades = _COLORS[robot.side]
    return shades[robot.number % len(shades)]


def _cells(robot: RobotFigures) -> list[str]:
    return [
        percent(robot.within_5cm_3deg),
        millimetres(robot.median_error_m),
        millimetres(robot.p95_error_m),
        degrees(robot.median_error_rad),
        degrees(robot.p95_error_rad),
        percent(robot.lost_ratio),
        f"{robot.longest_lost_s:.2f} s",
        percent(robot.right_half_ratio),
        str(robot.collisions),
        str(robot.wall_contacts),
        str(robot.kicks),
        f"{robot.distance_m:.1f} m",
        percent(robot.possession),
        f"{robot.longest_stuck_s:.1f} s",
    ]


def _fault_cells(fault: FaultFigures) -> list[str]:
    recovery = "–" if fault.recovery_s is None else f"{fault.recovery_s:.2f} s"
    until = "the end" if fault.until_s == float("inf") else f"{fault.until_s:.2f} s"
    return [str(fault.robot), fault.kind, f"{fault.from_s:.2f} s", until, recovery]


def _planned_cells(figures: MatchFigures, choice: ChoiceRate) -> tuple[str, str, list[str]]:
    robot = figures.robots[choice.robot]
    return (
        _name(robot),
        _color(robot),
        [choice.topic, choice.choice, percent(choice.rate), str(choice.times), choice.example],
    )


def _over_time(figures: MatchFigures, t_s: Sequence[float], values: Mapping[int, Sequence[float]], label: str) -> str:
    """Plot a value of some robots, by their indices, over time."""
    figure = new_figure(8.0, 2.4)
    axes = figure.subplots()
    for index, of_robot in values.items():
        axes.plot(t_s, of_robot, color=_color(figures.robots[index]), linewidth=0.9)
    axes.set_ylim(bottom=0.0)
    tidy(axes, "time (s)", label)
    return encode(figure)


def _ways(field: Field, figures: MatchFigures, story: MatchStory) -> str:
    figure, axes = draw_field(field)
    axes.plot(story.ball_x_m, story.ball_y_m, color=GREY, linewidth=0.8, linestyle=":")
    for robot in figures.robots:
        axes.plot(story.x_m[robot.robot], story.y_m[robot.robot], color=_color(robot), linewidth=1.0)
    axes.set_aspect("equal")
    axes.autoscale_view()
    tidy(axes, "x (m)", "y (m)")
    axes.grid(visible=False)
    return encode(figure)


def _errors(figures: MatchFigures, story: MatchStory) -> str:
    figure = new_figure(8.0, 3.0)
    axes = figure.subplots()
    for robot in figures.robots:
        error_mm = 1e3 * np.array(story.error_m[robot.robot])
        axes.plot(story.t_s, error_mm, color=_color(robot), linewidth=0.9)
    axes.axhline(1e3 * NEAR_M, color=GREY, linestyle="--", linewidth=1.0)
    for t_s, _ in figures.goals:
        axes.axvline(t_s, color=INK, linewidth=0.8, alpha=0.4)
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    tidy(axes, "time (s); upright lines: goals" if figures.goals else "time (s)", "position error (mm)")
    return encode(figure)

"""Line segments, crossings, circles, posts and penalty marks in rendered pictures of forward and mirror cameras.

Pictures are from places all over each field, up to three other robots in them; a forward camera is held off by what its
file states. "alone": by the camera file, without a pose. "located": as `Vision.look` tells them, near the true pose.
Recall: of field lines that show 60 px or more of their length, a line at least 1.5 px wide, and are hidden by nobody
there; crossings, posts and penalty marks whose place and surroundings (16 px; lines 2 px wide) are in view; circles of
which a third is. Precision: a segment is right within 3 standard deviations of a line of the field that goes on at its
middle, others within 3 standard deviations and 1 m of a feature. Kinds: of the right crossings that have one, those
whose kind is right. Error: median of right ones, of a segment at its middle across the line. NEES: median over the
right ones, over 2 degrees of freedom, by the median that it should have (1.386): 1 is honest.
"""

from __future__ import annotations

import math
from argparse import Namespace
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from benchmarks.harness import Table, program, verdict
from benchmarks.worlds.marking_worlds import WORLDS, MarkedFrame, MarkingWorld, marked_frames
from field_models import Field
from robocup_vision import Vision
from robocup_vision.arrays import FloatArray
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.perception.markings.field_features import FieldFeatures
from robocup_vision.perception.markings.finder import MarkingFinder
from robocup_vision.perception.markings.marking import Circle, Crossing, LineSegment, Markings, PenaltyMark, Post

GATE2 = 9.0
MEDIAN_CHI2 = 2 * math.log(2.0)
MIN_LINE_PX, MIN_WIDTH_PX, MIN_CROSSING_WIDTH_PX, AROUND_PX = 60.0, 1.5, 2.0, 16.0
MAX_ERROR_M = 1.0
PRIOR_STD = np.array([0.05, 0.05, math.radians(2.0)])
MIN_PRECISION, NEES_RANGE = 0.95, (0.5, 3.0)


@dataclass
class Tally:
    """What became of one kind of marking."""

    expected: int = 0
    found: int = 0
    told: int = 0
    right: int = 0
    kinds: int = 0
    right_kinds: int = 0
    errors_m: list[float] = field(default_factory=list)
    squared: list[float] = field(default_factory=list)

    @property
    def nees(self) -> float:
        """Median of the squared errors in standard deviations, by what it should be."""
        return float(np.median(self.squared)) / MEDIAN_CHI2 if self.squared else math.nan


def score(markings: Markings, shot: MarkedFrame, pitch: Field, features: FieldFeatures, into: dict[str, Tally]) -> None:
    """Compare what is told of a picture with what is true."""
    width_m = pitch.line_width_m
    _score_segments(markings.segments, shot, pitch.lines, width_m, into["segment"])
    for kind, spots, places_m in (
        ("crossing", markings.crossings, features.crossings_m),
        ("post", markings.posts, features.posts_m),
        ("mark", markings.penalty_marks, features.penalty_marks_m),
    ):
        found = _score_spots(spots, shot, places_m, into[kind], kinds=features.kinds)
        _expect(_shown_spots(shot, places_m, width_m), found, into[kind])
    arcs = pitch.arcs
    found = _score_spots(markings.circles, shot, arcs[:, :2], into["circle"], radii_m=arcs[:, 2])
    _expect(_shown_circles(shot, arcs, width_m), found, into["circle"])


def _width_px(shot: MarkedFrame, places_m: FloatArray, width_m: float) -> FloatArray:
    """How wide (N,) a line looks at places (N, 2) of the field, whichever way it goes: the narrower one."""
    local = shot.robot.inverse().transform(places_m)
    eye = np.asarray(shot.camera.offset_m)
    away = local - eye
    away /= np.maximum(np.hypot(*away.T), 1e-9)[:, None]
    ends = [shot.camera.floor_to_pixel(local + sign * width_m / 2 * away) for sign in (-1, 1)]
    return np.asarray(np.hypot(*(ends[1] - ends[0]).T))


def _score_segments(
    segments: Sequence[LineSegment], shot: MarkedFrame, lines: FloatArray, width_m: float, into: Tally
) -> None:
    found = set()
    for segment in segments:
        into.told += 1
        best, squared, off_m = -1, math.inf, 0.0
        for index, (x0, y0, x1, y1) in enumerate(lines.tolist()):
            ends = shot.robot.inverse().transform(np.array([[x0, y0], [x1, y1]]))
            way = (ends[1] - ends[0]) / np.hypot(*(ends[1] - ends[0]))
            middle = (np.array(segment.start_m) + segment.end_m) / 2
            at = float((middle - ends[0]) @ way)
            if not -0.1 <= at <= float(np.hypot(*(ends[1] - ends[0]))) + 0.1:
                continue
            angle = math.atan2(-way[0], way[1])
            turn = math.remainder(angle - segment.angle_rad, math.pi)
            normal = np.array([math.cos(segment.angle_rad + turn), math.sin(segment.angle_rad + turn)])
            error = np.array([turn, float(normal @ ends[0]) - segment.distance_m])
            value = float(error @ np.linalg.solve(segment.covariance, error))
            if value < squared:
                best, squared, off_m = index, value, abs(float(normal @ (middle - ends[0])))
        if squared <= GATE2 * 1.31 and off_m < MAX_ERROR_M:
            into.right += 1
            into.errors_m.append(off_m)
            found.add(best)
        if squared < 100:
            into.squared.append(squared)
    for index, (x0, y0, x1, y1) in enumerate(lines.tolist()):
        places = np.linspace([x0, y0], [x1, y1], 200)
        pixels = shot.pixels_of(places)
        wide = _width_px(shot, places, width_m) >= MIN_WIDTH_PX
        step = np.hypot(*np.diff(np.where(wide[:, None], pixels, np.nan), axis=0).T)
        if np.nansum(step) >= MIN_LINE_PX:
            into.expected += 1
            into.found += index in found


def _score_spots(
    spots: Sequence[Crossing] | Sequence[Post] | Sequence[PenaltyMark] | Sequence[Circle],
    shot: MarkedFrame,
    places_m: FloatArray,
    into: Tally,
    *,
    kinds: Sequence[str] = (),
    radii_m: FloatArray | None = None,
) -> set[int]:
    """Count what is told of spots at places (N, 2), or of circles about them; return which of these were found."""
    local = shot.robot.inverse().transform(places_m) if len(places_m) else places_m
    found = set()
    for spot in spots:
        into.told += 1
        error = local - (spot.x_m, spot.y_m)
        squared = np.einsum("ni,ij,nj->n", error, np.linalg.inv(spot.covariance), error)
        if isinstance(spot, Circle) and radii_m is not None:
            squared[np.abs(radii_m - spot.radius_m) > 1e-6] = np.inf
        if not len(squared):
            continue
        best = int(np.argmin(squared))
        off_m = float(np.hypot(*error[best]))
        if squared[best] < 100 and off_m < MAX_ERROR_M:
            into.squared.append(float(squared[best]))
        if squared[best] <= GATE2 * 1.31 and off_m < MAX_ERROR_M:
            into.right += 1
            into.errors_m.append(off_m)
            found.add(best)
            if isinstance(spot, Crossing) and spot.kind is not None:
                into.kinds += 1
                into.right_kinds += spot.kind == kinds[best]
    return found


def _expect(expected: Iterable[int], found: set[int], into: Tally) -> None:
    for index in expected:
        into.expected += 1
        into.found += index in found


def _shown_spots(shot: MarkedFrame, places_m: FloatArray, width_m: float) -> list[int]:
    """Return which of the places (N, 2) are in view with what surrounds them."""
    if not len(places_m):
        return []
    pixels = shot.pixels_of(places_m)
    width, height = shot.camera.size_px
    inside = ((pixels >= AROUND_PX) & (pixels < (width - AROUND_PX, height - AROUND_PX))).all(axis=1)
    wide = _width_px(shot, places_m, width_m) >= MIN_CROSSING_WIDTH_PX
    return np.flatnonzero(inside & wide).tolist()


def _shown_circles(shot: MarkedFrame, arcs: FloatArray, width_m: float) -> Iterator[int]:
    """Yield which of the arcs (N, 5) are in view for a third of a turn."""
    for index, (x, y, radius, start, sweep) in enumerate(arcs.tolist()):
        turn = start + np.linspace(0.0, sweep, 120)
        places = np.stack([x + radius * np.cos(turn), y + radius * np.sin(turn)], axis=1)
        seen = np.isfinite(shot.pixels_of(places)).all(axis=1) & (_width_px(shot, places, width_m) >= MIN_WIDTH_PX)
        if seen.mean() * abs(sweep) >= math.tau / 3:
            yield index


KINDS = ("segment", "crossing", "circle", "post", "mark")


def measure(world: MarkingWorld, shots: Sequence[MarkedFrame], seed: int) -> dict[str, dict[str, Tally]]:
    """Return the tallies of a world's pictures, alone and located, by kind."""
    pitch = world.field
    features, finder = FieldFeatures(pitch, 3.0), MarkingFinder(pitch)
    vision = Vision(pitch, world.camera)
    told: dict[str, dict[str, Tally]] = {mode: {kind: Tally() for kind in KINDS} for mode in ("alone", "located")}
    rng = np.random.default_rng([seed, 0x77])
    for shot in shots:
        alone = finder.find(shot.frame, world.camera)
        score(alone, shot, pitch, features, told["alone"])
        start = Pose2(*(shot.robot.array + PRIOR_STD * rng.standard_normal(3)).tolist())
        view = vision.look(shot.frame, prior=PoseEstimate(start, np.diag(PRIOR_STD**2), 1.0, 0.0))
        vision.forget()
        if view.pose and view.pose.pose.error_to(shot.robot)[0] < 0.3:
            score(view.markings, shot, pitch, features, told["located"])
    return told


@program()
def main(arguments: Namespace) -> None:
    """Measure and print."""
    count = 3 if arguments.quick else 60 if arguments.full else 12
    columns = (
        "camera                     | what: label | recall: rate | precision: rate | kinds: rate | "
        "error m: error 0.005 | NEES | target | verdict: verdict"
    )
    table = Table(columns, name="markings")
    for name, world in WORLDS.items():
        shots = list(marked_frames(world, arguments.seed, count))
        for mode, tallies in measure(world, shots, arguments.seed).items():
            for kind, tally in tallies.items():
                if not tally.told and not tally.expected:
                    continue
                is_met = tally.told == 0 or tally.right >= MIN_PRECISION * tally.told
                if len(tally.squared) >= 20:
                    is_met &= NEES_RANGE[0] <= tally.nees <= NEES_RANGE[1]
                table.row(
                    name,
                    f"{kind}s {mode}",
                    f"{tally.found}/{tally.expected}",
                    f"{tally.right}/{tally.told}",
                    f"{tally.right_kinds}/{tally.kinds}",
                    f"{np.median(tally.errors_m):.3f}" if tally.errors_m else "-",
                    f"{tally.nees:.2f}" if tally.squared else "-",
                    f"precision {MIN_PRECISION:.0%}, NEES 0.5 to 3",
                    verdict(is_met),
                )

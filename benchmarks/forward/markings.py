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
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np

from benchmarks.harness import Table, program, verdict
from benchmarks.worlds.walks import camera_ahead
from field_models import Field, load_field
from robocup_vision import Vision
from robocup_vision.arrays import BoolArray, FloatArray, UInt8Array
from robocup_vision.camera import FisheyeCamera, OmniCamera, PinholeCamera
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.perception.markings.field_features import FieldFeatures
from robocup_vision.perception.markings.finder import MarkingFinder
from robocup_vision.perception.markings.marking import Circle, Crossing, LineSegment, Markings, PenaltyMark, Post
from sim2d.match.setups import CAMERAS
from sim2d.rendering.mirror import MirrorRenderer
from sim2d.rendering.pinhole import render_pinhole
from sim2d.rendering.scene import Light, Robot, Room, Scene
from sim2d.rendering.sensor import Sensor

Camera = OmniCamera | PinholeCamera
# farther beyond a robot's rim than this nothing is hidden by it
_HIDING_M = 0.1


@dataclass(frozen=True)
class MarkingWorld:
    """A field, a camera as its file says, and what robots stand about."""

    field_name: str  #: the pitch
    camera: Camera  #: as its file says; a forward one is held off by what the file states
    robot_size_m: tuple[float, float]  #: radius and height of others

    @cached_property
    def field(self) -> Field:
        """The pitch."""
        return load_field(self.field_name)


_ahead = partial(camera_ahead, height_std_m=0.005, roll_std_deg=0.6)


def _mirror(name: str) -> OmniCamera:
    camera = CAMERAS[name]()
    assert isinstance(camera, OmniCamera)
    return camera


_FISHEYE = FisheyeCamera(
    (480, 360),
    (190.0, 190.0),
    (239.5, 179.5),
    0.75,
    pan_rad=0.0,
    tilt_rad=math.radians(-35.0),
    roll_rad=0.0,
    height_std_m=0.005,
    roll_std_rad=math.radians(0.6),
    projection="equidistant",
)
WORLDS: dict[str, MarkingWorld] = {
    "four-legged, 208 px": MarkingWorld("four_legged_2007", _ahead((208, 160), 192.0, 0.185, -10.0), (0.12, 0.25)),
    "standard platform, 640 px": MarkingWorld("spl_2020", _ahead((640, 480), 616.0, 0.46, -14.0), (0.15, 0.55)),
    "humanoid, 640 px": MarkingWorld("humanoid_kid_2025", _ahead((640, 480), 460.0, 0.6, -25.0), (0.15, 0.8)),
    "small size, 320 px": MarkingWorld("ssl_division_b", _ahead((320, 240), 160.0, 0.12, -10.0), (0.09, 0.15)),
    "middle size, fisheye": MarkingWorld("msl_18x12", _FISHEYE, (0.25, 0.75)),
    "small size, mirror": MarkingWorld("ssl_2001", _mirror("ssl_mirror"), (0.09, 0.14)),
    "middle size, mirror": MarkingWorld("msl_18x12", _mirror("msl_mirror"), (0.25, 0.75)),
}


@dataclass(frozen=True, eq=False)
class MarkedFrame:
    """One picture, and what is true of it."""

    frame: UInt8Array  #: (H, W, 3) uint8: the picture
    camera: Camera  #: as it truly was held
    robot: Pose2  #: where it truly was
    others: tuple[Robot, ...]  #: who stood about

    def pixels_of(self, places_m: FloatArray) -> FloatArray:
        """Pixels (N, 2) of places (N, 2) of the field; NaN where they are out of view, or somebody may hide them."""
        pixels = self.camera.floor_to_pixel(self.robot.inverse().transform(places_m))
        width, height = self.camera.size_px
        seen = (
            np.isfinite(pixels).all(axis=1) & (pixels >= 4).all(axis=1) & (pixels < (width - 4, height - 4)).all(axis=1)
        )
        if isinstance(self.camera, OmniCamera):
            radius = np.hypot(*(pixels - self.camera.center_px).T)
            inner, outer = self.camera.usable_radius_px
            seen &= (radius > inner + 3) & (radius < outer - 3)
        eye = np.array(self.robot.transform(self.camera.offset_m))
        for other in self.others:
            seen &= ~_is_behind(places_m, eye, np.array([other.x_m, other.y_m]), other.radius_m + _HIDING_M)
        return np.asarray(np.where(np.asarray(seen)[:, None], pixels, np.nan))


def _is_behind(places_m: FloatArray, eye_m: FloatArray, robot_m: FloatArray, radius_m: float) -> BoolArray:
    """Whether the way from the eye to places (N, 2) passes a robot."""
    way = places_m - eye_m
    length2 = np.maximum((way**2).sum(axis=1), 1e-12)
    part = np.clip(((robot_m - eye_m) * way).sum(axis=1) / length2, 0.0, 1.0)
    return np.asarray(np.hypot(*(eye_m + part[:, None] * way - robot_m).T) < radius_m)


def marked_frames(world: MarkingWorld, seed: int, count: int) -> Iterator[MarkedFrame]:
    """Yield pictures from places all over a field, the camera held as well as its file says."""
    field, features = world.field, FieldFeatures(world.field)
    mirror = MirrorRenderer(world.camera) if isinstance(world.camera, OmniCamera) else None
    half = np.array([field.length_m, field.width_m]) / 2
    for index in range(count):
        rng = np.random.default_rng([seed, index, 0x3A])
        x, y = (rng.uniform(-0.9, 0.9, 2) * half).tolist()
        heading = float(rng.uniform(-math.pi, math.pi))
        # most look at a crossing or the middle: carpet alone tells nothing
        if rng.random() < 0.8:
            to_x, to_y = ([[0.0, 0.0], *features.crossings_m.tolist()])[
                int(rng.integers(len(features.crossings_m) + 1))
            ]
            heading = math.atan2(to_y - y, to_x - x) + float(rng.normal(0.0, 0.2))
        pose = Pose2(x, y, heading)
        others = []
        for _ in range(int(rng.integers(0, 4))):
            away, bearing = float(rng.uniform(0.25, 1.0)) * field.width_m / 2, float(rng.uniform(-math.pi, math.pi))
            there = pose.transform((away * math.cos(bearing), away * math.sin(bearing)))
            if away > 3 * world.robot_size_m[0]:
                others.append(Robot(float(there[0]), float(there[1]), *world.robot_size_m))
        scene = Scene(
            field,
            robots=tuple(others),
            light=Light(
                level=float(rng.uniform(0.8, 1.05)),
                gradient=float(rng.uniform(0.0, 0.2)),
                texture=0.06,
                texture_seed=int(rng.integers(2**31)),
            ),
            room=Room(seed=int(rng.integers(2**31)), distance_m=float(rng.uniform(0.3, 1.5))),
            carpet_margin_m=0.3,
        )
        camera, sensor = world.camera, Sensor(noise_sigma=3.0, blur_px=0.6, vignette=0.1)
        if isinstance(camera, OmniCamera):
            assert mirror is not None
            light = mirror.render(scene, pose)
        else:
            tilt_std, roll_std = camera.sway_std_rad
            tilt, roll, height = rng.standard_normal(3).tolist()
            camera = replace(camera, height_m=camera.height_m + camera.height_std_m * height)
            camera = camera.with_orientation(0.0, (camera.tilt_rad or 0.0) + tilt_std * tilt, roll_std * roll)
            light = render_pinhole(camera, scene, pose, supersample=2)
        yield MarkedFrame(sensor.expose(light, rng), camera, pose, tuple(others))


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
    features, finder = FieldFeatures(pitch), MarkingFinder(pitch)
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

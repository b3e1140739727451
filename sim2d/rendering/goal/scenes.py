"""Pictures of a goal by a pinhole camera under named conditions, with truth; and pictures without a whole goal.

The 66 places are those of Yako et al., section 3.1 and table 1.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from field_models import Field, Goal
from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray
from robocup_vision.camera import PinholeCamera
from robocup_vision.geometry import Pose2, wrap_angle
from sim2d.rendering.backdrop import Backdrop, BackdropKind
from sim2d.rendering.goal.surroundings import (
    GlareLevel,
    goal_outline,
    lamp_glare,
    lying_ball,
    painted_boards,
    passing_robots,
    screening_robot,
    sun_patch,
)
from sim2d.rendering.pinhole import render_pinhole, smear
from sim2d.rendering.random_scenes import Sample
from sim2d.rendering.scene import Light, Room, Scene
from sim2d.rendering.sensor import Sensor

View = Literal["goal", "no_goal", "half_goal", "goal_behind_robot", "orange_wall"]
NEGATIVE_VIEWS: tuple[View, ...] = ("no_goal", "half_goal", "goal_behind_robot", "orange_wall")

ERS7_FIELD_OF_VIEW_RAD = math.radians(56.9)
FRAME_MARGIN = 0.03  # least distance of a whole goal from the image's border, as a fraction of its width
AIM_SPREAD_RAD = (0.12, 0.10)  # greatest deviations in pan and tilt of the optical axis from the goal's middle
ROLL_STD_RAD = 0.03
TRIES = 200
CLEAR_SHOT = Sensor(noise_sigma=2.0, blur_px=0.5, vignette=0.10)
ROUGH_SHOT = Sensor(noise_sigma=4.0, blur_px=0.7, vignette=0.20, jpeg_quality=90)
BURNT_SHOT = dataclasses.replace(ROUGH_SHOT, bloom=0.4)


def ers7_camera(width: int = 416, height: int = 320) -> PinholeCamera:
    """Return the head camera of a standing AIBO ERS-7, whose neck is at an unknown angle."""
    return _head_camera((width, height), width / 2 / math.tan(ERS7_FIELD_OF_VIEW_RAD / 2), 0.185, 0.005)


def nao_camera(width: int = 640, height: int = 480) -> PinholeCamera:
    """Return the upper head camera of a standing Nao, whose neck is at an unknown angle."""
    return _head_camera((width, height), 616.0 * width / 640, 0.46, 0.01)


def _head_camera(size_px: tuple[int, int], focal: float, height_m: float, height_std_m: float) -> PinholeCamera:
    return PinholeCamera(
        size_px,
        (focal, focal),
        ((size_px[0] - 1) / 2, (size_px[1] - 1) / 2),
        height_m,
        height_std_m=height_std_m,
        roll_std_rad=ROLL_STD_RAD,
    )


@dataclass(frozen=True, slots=True)
class GoalCondition:
    """Disturbances of pictures of a goal, and objects around it."""

    #: Camera for the localiser, without pan, tilt and roll.
    camera: PinholeCamera
    #: Glare on the goal's paint: a few patches, many, or streaks along whole posts and bar.
    glare: GlareLevel = "none"
    #: Noise, blur, compression.
    sensor: Sensor = CLEAR_SHOT
    #: Greatest motion blur along the rows.
    smear_px: float = 0.0
    #: Picture on the room's wall.
    backdrop: BackdropKind = "hall"
    #: Least and greatest number of other robots on the field, none of which hides a post.
    robots: tuple[int, int] = (0, 2)
    #: Greatest number of patches of sunlight.
    sun_patches: int = 0
    #: Standard deviation of the true camera height about the given one.
    height_std_m: float = 0.0


def _ers7_conditions(width: int, height: int) -> dict[str, GoalCondition]:
    camera, size = ers7_camera(width, height), f"{width}x{height}"
    smear_px = 0.8 * width / 416
    return {
        f"clean_{size}": GoalCondition(camera),
        f"mild_glare_{size}": GoalCondition(camera, "mild", ROUGH_SHOT, smear_px),
        f"heavy_glare_{size}": GoalCondition(camera, "heavy", ROUGH_SHOT, smear_px),
        f"streaks_{size}": GoalCondition(camera, "streaks", BURNT_SHOT, smear_px, sun_patches=2),
    }


GOAL_CONDITIONS: dict[str, GoalCondition] = {
    **_ers7_conditions(416, 320),
    **_ers7_conditions(208, 160),
    "white_640x480": GoalCondition(nao_camera(), "mild", ROUGH_SHOT, 0.8, sun_patches=3),
}


@dataclass(frozen=True, eq=False)
class GoalSample(Sample):
    """One picture with its truth; its pose is the camera's foot and the heading of its optical axis."""

    #: The true camera, with its height, tilt and roll; its pan is 0.
    camera: PinholeCamera
    #: The goal at which the camera is aimed.
    goal: Goal
    #: "goal", or why there is none.
    view: View


def paper_places(field: Field) -> list[tuple[float, float]]:
    """Return the 66 places (x, y), field frame, metres, from which Yako et al. photographed the goal at +x.

    A grid of 0.5 m, 0.5 to 5.0 m in front of the goal line and up to 1.5 m to either side, row by row from the goal,
    without the four places from which the goal does not fit into the view. The paper's X increases like y.
    """
    places = []
    for distance in range(50, 501, 50):
        for left in range(-150, 151, 50):
            if (distance == 50 and abs(left) <= 50) or (distance == 100 and left == 0):
                continue
            places.append((field.length_m / 2 - distance / 100, left / 100))
    return places


def sample_goal(
    field: Field,
    condition: GoalCondition,
    seed: int,
    count: int,
    *,
    places: Iterable[tuple[float, float]] | None = None,
    views: tuple[View, ...] = ("goal",),
    indices: Iterable[int] | None = None,
    supersample: int = 8,
) -> Iterator[GoalSample]:
    """Yield pictures; sample i depends on `seed` and i only (and on `places[i]`, if places are given).

    Parameters
    ----------
    field : Field
        Must have goals of posts and a bar.
    count : int
        Samples 0 to count - 1 are made.
    places : sequence of (x, y), optional
        Places of the camera, field frame, metres, in turn; by default random ones in view of a random goal. From given
        places it looks at the goal at +x.
    views : tuple of str
        Sample i shows `views[i % len(views)]`.
    indices : iterable of int, optional
        Make these samples instead.

    Raises
    ------
    ArgumentError
        If the field has no goals of posts, or the goal does not fit into the picture from a given place.
    """
    if not field.goals or any(goal.kind != "posts" for goal in field.goals):
        raise ArgumentError(f"field '{field.name}' has no goals of posts and a bar")
    fixed = None if places is None else list(places)
    if fixed == []:
        raise ArgumentError("places must not be empty")
    for index in range(count) if indices is None else indices:
        rng = np.random.default_rng([seed, index])
        place = None if fixed is None else fixed[index % len(fixed)]
        yield _sample(field, condition, views[index % len(views)], place, index, rng, supersample)


def _sample(
    field: Field,
    condition: GoalCondition,
    view: View,
    place: tuple[float, float] | None,
    index: int,
    rng: np.random.Generator,
    supersample: int,
) -> GoalSample:
    goal = field.goals[0] if place is not None else field.goals[int(rng.integers(len(field.goals)))]
    height_m = condition.camera.height_m + condition.height_std_m * rng.standard_normal()
    camera = dataclasses.replace(condition.camera, height_m=float(height_m))
    for _ in range(TRIES):
        x, y = _random_place(field, goal, rng) if place is None else place
        aimed = _aim(camera, goal, x, y, view, rng)
        if aimed is not None:
            break
    else:
        raise ArgumentError(f"the whole goal is never in view from ({x:.2f}, {y:.2f})")
    pose, camera = aimed
    without_goal = view in ("no_goal", "orange_wall")
    # without nets, because a white net hides the goal slightly
    bare = tuple(dataclasses.replace(one, net=None) for one in field.goals)
    shown = dataclasses.replace(field, goals=() if without_goal else bare)
    robots = passing_robots(field, goal, pose, condition.robots, rng)
    if view == "goal_behind_robot":
        robots = (screening_robot(goal, pose, camera.height_m, rng), *robots)
    scene = Scene(
        field=shown,
        boxes=painted_boards(field, pose, rng) if view == "orange_wall" else (),
        robots=robots,
        ball=lying_ball(field, pose, rng),
        light=Light(
            level=float(rng.uniform(0.85, 1.05)),
            gradient=float(rng.uniform(0.0, 0.15)),
            gradient_direction_rad=float(rng.uniform(-math.pi, math.pi)),
            texture=0.06,
            texture_seed=int(rng.integers(2**31)),
        ),
        room=Room(seed=int(rng.integers(2**31)), distance_m=float(rng.uniform(0.3, 1.5))),
        carpet_margin_m=float(rng.uniform(0.0, 0.3)),
    )
    backdrop = Backdrop("orange" if view == "orange_wall" else condition.backdrop, seed=int(rng.integers(2**31)))
    glare = () if without_goal else lamp_glare(condition.glare, goal, rng)
    sun = tuple(sun_patch(field, rng) for _ in range(int(rng.integers(condition.sun_patches + 1))))
    light = render_pinhole(camera, scene, pose, backdrop=backdrop, glare=glare, sun=sun, supersample=supersample)
    light = smear(light, float(rng.uniform(0.0, condition.smear_px)))
    return GoalSample(condition.sensor.expose(light, rng), scene, pose, index, camera, goal, view)


def _random_place(field: Field, goal: Goal, rng: np.random.Generator) -> tuple[float, float]:
    """Draw a place on the field that is not beside the goal."""
    far = min(field.length_m - 0.3, 7.5)
    while True:
        x = goal.line_x_m - goal.side * rng.uniform(0.5, far)
        y = rng.uniform(-field.width_m / 2, field.width_m / 2)
        if abs(y) < 1.5 * goal.width_m / 2 + 1.2 * abs(goal.line_x_m - x):
            return float(x), float(y)


def _aim(
    camera: PinholeCamera, goal: Goal, x: float, y: float, view: View, rng: np.random.Generator
) -> tuple[Pose2, PinholeCamera] | None:
    """Aim the camera at random so that the picture shows the goal as `view` says; None if that fails."""
    outline = goal_outline(goal) - (x, y, camera.height_m)
    bearing = np.arctan2(outline[:, 1], outline[:, 0])
    middle = float(bearing[0])
    spread = np.remainder(bearing - middle + math.pi, math.tau) - math.pi
    middle += float(spread.max() + spread.min()) / 2
    elevation = np.arctan2(outline[:, 2], np.hypot(outline[:, 0], outline[:, 1]))
    level = float(elevation.max() + elevation.min()) / 2
    roll = float(ROLL_STD_RAD * rng.standard_normal())
    if view in ("no_goal", "orange_wall"):
        tilt = float(rng.uniform(-0.25, 0.2))
        return Pose2(x, y, float(rng.uniform(-math.pi, math.pi))), camera.with_orientation(0.0, tilt, roll)
    width, height = camera.size_px
    half_view = math.atan(width / 2 / camera.focal_px[0])
    strays = rng.uniform(-1, 1, (TRIES, 2)) * AIM_SPREAD_RAD
    for attempt in range(TRIES):
        pan, tilt = strays[attempt] * (1 - attempt / TRIES)  # the last tries hardly stray
        if view == "half_goal":
            # one post is cut by the border or outside, the other is in view
            side = 1.0 if strays[attempt, 0] > 0 else -1.0
            pan = side * (half_view + rng.uniform(-0.4, 0.7) * float(np.ptp(spread)) / 2)
        heading = wrap_angle(middle + pan)
        turned = camera.with_orientation(0.0, float(level + tilt), roll)
        pixels = turned.ray_to_pixel(_turned(outline, heading))
        margin = FRAME_MARGIN * width
        inside = (pixels >= margin) & (pixels <= np.array([width, height]) - 1 - margin)
        seen = inside.all(axis=1).reshape(2, -1)  # one row a post
        if view == "half_goal":
            border = (pixels >= 0) & (pixels <= np.array([width, height]) - 1)
            inside_border = border.all(axis=1).reshape(2, -1)
            if min(inside_border.sum(axis=1)) <= inside_border.shape[1] // 4 and inside_border.any():
                return Pose2(x, y, heading), turned
        elif seen.all():
            return Pose2(x, y, heading), turned
    return None


def _turned(points: FloatArray, heading_rad: float) -> FloatArray:
    """Turn points (N, 3) relative to a viewpoint into the frame with this heading."""
    flat = Pose2(0.0, 0.0, -heading_rad).transform(points[:, :2])
    return np.column_stack([flat, points[:, 2]])

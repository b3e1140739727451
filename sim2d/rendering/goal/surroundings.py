"""Objects and light around a goal in a picture: robots, boards, a ball, glare on its paint, sunlight."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from field_models import COLOR_NAMES, Field, Goal
from robocup_vision.arrays import FloatArray
from robocup_vision.geometry import Pose2
from sim2d.rendering.light import FLOOR, TracedLight
from sim2d.rendering.scene import BOX_COLORS, Ball, Box, Robot

Member = Literal["positive_y", "negative_y", "bar"]
MEMBERS: tuple[Member, ...] = ("positive_y", "negative_y", "bar")
ON_SURFACE_M = 2e-3
GlareLevel = Literal["none", "mild", "heavy", "streaks"]
TRIES = 200


@dataclass(frozen=True, slots=True)
class Glare:
    """A reflection of a lamp on a post or bar: a patch of white light with soft edges on its cylinder."""

    #: +1 for the goal at +x, -1 for the one at -x.
    goal_side: int
    #: One of the posts, or the bar.
    member: Member
    #: Position along the member, as fractions of its length; 0 is its foot (bar: the end at negative y).
    middle: float
    half_length: float
    #: Angle about its axis, 0 towards the camera; pi/2 is its silhouette.
    turn_rad: float
    half_width_rad: float
    #: Light added in the middle, grey levels.
    amplitude: float

    def add_to(self, traced: TracedLight, goal: Goal) -> None:
        """Add this light to the rays that meet the patch."""
        eye, rays = traced.eye, traced.rays
        met = np.flatnonzero(traced.surface != FLOOR)
        x, y, z = traced.x_m[met] - goal.line_x_m, traced.y_m[met], traced.z_m[met]
        radius, half = goal.post_radius_m, goal.width_m / 2
        if self.member == "bar":
            aside = np.stack([x, z - goal.height_m])
            view = np.array([eye.x_m - goal.line_x_m, rays.height_m - goal.height_m])
            along = (y + half) / goal.width_m
        else:
            post_y = half if self.member == "positive_y" else -half
            aside = np.stack([x, y - post_y])
            view = np.array([eye.x_m - goal.line_x_m, eye.y_m - post_y])
            along = z / (goal.height_m + radius)
        on_it = np.abs(np.hypot(*aside) - radius) < ON_SURFACE_M
        on_it &= (along > -0.01) & (along < 1.01)
        aside, along, met = aside[:, on_it], along[on_it], met[on_it]
        turn = np.arctan2(view[0] * aside[1] - view[1] * aside[0], view @ aside)
        away = ((along - self.middle) / self.half_length) ** 4 + ((turn - self.turn_rad) / self.half_width_rad) ** 4
        added = self.amplitude * np.exp(-np.minimum(away, 50.0))
        traced.light[met] += added[:, None].astype(np.float32)


@dataclass(frozen=True, slots=True)
class SunPatch:
    """A parallelogram of sunlight from a window, on the floor and on objects in the beam."""

    #: Its middle, and the direction of its length on the floor.
    x_m: float
    y_m: float
    yaw_rad: float
    #: Size of the patch.
    length_m: float
    width_m: float
    #: Direction of the sun, field frame.
    sun_azimuth_rad: float
    sun_elevation_rad: float
    #: Light in it, relative to the hall's.
    factor: float

    def shine_on(self, traced: TracedLight) -> None:
        """Brighten every ray that meets a point in the sunlight, except on the room's wall."""
        drop = np.maximum(traced.z_m, 0) / math.tan(self.sun_elevation_rad)
        dx = traced.x_m - drop * math.cos(self.sun_azimuth_rad) - self.x_m
        dy = traced.y_m - drop * math.sin(self.sun_azimuth_rad) - self.y_m
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        lit = (np.abs(dx * c + dy * s) <= self.length_m / 2) & (np.abs(dy * c - dx * s) <= self.width_m / 2)
        lit[traced.in_room] = False
        traced.light[lit] *= np.float32(self.factor)


def goal_outline(goal: Goal) -> FloatArray:
    """Return points (N, 3) around the feet and tops of both posts, field frame, metres."""
    turn = np.linspace(0, math.tau, 12, endpoint=False)
    ring = goal.post_radius_m * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    points = []
    for side in (-1, 1):
        for z in (0.0, goal.height_m + goal.post_radius_m):
            feet = ring + np.array([goal.line_x_m, side * goal.width_m / 2])
            points.append(np.column_stack([feet, np.full(len(feet), z)]))
    return np.vstack(points)


def _post_bearings(goal: Goal, pose: Pose2) -> list[tuple[float, float]]:
    """Return (distance, bearing) of the posts at positive and negative y in the pose's frame."""
    posts = pose.inverse().transform([[goal.line_x_m, side * goal.width_m / 2] for side in (1, -1)])
    return [(float(np.hypot(*p)), float(math.atan2(p[1], p[0]))) for p in posts]


def passing_robots(
    field: Field, goal: Goal, pose: Pose2, least_and_most: tuple[int, int], rng: np.random.Generator
) -> tuple[Robot, ...]:
    """Place other robots ahead, none of which hides a post."""
    count = int(rng.integers(least_and_most[0], least_and_most[1] + 1))
    pale = goal.color == "white"  # Naos are white, and taller than dogs
    robots: list[Robot] = []
    for _ in range(TRIES):
        if len(robots) >= count:
            break
        radius = float(rng.uniform(0.08, 0.14))
        distance, bearing = float(rng.uniform(0.6, 4.0)), float(rng.uniform(-0.6, 0.6))
        place = pose.transform([distance * math.cos(bearing), distance * math.sin(bearing)])
        half = math.asin(radius / distance) + 0.02
        hides = any(
            abs(bearing - at) < half + math.asin(min(1.0, goal.post_radius_m / away))
            for away, at in _post_bearings(goal, pose)
        )
        if hides or not field.contains(place):
            continue
        tone = rng.uniform(190, 235) if pale else float(rng.choice([40.0, 60.0, 210.0]))
        height = float(rng.uniform(0.50, 0.58) if pale else rng.uniform(0.16, 0.28))
        marker = BOX_COLORS["red"] if rng.random() < 0.5 else BOX_COLORS["blue"]
        robots.append(Robot(float(place[0]), float(place[1]), radius, height, (tone, tone, tone), marker))
    return tuple(robots)


def screening_robot(goal: Goal, pose: Pose2, eye_height_m: float, rng: np.random.Generator) -> Robot:
    """Place a nearby robot that hides one post from foot to top."""
    away, bearing = _post_bearings(goal, pose)[int(rng.integers(2))]
    radius = float(rng.uniform(0.10, 0.14))
    distance = min(float(rng.uniform(0.35, 0.6)), 0.6 * away)
    place = pose.transform([distance * math.cos(bearing), distance * math.sin(bearing)])
    # seen over its far rim, the bar's upper edge must be covered
    rise = (goal.height_m + goal.post_radius_m - eye_height_m) / (away - goal.post_radius_m)
    height = eye_height_m + max(rise, 0.0) * (distance + radius) + float(rng.uniform(0.03, 0.12))
    tone = rng.uniform(190, 235) if goal.color == "white" else float(rng.choice([40.0, 60.0, 210.0]))
    return Robot(float(place[0]), float(place[1]), radius, height, (tone, tone, tone), BOX_COLORS["red"])


def painted_boards(field: Field, pose: Pose2, rng: np.random.Generator) -> tuple[Box, ...]:
    """Place orange and goal-coloured boards ahead, which have a goal's colour but not its shape."""
    boxes = []
    for color in ("orange", "orange", *(goal.color for goal in field.goals)):
        if rng.random() < 0.4:
            continue
        distance, bearing = float(rng.uniform(1.2, 3.5)), float(rng.uniform(-0.4, 0.4))
        x, y = pose.transform([distance * math.cos(bearing), distance * math.sin(bearing)])
        width, depth, height = (float(v) for v in rng.uniform((0.2, 0.05, 0.15), (1.5, 0.4, 0.6)))
        yaw = pose.theta_rad + float(rng.uniform(-0.5, 0.5)) + math.pi / 2
        boxes.append(Box(float(x), float(y), yaw, width, depth, height, COLOR_NAMES[color]))
    return tuple(boxes)


def lying_ball(field: Field, pose: Pose2, rng: np.random.Generator) -> Ball | None:
    """Place a ball ahead in about half of the pictures."""
    distance, bearing = float(rng.uniform(0.5, 3.0)), float(rng.uniform(-0.45, 0.45))
    x, y = pose.transform([distance * math.cos(bearing), distance * math.sin(bearing)])
    if rng.random() < 0.5 or not field.contains([x, y]):
        return None
    return Ball(float(x), float(y), field.ball_radius_m, COLOR_NAMES[field.ball_color])


def lamp_glare(level: GlareLevel, goal: Goal, rng: np.random.Generator) -> tuple[Glare, ...]:
    """Draw random glare: patches on the upper parts of posts and anywhere on the bar, or streaks.

    A streak occurs where a far lamp is reflected along the whole of a smooth round bar.
    """
    if level == "none":
        return ()
    if level == "streaks":
        return tuple(
            Glare(
                goal_side=goal.side,
                member=member,
                middle=0.5,
                half_length=float(rng.uniform(0.6, 2.0)),
                turn_rad=float(rng.uniform(-1.4, 1.4)),
                half_width_rad=float(rng.uniform(0.15, 0.6)),
                amplitude=float(rng.uniform(150, 600)),
            )
            for member in MEMBERS
            for _ in range(int(rng.integers(0, 3)))
        )
    heavy = level == "heavy"
    patches = []
    for _ in range(int(rng.integers(4, 9) if heavy else rng.integers(1, 4))):
        member = MEMBERS[int(rng.integers(len(MEMBERS)))]
        patches.append(
            Glare(
                goal_side=goal.side,
                member=member,
                middle=float(rng.uniform(0.0, 1.0) if member == "bar" else rng.uniform(0.3, 1.0)),
                half_length=float(rng.uniform(0.06, 0.22) if heavy else rng.uniform(0.04, 0.15)),
                turn_rad=float(rng.uniform(-0.9, 0.9)),
                half_width_rad=float(rng.uniform(0.5, 1.8) if heavy else rng.uniform(0.3, 0.8)),
                amplitude=float(rng.uniform(140, 320) if heavy else rng.uniform(90, 220)),
            )
        )
    return tuple(patches)


def sun_patch(field: Field, rng: np.random.Generator) -> SunPatch:
    """Draw a patch of sunlight anywhere on the field."""
    half = np.array([field.length_m, field.width_m]) / 2
    x, y = rng.uniform(-half, half)
    return SunPatch(
        x_m=float(x),
        y_m=float(y),
        yaw_rad=float(rng.uniform(-math.pi, math.pi)),
        length_m=float(rng.uniform(0.6, 3.0)),
        width_m=float(rng.uniform(0.2, 1.0)),
        sun_azimuth_rad=float(rng.uniform(-math.pi, math.pi)),
        sun_elevation_rad=float(rng.uniform(0.3, 1.0)),
        factor=float(rng.uniform(1.4, 2.2)),
    )

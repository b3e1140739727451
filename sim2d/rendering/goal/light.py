"""What light does to a goal: lamps reflected in its paint, and patches of sun on everything."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from field_models import Goal
from robocup_vision.arrays import FloatArray
from sim2d.rendering.light import TracedLight
from sim2d.rendering.surfaces import FLOOR

Member = Literal["positive_y", "negative_y", "bar"]
MEMBERS: tuple[Member, ...] = ("positive_y", "negative_y", "bar")
ON_SURFACE_M = 2e-3


@dataclass(frozen=True, slots=True)
class Glare:
    """White light that a post or a bar reflects: a soft-edged patch on its round side."""

    #: +1 for the goal at +x, -1 for the one at -x.
    goal_side: int
    #: Which post, or the bar.
    member: Member
    #: Along the member, as fractions of its length; 0 is its foot (bar: the end at negative y).
    middle: float
    half_length: float
    #: About its axis, 0 where it faces the camera; pi/2 is its silhouette.
    turn_rad: float
    half_width_rad: float
    #: Added at the middle, grey levels; enough of it is white whatever the paint.
    amplitude: float

    def add_to(self, traced: TracedLight, goal: Goal) -> None:
        """Add this light to the rays that met the goal's paint there."""
        eye, rays = traced.hits.eye, traced.hits.rays
        met = np.flatnonzero(traced.hits.surface != FLOOR)
        x, y = traced.x_m[met] - goal.line_x_m, traced.y_m[met]
        z = rays.height_m + traced.hits.distance_m[met] * rays.slope[met]
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
    """A window's parallelogram of sunlight, on the floor and on what stands in its beam."""

    #: Its middle and the direction of its length on the floor.
    x_m: float
    y_m: float
    yaw_rad: float
    #: Size of the patch.
    length_m: float
    width_m: float
    #: Where the sun stands, field frame.
    sun_azimuth_rad: float
    sun_elevation_rad: float
    #: Light there, relative to the hall's.
    factor: float

    def shine_on(self, traced: TracedLight) -> None:
        """Brighten every ray that met something sunlit, except the room's wall."""
        rays = traced.hits.rays
        with np.errstate(invalid="ignore"):
            z = np.maximum(rays.height_m + traced.hits.distance_m * rays.slope, 0)
        drop = z / math.tan(self.sun_elevation_rad)
        dx = traced.x_m - drop * math.cos(self.sun_azimuth_rad) - self.x_m
        dy = traced.y_m - drop * math.sin(self.sun_azimuth_rad) - self.y_m
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        lit = (np.abs(dx * c + dy * s) <= self.length_m / 2) & (np.abs(dy * c - dx * s) <= self.width_m / 2)
        lit[traced.in_room] = False
        traced.light[lit] *= np.float32(self.factor)


def goal_outline(goal: Goal) -> FloatArray:
    """Points (N, 3) around both posts' feet and tops, field frame, metres: in view if the whole goal is."""
    turn = np.linspace(0, math.tau, 12, endpoint=False)
    ring = goal.post_radius_m * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    points = []
    for side in (-1, 1):
        for z in (0.0, goal.height_m + goal.post_radius_m):
            feet = ring + np.array([goal.line_x_m, side * goal.width_m / 2])
            points.append(np.column_stack([feet, np.full(len(feet), z)]))
    return np.vstack(points)

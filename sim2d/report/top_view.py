"""Draws the match from above: the truth, and the robots' estimates as rings and crosses."""

from __future__ import annotations

import math

import cv2
import numpy as np

from field_models import COLOR_NAMES, Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.belief import Belief
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from sim2d.robot_link import PlayerStatus
from sim2d.world.state import BallState, RobotMoment, RobotState, WorldState

Bgr = tuple[int, int, int]

# by side: +1 attacks the goal at +x, -1 the other one
SIDE_COLORS: dict[int, Bgr] = {1: (60, 190, 240), -1: (220, 120, 60)}
_ROOM, _INK, _BODY = (70, 72, 75), (245, 245, 245), (40, 38, 36)
# colour of plans; length of a drawn gaze, in robot radii
_PLAN, _GAZE_RADII = (80, 255, 160), 8.0
# smallest drawn radius, so that a robot's number stays readable
_MIN_ROBOT_PX = 8.0
_SHIFT = 4
_MARGIN = 0.04
# an estimate's ellipse holds 95 % of a normal distribution in the plane
_ELLIPSE_SIGMAS = 2.448
# a track is drawn with its path over this time, a hypothesis from this probability on
_AHEAD_S, _MIN_PROBABILITY = 0.5, 0.02


class TopView:
    """Draws world states of one field into pictures of one size.

    Parameters
    ----------
    robot_radius_m : float
        Radius of the playing robots; on a large field they are drawn larger, so that they stay visible.
    """

    def __init__(self, field: Field, size_px: tuple[int, int], robot_radius_m: float) -> None:
        self._ball_m = field.ball_radius_m
        self._ball_bgr = COLOR_NAMES[field.ball_color]
        ends = np.vstack([field.floor_polygon, field.walls.reshape(-1, 2), field.lines.reshape(-1, 2)])
        self._ends_m = np.abs(ends).max(axis=0)
        width, height = size_px
        self._px_per_m = float(np.min((1 - 2 * _MARGIN) * np.array(size_px) / (2 * self._ends_m)))
        self._radius_m = max(robot_radius_m, _MIN_ROBOT_PX / self._px_per_m)
        self._middle = ((width - 1) / 2, (height - 1) / 2)
        self._ground = np.full((height, width, 3), _ROOM, dtype=np.uint8)
        self._draw_ground(field)

    def draw(self, state: WorldState, robots: tuple[RobotMoment, ...] = ()) -> UInt8Array:
        """Return the picture of a moment; without `robots` only the truth is drawn."""
        canvas = self._ground.copy()
        for truth in state.robots:
            self._draw_robot(canvas, truth)
        if state.ball is not None:
            self._draw_ball(canvas, state.ball)
        for truth, robot in zip(state.robots, robots, strict=False):
            color = SIDE_COLORS[truth.side]
            if isinstance(robot.status.pose, PoseEstimate):
                self._draw_estimate(canvas, robot.status.pose, color)
                if robot.status.view is not None and robot.status.view.belief is not None:
                    self._draw_memory(canvas, robot.status.view.belief, color)
                self._draw_plan(canvas, robot.status, robot.status.pose.pose)
            else:
                cv2.putText(
                    canvas, "?", self._whole(truth.pose.x_m, truth.pose.y_m), cv2.FONT_HERSHEY_SIMPLEX, 0.8, _INK, 2
                )
            if robot.status.ball_in_field is not None:
                place = self._whole(*robot.status.ball_in_field)
                cv2.drawMarker(canvas, place, color, cv2.MARKER_TILTED_CROSS, 9, 1, cv2.LINE_AA)
        return canvas

    def _draw_ground(self, field: Field) -> None:
        ground = self._ground
        self._fill(ground, field.floor_polygon, COLOR_NAMES["green"])
        for goal in field.goals:
            half = goal.width_m / 2
            mouth = np.array([[goal.line_x_m, -half], [goal.back_x_m, -half], [goal.back_x_m, half]])
            corners = np.vstack([mouth, [goal.line_x_m, half]])
            tint = ground.copy()
            self._fill(tint, corners, COLOR_NAMES[goal.color])
            cv2.addWeighted(tint, 0.5, ground, 0.5, 0.0, ground)
        paint = COLOR_NAMES[field.line_color]
        thick = max(1, round(field.line_width_m * self._px_per_m))
        for x0, y0, x1, y1 in field.lines.tolist():
            self._path(ground, np.array([[x0, y0], [x1, y1]]), paint, thick)
        for x, y, radius, start, sweep in field.arcs.tolist():
            angles = start + np.linspace(0.0, sweep, 60)
            self._path(ground, np.stack([x + radius * np.cos(angles), y + radius * np.sin(angles)], 1), paint, thick)
        if field.is_bounded:
            for x0, y0, x1, y1 in field.walls.tolist():
                self._path(ground, np.array([[x0, y0], [x1, y1]]), COLOR_NAMES[field.wall_color], 2)
        for beacon in field.beacons:
            # its colour bands are drawn as rings, the lowest outermost
            size_px, bands = max(beacon.radius_m * self._px_per_m, 6.0), len(beacon.colors)
            for band, name in enumerate(beacon.colors):
                radius = round(size_px * (1 - band / bands) * (1 << _SHIFT))
                place = self._fixed(beacon.x_m, beacon.y_m)
                cv2.circle(ground, place, radius, COLOR_NAMES[name], -1, cv2.LINE_AA, _SHIFT)

    def _draw_robot(self, canvas: UInt8Array, robot: RobotState) -> None:
        radius = round(self._radius_m * self._px_per_m * (1 << _SHIFT))
        middle = self._fixed(robot.pose.x_m, robot.pose.y_m)
        cv2.circle(canvas, middle, radius, _BODY, -1, cv2.LINE_AA, _SHIFT)
        cv2.circle(canvas, middle, radius // 2, SIDE_COLORS[robot.side], -1, cv2.LINE_AA, _SHIFT)
        self._draw_heading(canvas, robot.pose, 0.5, 1.0, SIDE_COLORS[robot.side], 2)
        text = str(robot.number)
        (wide, high), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.4, 1)
        u, v = self._whole(robot.pose.x_m, robot.pose.y_m)
        cv2.putText(canvas, text, (u - wide // 2, v + high // 2), cv2.FONT_HERSHEY_SIMPLEX, 0.4, _BODY, 1, cv2.LINE_AA)

    def _draw_ball(self, canvas: UInt8Array, ball: BallState) -> None:
        radius = round(max(self._ball_m * self._px_per_m, 3.0) * (1 << _SHIFT))
        cv2.circle(canvas, self._fixed(ball.x_m, ball.y_m), radius, self._ball_bgr, -1, cv2.LINE_AA, _SHIFT)
        # an outline, for a white ball on a white line
        cv2.circle(canvas, self._fixed(ball.x_m, ball.y_m), radius, _BODY, 1, cv2.LINE_AA, _SHIFT)

    def _draw_estimate(self, canvas: UInt8Array, estimate: PoseEstimate, color: Bgr) -> None:
        pose = estimate.pose
        radius = round(1.25 * self._radius_m * self._px_per_m * (1 << _SHIFT))
        cv2.circle(canvas, self._fixed(pose.x_m, pose.y_m), radius, color, 1, cv2.LINE_AA, _SHIFT)
        self._draw_heading(canvas, pose, 1.25, 1.7, color, 1)
        spread, axes = np.linalg.eigh(estimate.covariance[:2, :2])
        angles = np.linspace(0.0, math.tau, 25)
        circle = np.stack([np.cos(angles), np.sin(angles)])
        around = (axes @ (_ELLIPSE_SIGMAS * np.sqrt(np.maximum(spread, 0.0))[:, None] * circle)).T
        self._path(canvas, Pose2(pose.x_m, pose.y_m, 0.0).transform(around), _INK, 1)

    def _draw_memory(self, canvas: UInt8Array, belief: Belief, color: Bgr) -> None:
        """Draw tracked robots with their velocities, and the other hypotheses of the robot's pose."""
        radius = round(0.35 * self._radius_m * self._px_per_m * (1 << _SHIFT))
        for track in belief.tracks:
            cv2.circle(canvas, self._fixed(track.x_m, track.y_m), radius, color, 1, cv2.LINE_AA, _SHIFT)
            ahead = (track.x_m + _AHEAD_S * track.vx_mps, track.y_m + _AHEAD_S * track.vy_mps)
            self._path(canvas, np.array([[track.x_m, track.y_m], ahead]), color, 1)
        for other in belief.hypotheses[1:]:
            if other.probability >= _MIN_PROBABILITY:
                here = self._fixed(other.pose.x_m, other.pose.y_m)
                cv2.circle(canvas, here, 2 * radius, color, 1, cv2.LINE_AA, _SHIFT)
                self._draw_heading(canvas, other.pose, 0.0, 0.7, color, 1)

    def _draw_plan(self, canvas: UInt8Array, status: PlayerStatus, pose: Pose2) -> None:
        """Draw the line to the next waypoint, the chosen gap, and the direction of the gaze."""
        if status.waypoint_in_field is not None:
            self._path(canvas, np.array([(pose.x_m, pose.y_m), status.waypoint_in_field]), _PLAN, 1)
        if status.gap_in_field is not None:
            self._path(canvas, np.array(status.gap_in_field), _PLAN, 2)
        if status.gaze_rad is not None:
            head = Pose2(pose.x_m, pose.y_m, pose.theta_rad + status.gaze_rad)
            for start in np.arange(1.5, _GAZE_RADII, 1.0).tolist():
                self._path(
                    canvas, head.transform(self._radius_m * np.array([[start, 0.0], [start + 0.5, 0.0]])), _PLAN, 1
                )

    def _draw_heading(self, canvas: UInt8Array, pose: Pose2, low: float, high: float, color: Bgr, thick: int) -> None:
        ends = pose.transform(self._radius_m * np.array([[low, 0.0], [high, 0.0]]))
        self._path(canvas, ends, color, thick)

    def _path(self, canvas: UInt8Array, points_m: FloatArray, color: Bgr, thick: int) -> None:
        points = np.array([self._fixed(x, y) for x, y in points_m.tolist()], dtype=np.int32)
        cv2.polylines(canvas, [points], False, color, thick, cv2.LINE_AA, _SHIFT)

    def _fill(self, canvas: UInt8Array, corners_m: FloatArray, color: Bgr) -> None:
        corners = np.array([self._fixed(x, y) for x, y in corners_m.tolist()], dtype=np.int32)
        cv2.fillPoly(canvas, [corners], color, cv2.LINE_AA, _SHIFT)

    def _fixed(self, x_m: float, y_m: float) -> tuple[int, int]:
        unit = 1 << _SHIFT
        u, v = self._pixel(x_m, y_m)
        return round(u * unit), round(v * unit)

    def _whole(self, x_m: float, y_m: float) -> tuple[int, int]:
        u, v = self._pixel(x_m, y_m)
        return round(u), round(v)

    def _pixel(self, x_m: float, y_m: float) -> tuple[float, float]:
        # OpenCV's integers cannot hold an estimate far off the field
        far_x, far_y = 10 * self._ends_m
        x_m, y_m = max(-far_x, min(far_x, x_m)), max(-far_y, min(far_y, y_m))
        return self._middle[0] + x_m * self._px_per_m, self._middle[1] - y_m * self._px_per_m

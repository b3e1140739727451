"""Where a robot holds the ball: the mouth before its dribbler, what lies in it, and how the dribbler draws it in."""

from __future__ import annotations

import math
from dataclasses import dataclass

import pymunk

from sim2d.world.ball_physics import BallBody


@dataclass(frozen=True, slots=True)
class Mouth:
    """The mouth of one kind of robot."""

    #: From the robot's centre ahead to the centre of a ball that touches its front.
    seat_m: float
    #: To either side of straight ahead.
    half_width_m: float
    #: A ball that lies so far before its seat is still in the mouth.
    depth_m: float = 0.011
    #: The dribbler pulls the ball to its seat like a damped spring.
    stiffness_ps2: float = 900.0
    damping_ps: float = 50.0
    #: Largest acceleration that the dribbler gives it.
    grip_mps2: float = 6.0

    def holds(self, robot: pymunk.Body, ball: BallBody) -> bool:
        """Return whether the ball interrupts the light barrier across the mouth of a robot; one in the air does not."""
        if ball.height_m > ball.radius_m:
            return False
        along, aside = in_robot(robot, ball)
        return 0 < along <= self.seat_m + self.depth_m and abs(aside) <= self.half_width_m

    def dribble(self, robot: pymunk.Body, ball: BallBody, dt_s: float) -> None:
        """Draw a ball in the mouth towards its seat, which turns with the robot."""
        along, aside = in_robot(robot, ball)
        angle, turn = robot.angle, robot.angular_velocity
        c, s = math.cos(angle), math.sin(angle)
        vx, vy = robot.velocity
        bx, by = ball.body.velocity
        off_x, off_y = bx - (vx - turn * s * self.seat_m), by - (vy + turn * c * self.seat_m)
        to_f, to_l = self.seat_m - along, -aside
        k, d = self.stiffness_ps2, self.damping_ps
        ax = k * (c * to_f - s * to_l) - d * off_x
        ay = k * (s * to_f + c * to_l) - d * off_y
        pull = math.hypot(ax, ay)
        kept = min(1.0, self.grip_mps2 / pull) if pull else 0.0
        ball.pull(ax * kept, ay * kept, dt_s)


def in_robot(robot: pymunk.Body, ball: BallBody) -> tuple[float, float]:
    """Return where the ball is, ahead and left of a robot's centre."""
    (x, y), (bx, by) = robot.position, ball.body.position
    c, s = math.cos(robot.angle), math.sin(robot.angle)
    return c * (bx - x) + s * (by - y), -s * (bx - x) + c * (by - y)

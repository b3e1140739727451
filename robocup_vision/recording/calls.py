"""One call of the loop with its exact inputs and outputs, which a replay repeats and compares.

Outputs are recorded as the values that a report shows, and a digest of everything: if two digests are equal, the
outputs agree in every bit.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from robocup_vision.arrays import UInt8Array
from robocup_vision.avoidance.steering import SteeringCommand
from robocup_vision.belief import Belief
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.perception.balls.ball import Ball
from robocup_vision.view import View

# the calls of loop "vision"; other loops have kinds of their own
LOOK, PREDICT, STEER, FORGET = "look", "predict", "steer", "forget"
# input that marks a look without a frame
DROPPED = "is_dropped"


@dataclass(frozen=True, slots=True, eq=False)
class Call:
    """One call."""

    number: int  #: 0, 1, ... in the order of the run
    kind: str  #: what was called
    t_s: float  #: time that the call refers to, else the time of the recording's clock
    #: inputs except for the frame, and outputs
    inputs: Mapping[str, Any]
    outputs: Mapping[str, Any]
    frame: UInt8Array | None = None  #: (H, W, 3) uint8: BGR


def look_outputs(view: View) -> dict[str, Any]:
    """Return the outputs of a look: pose, ball, believed pose and the digest of the view."""
    return {
        "pose": view.pose,
        "ball": view.ball,
        "belief": None if view.belief is None else view.belief.pose,
        "digest": view_digest(view),
    }


def steer_outputs(command: SteeringCommand) -> dict[str, Any]:
    """Return the outputs of steering: velocity, whether it is safe, the reason, and the digest of the command."""
    digest = _Digest()
    digest.add_array(command.velocity_mps)
    digest.add_array(command.time_to_contact_s)
    digest.add_numbers(float(command.safe), command.bearing_rad)
    digest.add_text(command.reason)
    return {
        "velocity_mps": tuple(command.velocity_mps.tolist()),
        "safe": command.safe,
        "reason": command.reason,
        "digest": digest.text,
    }


def view_digest(view: View) -> str:
    """Return a digest of a view's results and belief, without its timings."""
    digest = _Digest()
    digest.add_estimate(view.pose)
    digest.add_estimate(view.measurement)
    arrays = (view.free_space.bearing_rad, view.free_space.range_m, view.boundary_radius_px, view.wall_radius_px)
    for array in (*arrays, view.marks):
        digest.add_array(array)
    for ball in view.balls:
        digest.add_ball(ball)
    digest.add_numbers(view.t_s)
    for warning in view.warnings:
        digest.add_text(warning)
    if view.belief is not None:
        digest.add_belief(view.belief)
    return digest.text


class _Digest:
    def __init__(self) -> None:
        self._hash = hashlib.blake2b(digest_size=16)

    @property
    def text(self) -> str:
        return self._hash.hexdigest()

    def add_array(self, array: np.ndarray[Any, Any]) -> None:
        self.add_text(f"{array.dtype.str}{array.shape}")
        self._hash.update(np.ascontiguousarray(array).tobytes())

    def add_numbers(self, *numbers: float | None) -> None:
        for number in numbers:
            self._hash.update(b"none" if number is None else struct.pack("<d", number))

    def add_text(self, text: str) -> None:
        self._hash.update(text.encode() + b"\0")

    def add_pose(self, pose: Pose2) -> None:
        self.add_numbers(pose.x_m, pose.y_m, pose.theta_rad)

    def add_estimate(self, estimate: PoseEstimate | NotLocated | None) -> None:
        if isinstance(estimate, PoseEstimate):
            self.add_array(estimate.covariance)
            self.add_numbers(estimate.inlier_ratio, estimate.residual_px)
            for pose in estimate.candidates:
                self.add_pose(pose)
        else:
            self.add_text("" if estimate is None else estimate.reason)

    def add_ball(self, ball: Ball) -> None:
        self.add_numbers(ball.x_m, ball.y_m, ball.u_px, ball.v_px, ball.log_likelihood_ratio)
        self.add_array(ball.covariance)

    def add_belief(self, belief: Belief) -> None:
        self.add_numbers(belief.t_s)
        self.add_estimate(belief.pose)
        for hypothesis in belief.hypotheses:
            self.add_pose(hypothesis.pose)
            self.add_array(np.asarray(hypothesis.covariance))
            self.add_numbers(hypothesis.probability)
        for track in belief.tracks:
            self.add_numbers(track.number, track.x_m, track.y_m, track.vx_mps, track.vy_mps, track.probability)
            self.add_numbers(track.frames, track.missed)
            self.add_array(track.covariance)
        if belief.free_map is not None:
            self.add_array(belief.free_map.state)
            self.add_numbers(*belief.free_map.corner_m, belief.free_map.cell_m)

"""Choice of the field half: a pose and its half turn look alike except for goals of two colours.

If the goals look as with red and blue swapped, nothing is decided, because the half would be wrong.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from field_models.field import Field
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.compiling.loops import plain
from robocup_vision.estimates import NotLocated, PoseEstimate, SwappedChannels
from robocup_vision.geometry import Pose2, half_turn_covariance
from robocup_vision.kernels.goal.colors import MirrorProjection, Votes, vote_goal_colors
from robocup_vision.localization.swapped_channels import (
    MAX_NEUTRAL,
    MIN_DISTANCE,
    MIN_RATIO,
    SWAPPED_BY_GOALS,
    goal_points,
    is_inside,
    log_ratios_at,
    swapped_nats,
)
from robocup_vision.perception.color_table import Colors
from robocup_vision.perception.polar_view import hidden_pixels

_NO_VOTES = (0, 0, 0, 0)
# greatest sum of metres and radians between equal poses
_SAME_POSE = 1e-6


def in_both_halves(estimate: PoseEstimate, near: Pose2 | None = None) -> PoseEstimate:
    """Return an estimate with the half turn of each candidate added, unless it is already a candidate."""
    candidates: list[Pose2] = []
    for pose in estimate.candidates:
        turned = pose.half_turn()
        if not any(sum(turned.error_to(other)) < _SAME_POSE for other in candidates):
            candidates += (pose, turned)
    return nearer_half(replace(estimate, candidates=tuple(candidates)), near)


def nearer_half(estimate: PoseEstimate, near: Pose2 | None) -> PoseEstimate:
    """Return an estimate, or its half turn if that is nearer to a pose, in metres and radians together."""
    if near is None:
        return estimate
    turned = estimate.half_turn()
    here, there = (sum(e.pose.error_to(near)) for e in (estimate, turned))
    return turned if there < here else estimate


_MIN_VOTES = 4  # least number of votes for one side, because fewer may be clutter
_MAJORITY = 2  # least ratio to the votes for the other side, which clutter alone seldom reaches
# least difference in (B - R)/(B + G + R) of differently coloured goals
_MIN_HUE_DIFFERENCE = 0.2


class GoalSide:
    """Samples the colours at the goals' places, and chooses the half in which the goals have their own colours.

    Parameters
    ----------
    field : Field
        Gives places and colours of the goals.
    camera : OmniCamera
        Its height must be known, because goals are upright.
    mask : (H, W) uint8, optional
        Non-zero pixels are not used.
    """

    def __init__(
        self,
        field: Field,
        camera: OmniCamera,
        mask: npt.NDArray[np.uint8] | None = None,
    ) -> None:
        self.camera, self.mask = camera, mask
        panelled = {goal.color for goal in field.goals if goal.kind != "posts"}
        #: whether the field has panels of different colours and the camera a height
        self.is_able = len(panelled) == 2 and camera.height_m is not None
        self._points = goal_points(field)
        # a vote is a mean over 3 x 3 pixels
        self._hidden = hidden_pixels(mask)
        q_step, radius = camera.tabulated_radius_px()
        self._projection = plain(
            MirrorProjection(
                np.array(camera.viewpoint_m),
                np.ascontiguousarray(camera.camera_to_robot.T),
                camera.center_px,
                camera.heading_rad,
                camera.mirrored,
                camera.usable_radius_px,
                q_step,
                # points beyond a curve's end get radius zero, which is below the usable radius, and are not used
                np.nan_to_num(radius),
            )
        )

    def choose(
        self, frame: npt.NDArray[np.uint8], estimate: PoseEstimate, colors: Colors, prior: Pose2 | None = None
    ) -> PoseEstimate | NotLocated:
        """Return the estimate with the right half first.

        The estimate must have its half turn as a candidate; the prior orders them if the goals do not decide.

        Returns
        -------
        PoseEstimate or SwappedChannels
            The estimate has one candidate if the goals decide, else both; there is none if swapped channels fit the
            goals better.
        """
        right, wrong, own, swapped = self._vote(frame, estimate.pose, colors) if self.is_able else _NO_VOTES
        decides = max(right, wrong, swapped) >= _MIN_VOTES
        if decides and self._may_be_swapped(own, swapped, colors) and self._are_swapped(frame, estimate.pose, colors):
            return SwappedChannels(SWAPPED_BY_GOALS)
        most = max(right, wrong)
        if most >= _MIN_VOTES and most >= _MAJORITY * min(right, wrong):
            pose, covariance = estimate.pose, estimate.covariance
            if right <= wrong:
                pose, covariance = pose.half_turn(), half_turn_covariance(covariance)
            return PoseEstimate(pose, covariance, estimate.inlier_ratio, estimate.residual_px)
        return nearer_half(estimate, prior)

    def _vote(self, frame: npt.NDArray[np.uint8], pose: Pose2, colors: Colors) -> Votes:
        if colors.goal_hue_difference < _MIN_HUE_DIFFERENCE:
            return _NO_VOTES
        at, palette = (pose.x_m, pose.y_m, pose.theta_rad), colors.goal_palette
        return vote_goal_colors(frame, at, *self._points, self._projection, palette, self._hidden)

    def _may_be_swapped(self, own: int, swapped: int, colors: Colors) -> bool:
        """Whether red and blue may be swapped by the votes, whose white reference may be coloured paint."""
        if colors.swap_distance < MIN_DISTANCE:
            return False
        if own < _MIN_VOTES or MIN_RATIO * swapped > own:
            return True
        return colors.white_cast > MAX_NEUTRAL

    def _are_swapped(self, frame: npt.NDArray[np.uint8], pose: Pose2, colors: Colors) -> bool:
        points, sides = self._points
        on_robot = np.column_stack([pose.inverse().transform(points[:, :2]), points[:, 2]])
        pixels = np.nan_to_num(self.camera.point_to_pixel(on_robot), nan=-1.0)
        radius = np.hypot(*(pixels - self.camera.center_px).T)
        inner, outer = self.camera.usable_radius_px
        shown = (radius >= inner) & (radius <= outer) & is_inside(pixels, frame, self.mask)
        log_ratios = log_ratios_at(frame, pixels, shown)
        return swapped_nats(log_ratios, sides[shown] > 0, colors.goal_log_ratios) > 0.0

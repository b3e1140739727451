"""Evidence of frames about the mountings of a rig's cameras, which share one body.

Every camera's frame is fitted like that of a single camera (`PinholeEvidence`), about the body's pose from this camera
alone. The body's pose and sway are nuisance parameters common to the cameras of one moment, and are eliminated last.
They couple the mountings. A common change of all pans is the body's heading, which no frame determines: it keeps the
value that the files together give.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.calibration.least_squares import POSE_PRECISION, FrameEquations
from robocup_vision.calibration.online.evidence import Belief
from robocup_vision.calibration.online.pinhole import PinholeEvidence
from robocup_vision.calibration.online.settings import OnlineSettings
from robocup_vision.camera.pinhole import Mounting, PinholeCamera
from robocup_vision.camera.rig import Rig
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.view import RigView, View

# parameters of a camera: tilt, roll and height, as the first ones of a single camera, and its pan
_HELD, _PAN, _SIZE = 3, 3, 4
# a frame's nuisance parameters: the body's pose on the field; its sway: nose up, left side up (rad), and up (m)
_POSE, _BODY = 3, 6
# standard deviation of changes of the lens, which is practically fixed, in each parameter's unit
_LENS_STD = 1e-6


class _Terms(NamedTuple):
    """A camera's information (10, 10) and gradient (10,) on parameters, body pose and sway; sway precision (3,)."""

    information: FloatArray
    gradient: FloatArray
    sway: FloatArray


class RigEvidence:
    """Computes evidence from the frames of a rig.

    The parameters, for each camera: tilt, roll (rad) and height (m) at rest, pan (rad).

    Parameters
    ----------
    rig : Rig
        The rig of its files, with known tilts.
    masks : sequence of ((H, W) uint8 or None), optional
        As in `Vision`.
    """

    slices = None
    tries_others = False

    def __init__(
        self, field: Field, rig: Rig, masks: Sequence[UInt8Array | None] | None, settings: OnlineSettings
    ) -> None:
        self._rig = rig
        self._max_turn_rad = 2.0 * settings.max_tilt_rad
        self._eyes = tuple(
            PinholeEvidence(field, camera, mask, settings)
            for camera, mask in zip(rig.cameras, masks or (None,) * len(rig), strict=True)
        )
        angle = settings.pinhole.tilt_std_rad
        self.start = self.vector(rig)
        pans = [camera.pan_std_rad or angle for camera in rig.cameras]
        self.std = np.concatenate([[*eye.std[:_HELD], pan] for eye, pan in zip(self._eyes, pans, strict=True)])
        self.knock_std = np.concatenate([[*eye.knock_std[:_HELD], angle] for eye in self._eyes])
        self.reach = np.concatenate([[*eye.reach[:_HELD], settings.max_tilt_rad] for eye in self._eyes])

    def vector(self, rig: Rig) -> FloatArray:
        """Return the parameters (4 n,) of a rig of n cameras."""
        cameras = zip(self._eyes, rig.cameras, strict=True)
        return np.concatenate([[*eye.vector(camera)[:_HELD], camera.pan_rad or 0.0] for eye, camera in cameras])

    def camera(self, vector: FloatArray) -> Rig:
        """Return the rig with parameters (4 n,)."""
        cameras = tuple(
            replace(eye.camera(_with_lens(eye, held)), pan_rad=float(held[_PAN]))
            for eye, held in zip(self._eyes, vector.reshape(-1, _SIZE), strict=True)
        )
        return replace(self._rig, cameras=cameras)

    def mountings(self, vector: FloatArray, std: FloatArray) -> tuple[Mounting, ...]:
        """Return parameters (4 n,) and their standard deviations as mountings."""
        return tuple(
            Mounting(pan, tilt, roll, height, pan_std, tilt_std, roll_std, height_std)
            for (tilt, roll, height, pan), (tilt_std, roll_std, height_std, pan_std) in zip(
                vector.reshape(-1, _SIZE).tolist(), std.reshape(-1, _SIZE).tolist(), strict=True
            )
        )

    def shift_px(self, rig: Rig, other: Rig) -> float:
        """Greatest distance between the images of the same places in two rigs."""
        return max(eye.shift_px(*pair) for eye, *pair in zip(self._eyes, rig.cameras, other.cameras, strict=True))

    def watch(self, view: View) -> None:
        """Update the cameras' turning rates with a view."""
        assert isinstance(view, RigView)
        for eye, one in zip(self._eyes, view.views, strict=True):
            eye.watch(one)

    def of(self, frame: Sequence[UInt8Array | None], view: View, belief: Belief) -> FrameEquations | None:
        """Return the evidence of simultaneous frames, see `EvidenceMaker`; a missing frame is None."""
        assert isinstance(view, RigView)
        assert view.pose
        size = len(belief.start)
        information, gradient = np.zeros((size + _BODY, size + _BODY)), np.zeros(size + _BODY)
        body = np.array([POSE_PRECISION] * _POSE + [math.inf] * (_BODY - _POSE))
        for number, (eye, shown, one) in enumerate(zip(self._eyes, frame, view.views, strict=True)):
            own = slice(_SIZE * number, _SIZE * (number + 1))
            of_eye = Belief(belief.mean[own], belief.covariance[own, own], belief.start[own])
            terms = None if shown is None else self._of_camera(eye, shown, one, view.pose.pose, of_eye)
            if terms is not None:
                places = np.r_[own, size : size + _BODY]
                information[np.ix_(places, places)] += terms.information
                gradient[places] += terms.gradient
                body[_POSE:] = np.minimum(body[_POSE:], terms.sway)
        if not np.isfinite(body).all():
            return None
        return FrameEquations(information, gradient, body, np.zeros(_BODY))

    def _of_camera(
        self, eye: PinholeEvidence, frame: UInt8Array, view: View, body: Pose2, belief: Belief
    ) -> _Terms | None:
        """Return one camera's evidence, with the body's pose from all cameras; None if it is too little."""
        held = view.camera
        measured = self._measured(view)
        if measured is None or not view.pose or not isinstance(held, PinholeCamera):
            return None
        wide = np.diag(np.full(len(eye.start), _LENS_STD**2))
        wide[:_HELD, :_HELD] = belief.covariance[:_HELD, :_HELD]
        place, expected = measured.compose(held.camera_in_robot), view.pose.pose.compose(held.camera_in_robot)
        with_lens = Belief(_with_lens(eye, belief.mean), wide, _with_lens(eye, belief.start))
        found = eye.equations(frame, held, place, with_lens)
        if found is None:
            return None
        own = np.r_[:_HELD, len(eye.start) : len(eye.start) + _BODY]
        by = _by_body(held, expected, body)
        off = np.zeros(len(own))
        off[_HELD : _HELD + _POSE] = expected.array - place.array
        off[_HELD + _POSE - 1] = wrap_angle(expected.theta_rad - place.theta_rad)
        # the edges were linearised at the sway in this frame's fit
        off[_HELD + _POSE :] = found.own_gradient[_POSE:] / found.own[_POSE:]
        information = found.information[np.ix_(own, own)]
        gradient = found.gradient[own] - information @ off
        return _Terms(by.T @ information @ by, by.T @ gradient, found.own[_POSE:])

    def _measured(self, view: View) -> Pose2 | None:
        """Return the body's pose from one camera alone; None if it disagrees with the common pose."""
        estimate = view.pose if view.measurement is None else view.measurement
        if not estimate or not view.pose:
            return None
        common = view.pose.pose
        nearest = min(estimate.candidates, key=lambda one: one.error_to(common)[0])
        is_same = abs(wrap_angle(nearest.theta_rad - common.theta_rad)) <= self._max_turn_rad
        return nearest if is_same else None


def _with_lens(eye: PinholeEvidence, held: FloatArray) -> FloatArray:
    """Return a single camera's parameters from its mounting, and the lens of its file."""
    return np.concatenate([held[:_HELD], eye.start[_HELD:]])


def _by_body(held: PinholeCamera, place: Pose2, body: Pose2) -> FloatArray:
    """(9, 10) float64: derivatives of a camera's mounting, pose and sway by its parameters, and body pose and sway."""
    by = np.zeros((_HELD + _BODY, _SIZE + _BODY))
    by[:_HELD, :_HELD] = np.eye(_HELD)
    x, y, turn, tilt, roll, height = range(_HELD, _HELD + _BODY)
    body_x, body_y, body_turn, nose_up, left_up, up = range(_SIZE, _SIZE + _BODY)
    by[x, body_x] = by[y, body_y] = by[turn, body_turn] = by[turn, _PAN] = by[height, up] = 1.0
    by[x, body_turn], by[y, body_turn] = body.y_m - place.y_m, place.x_m - body.x_m
    by[height, nose_up], by[height, left_up] = held.offset_m
    # R = Rz(pan) Ry(-tilt) Rx(roll), turned by the body's small rotation
    pan, down = held.pan_rad or 0.0, held.tilt_rad or 0.0
    by[tilt, nose_up], by[tilt, left_up] = math.cos(pan), math.sin(pan)
    about = np.array([-math.sin(pan), math.cos(pan)])
    by[roll, nose_up : left_up + 1] = about / math.cos(down)
    by[turn, nose_up : left_up + 1] = -math.tan(down) * about
    return by

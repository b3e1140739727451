"""Estimation of errors in a camera file while a robot plays, from a knock, a warm mount or a rough calibration.

Every few frames the visible edges are fitted with the camera's parameters free within their present covariance, and
the robot's pose is marginalised. An information filter combines the frames, forgets slowly, and detects knocks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, cast

import numpy as np

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.calibration.least_squares import FrameEquations
from robocup_vision.calibration.online.evidence import Belief, Evidence
from robocup_vision.calibration.online.mirror import MirrorEvidence
from robocup_vision.calibration.online.parameter_filter import ParameterFilter
from robocup_vision.calibration.online.pinhole import PinholeEvidence
from robocup_vision.calibration.online.rig import RigEvidence
from robocup_vision.calibration.online.settings import OnlineSettings
from robocup_vision.camera.files import save_camera
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import Mounting, PinholeCamera
from robocup_vision.camera.rig import Rig, save_rig
from robocup_vision.view import View

_USUAL_STEP_S = 1 / 30  # assumed time between frames without times


Camera = OmniCamera | PinholeCamera | Rig


class EvidenceMaker(Protocol):
    """Interface of one kind of camera: its parameters as a vector, and evidence about them.

    Attributes
    ----------
    start, std, knock_std, reach : (G,) float64
        The file's values, their standard deviations, those of a knock's changes, and the bounds of the total change.
    tries_others : bool
        Whether other parameters are tried while the robot is not located.
    """

    start: FloatArray
    std: FloatArray
    knock_std: FloatArray
    reach: FloatArray
    tries_others: bool

    @property
    def slices(self) -> tuple[slice, slice, int] | None:
        """Indices of the centre, the tilt, and the logarithm of the scale in the vector; None for a rig."""
        ...

    def vector(self, camera: Any) -> FloatArray:
        """Return the parameters of a camera."""
        ...

    def camera(self, vector: FloatArray) -> Any:
        """Return the camera with these parameters."""
        ...

    def shift_px(self, camera: Any, other: Any) -> float:
        """Greatest distance between the images of the same places in two cameras."""
        ...

    def watch(self, view: View) -> None:
        """Update with a view, whether or not its frame is used."""
        ...

    def of(self, frame: Any, view: View, belief: Belief) -> FrameEquations | None:
        """Return a frame's equations about the belief's start.

        None if it has too few points, or most of them contradict the field.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            BGR; for a rig a sequence with one for each camera, or None.
        """
        ...


def _make_evidence(
    field: Field,
    camera: Camera,
    mask: UInt8Array | Sequence[UInt8Array | None] | None,
    settings: OnlineSettings,
) -> EvidenceMaker:
    if isinstance(camera, Rig):
        if mask is not None and len(mask) != len(camera):
            raise ArgumentError(f"mask of a rig must be a sequence of {len(camera)}, None for a camera without one")
        return RigEvidence(field, camera, cast("Sequence[UInt8Array | None] | None", mask), settings)
    if isinstance(camera, PinholeCamera):
        return PinholeEvidence(field, camera, cast("UInt8Array | None", mask), settings)
    return MirrorEvidence(field, camera, cast("UInt8Array | None", mask), settings)


@dataclass(frozen=True, slots=True)
class OnlineState:
    """State of an online calibration."""

    #: centre and tilt in use; for a pinhole camera the tilt is its tilt and roll
    center_px: tuple[float, float]
    tilt_rad: tuple[float, float]
    #: their standard deviations
    center_std_px: tuple[float, float]
    tilt_std_rad: tuple[float, float]
    #: scale of the image about its centre relative to the camera file, and its standard deviation
    scale: float
    scale_std: float
    moved_px: float  #: distance of the centre from that in the camera file
    tilted_rad: float  #: difference of the tilt from that in the camera file
    at_bound: bool  #: whether the estimate is at the bound: the camera needs a calibration, or its mount is loose
    steps: int  #: number of changes of the camera so far
    knocks: int  #: number of detected knocks

    def __str__(self) -> str:
        moved = f"centre moved by {self.moved_px:.2f} px, tilt by {math.degrees(self.tilted_rad):.2f} deg"
        return moved + (", at the bound: calibrate again" if self.at_bound else "")


class OnlineCalibration:
    """Refines a camera with the frames of a `Vision`, to which it is passed as `online`.

    Parameters
    ----------
    camera : OmniCamera, PinholeCamera or Rig
        As in its file: start, and centre of the bounds. In a rig pan, tilt, roll and height of each camera are refined.
    """

    def __init__(
        self,
        field: Field,
        camera: Camera,
        mask: UInt8Array | Sequence[UInt8Array | None] | None = None,
        settings: OnlineSettings = OnlineSettings(),
    ) -> None:
        self.camera = camera
        self.settings = settings
        for one in camera.cameras if isinstance(camera, Rig) else (camera,):
            if isinstance(one, PinholeCamera) and not one.known_orientation:
                raise ArgumentError("online calibration of a pinhole camera needs its tilt_rad in the camera file")
        frames = self._frames = _make_evidence(field, camera, mask, settings)
        self._filter = ParameterFilter(frames.start, frames.std, frames.knock_std, settings.filter)
        self._now = frames.start.copy()
        self._t_s = self._used_s = self._stepped_s = -math.inf
        self._located_s: float | None = None
        self._is_trying, self._tried = False, 0
        self._steps = 0

    @property
    def state(self) -> OnlineState:
        """Current camera and its uncertainty; raises ArgumentError for a rig, which has `mountings`."""
        start, std = self._frames.start, self._filter.std
        if self._frames.slices is None:
            raise ArgumentError("an online calibration of a rig has no state of one camera: see its mountings")
        center, tilt, scale = self._frames.slices
        moved = np.abs(self._now - start)
        low, high = start - self._frames.reach, start + self._frames.reach
        (u, v), (first, second) = self._now[center].tolist(), self._now[tilt].tolist()
        (u_std, v_std), (first_std, second_std) = std[center].tolist(), std[tilt].tolist()
        return OnlineState(
            (u, v),
            (first, second),
            (u_std, v_std),
            (first_std, second_std),
            math.exp(float(self._now[scale] - start[scale])),
            float(std[scale]),
            float(np.hypot(*moved[center])),
            float(np.hypot(*moved[tilt])),
            bool(np.minimum(self._now - low, high - self._now).min() < 1e-9),
            self._steps,
            self._filter.knocks,
        )

    @property
    def mountings(self) -> tuple[Mounting, ...]:
        """Current mounting of each camera of a rig, with its uncertainty; raises ArgumentError without a rig."""
        if not isinstance(self._frames, RigEvidence):
            raise ArgumentError("an online calibration of one camera has no mountings: see its state")
        return self._frames.mountings(self._now, self._filter.std)

    @property
    def mean(self) -> FloatArray:
        """(G,) float64: estimate of the camera's parameters, see `parameters_of`."""
        return self._filter.mean.copy()

    @property
    def covariance(self) -> FloatArray:
        """(G, G) float64: covariance of the estimate."""
        return self._filter.covariance.copy()

    def parameters_of(self, camera: Camera) -> FloatArray:
        """Return the parameters (G,) of a camera of the same kind.

        A mirror camera's: centre u, v (px), tilt about x, y (rad), logarithm of the curve's magnification. A pinhole
        camera's: tilt, roll (rad), height (m), logarithm of the focal length's scale, centre u, v (px). A rig's, for
        each camera: tilt, roll (rad), height (m), pan (rad).
        """
        return self._frames.vector(camera)

    def shift_px(self, other: Camera) -> float:
        """Greatest distance between the images of the same places in the present and another camera."""
        return self._frames.shift_px(self.camera, other)

    def follow(self, frame: Any, view: View) -> Camera | None:
        """Update with a frame (H, W, 3) uint8, for a rig a sequence, and its view; return a new camera, or None."""
        self._frames.watch(view)
        self._t_s = view.t_s if view.t_s is not None else max(self._t_s, 0.0) + _USUAL_STEP_S
        if view.pose or self._located_s is None:
            self._located_s = self._t_s
        elif self._t_s - self._located_s > self.settings.lost_s:
            return self._try()
        since_s = self._t_s - self._used_s
        if not view.pose or 0.0 <= since_s < self.settings.every_s - 1e-9:
            return None
        if view.pose.inlier_ratio < self.settings.min_inlier_ratio:
            return None
        start = self._now if self._is_trying or not self._frames.tries_others else self._filter.mean
        equations = self._frames.of(frame, view, Belief(self._filter.mean, self._filter.widened, start))
        if equations is None:
            return None
        evidence = Evidence(start.copy(), *equations.reduced())
        dt_s = since_s if 0.0 < since_s < math.inf else self.settings.every_s
        self._used_s, self._is_trying = self._t_s, False
        self._filter.take(evidence, view.pose.pose.compose(view.camera.camera_in_robot), dt_s)
        return self._step()

    def _try(self) -> Camera | None:
        """Return another possible camera while the robot is not located."""
        settings, frames, belief = self.settings, self._frames, self._filter
        if not frames.tries_others or 0.0 <= self._t_s - self._stepped_s < settings.min_step_s:
            return None
        now = frames.camera(belief.mean)
        offs = [off for sigmas in settings.tries for off in np.diag(sigmas * belief.std)]
        others = [belief.mean + off for off in offs]
        tries = [one for one in others if frames.shift_px(now, frames.camera(one)) > settings.min_try_px]
        tries.insert(0, belief.mean)
        if len(tries) == 1:
            return None
        self._tried = (self._tried + 1) % len(tries)
        self._is_trying = True
        return self._use(tries[self._tried])

    def _step(self) -> Camera | None:
        """Return the estimated camera if it differs significantly from the present one."""
        if 0.0 <= self._t_s - self._stepped_s < self.settings.min_step_s:
            return None
        vector = self._bounded(self._filter.mean)
        moved = vector - self._now
        if moved @ np.linalg.solve(self._filter.covariance, moved) < self.settings.min_step_sigmas**2:
            return None
        if self._frames.shift_px(self.camera, self._frames.camera(vector)) < self.settings.min_step_px:
            return None
        return self._use(vector)

    def _bounded(self, vector: FloatArray) -> FloatArray:
        frames = self._frames
        return np.clip(vector, frames.start - frames.reach, frames.start + frames.reach)

    def _use(self, vector: FloatArray) -> Camera:
        self._now, self._stepped_s = vector, self._t_s
        self._steps += 1
        self.camera = self._frames.camera(vector)
        return self.camera

    def save(self, path: str | Path) -> None:
        """Write the present camera as a camera file, or a rig as a rig file with its camera files beside it."""
        if isinstance(self.camera, Rig):
            save_rig(self.camera, path)
        else:
            save_camera(self.camera, path)

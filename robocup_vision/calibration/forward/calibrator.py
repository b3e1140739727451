"""Fit of a forward camera from approximate starts, to pictures that are located one by one.

Pictures are located with a start, within a wide uncertainty, and then camera and poses are fitted together
(`joint_fit`). With the result more pictures are located, by farther lines, and the fit is repeated. Only the starts
that locate most pictures are fitted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.calibration.forward.joint_fit import JointFit, JointFitter, Sighting
from robocup_vision.calibration.forward_parameters import ForwardParameters
from robocup_vision.calibration.not_calibrated import NotCalibrated
from robocup_vision.calibration.starts import StartTrials
from robocup_vision.camera.fisheye import FisheyeCamera
from robocup_vision.camera.pinhole import SWAY_STD_RAD, PinholeCamera
from robocup_vision.geometry import Pose2
from robocup_vision.progress import progress

# number of pictures by which starts are compared; a start that locates none of the first half is discarded
_START_FRAMES = 6
# number of starts that are fitted to all pictures
_STARTS_FOLLOWED = 4

# locates a camera from one picture, optionally near a pose: probability of the pose, and sighting
Locate = Callable[[UInt8Array, Pose2 | None], tuple[float, Sighting] | None]


class Locator(Protocol):
    """Locates cameras in single pictures."""

    @property
    def nothing(self) -> str:
        """Message if no start locates any picture."""
        ...

    def of_start(self, camera: PinholeCamera) -> Locate:
        """Return a function that locates a start camera."""
        ...

    def of_fit(self, fit: JointFit) -> Locate:
        """Return a function that locates a fitted camera."""
        ...


@dataclass(frozen=True, eq=False)
class Calibrator:
    """Fits cameras to pictures of a field."""

    field: Field
    frames: Mapping[int, UInt8Array]  #: (H, W, 3) uint8, BGR, by index
    prior: Mapping[int, Pose2]  #: approximate poses of the camera, as far as known
    locator: Locator
    sway_std_rad: float = SWAY_STD_RAD  #: see `JointFitter`

    def best(self, starts: Sequence[PinholeCamera], trials: StartTrials) -> JointFit | NotCalibrated:
        """Return the fit with which most pictures agree, among those from the best starts."""
        some = dict(list(self.frames.items())[:: -(-len(self.frames) // _START_FRAMES)])
        ranks = trials.results(_RankStart(some, self.prior, self.locator), starts, "starts")
        order = sorted(range(len(starts)), key=lambda place: ranks[place], reverse=True)
        likely = [starts[place] for place in order[:_STARTS_FOLLOWED] if ranks[place] > 0.0]
        if not likely:
            return NotCalibrated(self.locator.nothing)
        followed = [self._followed(start) for start in progress(likely, len(likely), "likeliest starts")]
        fits = [fit for fit in followed if fit is not None]
        if not fits:
            return NotCalibrated("too little of lines, goals and walls is in view in the images")
        best = max(fits, key=lambda fit: (len(fit.unknowns), -fit.rms_px))
        return self.again(best) or best

    def _followed(self, start: PinholeCamera) -> JointFit | None:
        """Locate pictures with a start, and fit; then repeat both with the result."""
        upright = start.with_orientation(0.0, start.tilt_rad, start.roll_rad or 0.0)
        parameters = ForwardParameters(upright, bends=isinstance(start, FisheyeCamera) or start.is_bent)
        first = self.located(self.locator.of_start(upright))
        fit = self.fitted(parameters, first, parameters.vector(parameters.start))
        return None if fit is None else self.again(fit)

    def again(self, fit: JointFit) -> JointFit | None:
        """Locate pictures one by one with a fitted camera, and fit it again."""
        return self.fitted(fit.parameters, self.located(self.locator.of_fit(fit)), fit.vector)

    def located(self, locate: Locate) -> dict[int, Sighting]:
        """Return the located pictures."""
        found = {index: locate(frame, self.prior.get(index)) for index, frame in self.frames.items()}
        return {index: one[1] for index, one in found.items() if one is not None}

    def fitted(
        self, parameters: ForwardParameters, sightings: Mapping[int, Sighting], vector: FloatArray
    ) -> JointFit | None:
        """Fit camera and poses to located pictures; None if no picture agrees."""
        return JointFitter(self.field, parameters, self.sway_std_rad).fit(sightings, vector)


@dataclass(frozen=True, eq=False)
class _RankStart:
    frames: Mapping[int, UInt8Array]
    prior: Mapping[int, Pose2]
    locator: Locator

    def __call__(self) -> Callable[[PinholeCamera], float]:
        def rank(camera: PinholeCamera) -> float:
            """Return the expected number of pictures that a camera locates."""
            locate = self.locator.of_start(camera)
            total = 0.0
            for number, (index, frame) in enumerate(self.frames.items()):
                if 2 * number >= len(self.frames) and total < 0.5:
                    break
                answer = locate(frame, self.prior.get(index))
                if answer is not None:
                    total += answer[0]
            return total

        return rank

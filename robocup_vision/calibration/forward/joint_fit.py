"""Joint fit of one camera and its poses in several pictures to the visible edges of the field.

The parameters common to all pictures are one vector (`ForwardParameters`). Each picture has its own place, heading, and
deviations of tilt, roll and height from their means. Edges are predicted and searched again in every step.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.calibration.edge_points import EdgePointFinder
from robocup_vision.calibration.forward_parameters import HEIGHT, LINE_WIDTH, ForwardParameters
from robocup_vision.calibration.least_squares import (
    POSE_PRECISION,
    FrameEquations,
    Noise,
    Residuals,
    Robust,
    frame_equations,
    sandwich,
    solve,
)
from robocup_vision.camera.lens_table import lens_table
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.kernels.model_edges import tables
from robocup_vision.localization.model_edges.settings import DESIGN_WIDTH_PX

# indices of tilt, roll and height in the unknowns of `kernels.model_edges`
_MOUNTING = slice(tables.TILT, tables.HEIGHT + 1)
# standard deviation of a body's height about its rest
SWAY_STD_M = 0.003
# noise of a single sample, and common noise of the samples of an edge, in pixels of any picture; gates of the first
# steps in pixels of a picture 208 wide, decreasing from a start's error to the noise; and least number of samples of a
# picture
_ROBUST = Robust(Noise(0.15, 0.2), (4.0, 4.0, 3.0, 2.0, 1.5), 12)
# number of steps after the gates
_LAST_STEPS = 5
# greatest spread of a picture's residuals relative to the median picture's; pictures above it have a wrong pose
_MAX_SPREAD_RATIO = 3.0


@dataclass(frozen=True, eq=False)
class Sighting:
    """A located picture."""

    frame: UInt8Array  #: (H, W, 3) uint8: BGR
    #: (7,) float64: unknowns of `kernels.model_edges`: the camera's place, heading, tilt, roll and height; then 0
    unknowns: FloatArray
    edges: tables.FieldEdges  #: the field's edges, with the paint brightness of the picture


@dataclass(frozen=True, eq=False)
class JointFit:
    """A camera fitted to several pictures."""

    camera: PinholeCamera  #: the result
    parameters: ForwardParameters  #: meaning of the vector
    #: (G,), (G, G) float64: common parameters: tilt, roll (rad), height (m), logarithm of the focal length, ...
    vector: FloatArray
    covariance: FloatArray
    unknowns: Mapping[int, FloatArray]  #: unknowns of `kernels.model_edges` for each agreeing picture
    residual_px: Mapping[int, FloatArray]  #: residuals of the inliers in each of them

    @property
    def rms_px(self) -> float:
        """Root mean square of the residuals of all inliers."""
        return math.sqrt(float(np.mean(np.concatenate(list(self.residual_px.values())) ** 2)))


@dataclass(frozen=True, slots=True, eq=False)
class _Picture:
    """Equations of a picture at one state."""

    equations: FrameEquations
    information: FloatArray
    gradient: FloatArray
    residual_px: FloatArray
    spread_px: float


class JointFitter:
    """Fits cameras with one lens model to pictures of one field.

    Parameters
    ----------
    parameters : ForwardParameters
        Free parameters, and the start.
    sway_std_rad : float
        Standard deviation of tilt and roll about their means, if the start does not state it.
    """

    def __init__(self, field: Field, parameters: ForwardParameters, sway_std_rad: float) -> None:
        self._parameters, start = parameters, parameters.start
        self._finder = EdgePointFinder(field, start.size_px[0])
        self._robust = _ROBUST.scaled(max(start.size_px[0] / DESIGN_WIDTH_PX, 1.0), 1.0)
        sway = sway_std_rad if start.roll_std_rad is None else start.roll_std_rad
        self._own = np.array([POSE_PRECISION] * 3 + [sway**-2, sway**-2, SWAY_STD_M**-2])

    def fit(self, sightings: Mapping[int, Sighting], vector: FloatArray) -> JointFit | None:
        """Fit a camera and its poses.

        Parameters
        ----------
        sightings : mapping of int to Sighting
            Pictures, by index.
        vector : (G,) float64
            Start of the fit; the prior is about the parameters' start.

        Returns
        -------
        JointFit or None
            None if no picture agrees.
        """
        start = self._parameters.vector(self._parameters.start)
        prior = np.diag(self._parameters.start_std**-2.0)
        unknowns = {index: one.unknowns.copy() for index, one in sightings.items()}
        pictures: dict[int, _Picture] = {}
        total = prior
        for gate in (*self._robust.gates_px, *[0.0] * _LAST_STEPS):
            camera = self._parameters.camera(vector)
            lens = lens_table(camera)
            seen = {i: self._linearised(sightings[i], one, vector, camera, lens, gate) for i, one in unknowns.items()}
            pictures = {index: picture for index, picture in seen.items() if picture is not None}
            if not gate:
                pictures = self._without_misplaced(pictures)
            if not pictures:
                return None
            total = prior + sum(one.information for one in pictures.values())
            pull = prior @ (start - vector) + sum(one.gradient for one in pictures.values())
            step = solve(total, pull)
            vector = vector + step
            unknowns = {index: unknowns[index] for index in pictures}
            for index, picture in pictures.items():
                unknowns[index][: tables.LOG_FOCAL] += picture.equations.own_step(step)
                unknowns[index][_MOUNTING] += step[: HEIGHT + 1]
        scores = np.array([one.gradient for one in pictures.values()])
        # differences between pictures exceed their samples' noise
        scores = (scores - scores.mean(axis=0)) * math.sqrt(len(scores) / max(len(scores) - 1, 1))
        residual_px = {index: one.residual_px for index, one in pictures.items()}
        parameters, covariance = self._parameters, sandwich(total, scores)
        return JointFit(parameters.camera(vector), parameters, vector, covariance, unknowns, residual_px)

    def _linearised(
        self,
        sighting: Sighting,
        unknowns: FloatArray,
        vector: FloatArray,
        camera: PinholeCamera,
        lens: FloatArray,
        gate: float,
    ) -> _Picture | None:
        points = self._finder.find(sighting.frame, lens, unknowns, gate or self._robust.gates_px[-1], sighting.edges)
        if len(points.feature) < self._robust.min_points:
            return None
        by_lens = self._parameters.by_coefficients(camera, points.pixels, points.normal)
        by_camera = np.column_stack([points.by_camera, points.by_line_width, by_lens])
        residual = points.residual(points.by_line_width * vector[LINE_WIDTH])
        weight, noise = self._robust.weighed(residual, gate)
        if not self._robust.is_supported(weight):
            return None
        off = np.zeros(len(self._own))
        off[_MOUNTING] = unknowns[_MOUNTING] - vector[: HEIGHT + 1]
        rows = Residuals(residual, by_camera, points.by_frame, points.feature)
        equations = frame_equations(rows, weight, noise, self._own, -self._own * off)
        return _Picture(equations, *equations.reduced(), residual[weight > 0], noise.point_std_px)

    def _without_misplaced(self, pictures: dict[int, _Picture]) -> dict[int, _Picture]:
        """Return the pictures whose residuals are comparable to the median one's."""
        spreads = [one.spread_px for one in pictures.values()]
        most = _MAX_SPREAD_RATIO * float(np.median(spreads)) if spreads else 0.0
        return {index: one for index, one in pictures.items() if one.spread_px <= most}

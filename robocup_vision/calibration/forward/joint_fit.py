"""Fits one camera and its pose in each of many pictures together, by the field's edges that the pictures show.

What all pictures have in common is one vector (`ForwardParameters`). Each picture has its own place, heading, and
deviations of tilt, roll and height from their means. Edges are predicted and searched for anew in every step.
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
from robocup_vision.localization.model_edges.settings import DESIGN_WIDTH_PX, EdgeSettings

# each picture's tilt, roll and height among the unknowns of `kernels.model_edges`
_MOUNTING = slice(tables.TILT, tables.HEIGHT + 1)


@dataclass(frozen=True, slots=True)
class JointFitSettings:
    """Settings of the joint fit. Pixels are of any picture, but for those of a picture 208 wide where it says so."""

    #: how far a body nods, rolls and rises about its rest
    sway_std_rad: float = 0.01
    sway_std_m: float = 0.003
    #: noise of a sample alone, and of what all samples of an edge have in common; gates of the first steps, pixels of a
    #: picture 208 wide: from what a start is off down to noise; samples that a picture must show, or it is left out
    robust: Robust = Robust(Noise(0.15, 0.2), (4.0, 4.0, 3.0, 2.0, 1.5), 12)
    last_steps: int = 5  #: steps that follow the gates
    #: largest spread of a picture's residuals relative to the median picture's: one with more was placed wrongly
    max_spread_ratio: float = 3.0


@dataclass(frozen=True, eq=False)
class Sighting:
    """A picture of which is known where it was taken."""

    frame: UInt8Array  #: (H, W, 3) uint8: BGR
    #: (7,) float64: unknowns of `kernels.model_edges`: the camera's place, heading, tilt, roll and height; then 0
    unknowns: FloatArray
    edges: tables.FieldEdges  #: the field's edges, paint as bright as the picture shows it


@dataclass(frozen=True, eq=False)
class JointFit:
    """A camera by many pictures."""

    camera: PinholeCamera  #: the result
    parameters: ForwardParameters  #: what the vector means
    #: (G,), (G, G) float64: of what is common: tilt, roll (rad), height (m), logarithm of the focal length, ...
    vector: FloatArray
    covariance: FloatArray
    unknowns: Mapping[int, FloatArray]  #: of each picture that agrees: the unknowns of `kernels.model_edges`
    residual_px: Mapping[int, FloatArray]  #: of the samples that count in each of them

    @property
    def rms_px(self) -> float:
        """Root mean square of the residuals of all samples that count."""
        return math.sqrt(float(np.mean(np.concatenate(list(self.residual_px.values())) ** 2)))


@dataclass(frozen=True, slots=True, eq=False)
class _Picture:
    """What a picture tells at one state."""

    equations: FrameEquations
    information: FloatArray
    gradient: FloatArray
    residual_px: FloatArray
    spread_px: float


class JointFitter:
    """Fits cameras of one kind of lens by pictures of one field.

    Parameters
    ----------
    parameters : ForwardParameters
        What is unknown, and the start.
    """

    def __init__(
        self, field: Field, parameters: ForwardParameters, settings: JointFitSettings = JointFitSettings()
    ) -> None:
        self._parameters, self._settings = parameters, settings
        start = parameters.start
        self._finder = EdgePointFinder(field, start.size_px[0], EdgeSettings().for_unconfirmed_frames())
        scale = max(start.size_px[0] / DESIGN_WIDTH_PX, 1.0)
        self._robust = settings.robust.scaled(scale, 1.0)
        _, sway = start.sway_std_rad(settings.sway_std_rad)
        self._own = np.array([POSE_PRECISION] * 3 + [sway**-2, sway**-2, settings.sway_std_m**-2])

    def fit(self, sightings: Mapping[int, Sighting], vector: FloatArray) -> JointFit | None:
        """Fit a camera and its poses.

        Parameters
        ----------
        sightings : mapping of int to Sighting
            Pictures, by index.
        vector : (G,) float64
            Where to begin; what is believed before is the parameters' start.

        Returns
        -------
        JointFit or None
            None where no picture agrees.
        """
        start = self._parameters.vector(self._parameters.start)
        prior = np.diag(self._parameters.start_std**-2.0)
        unknowns = {index: one.unknowns.copy() for index, one in sightings.items()}
        pictures: dict[int, _Picture] = {}
        total = prior
        for gate in (*self._robust.gates_px, *[0.0] * self._settings.last_steps):
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
        # pictures differ by more than their samples' noise
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
        """Return the pictures that the camera fits about as well as the median one."""
        spreads = [one.spread_px for one in pictures.values()]
        most = self._settings.max_spread_ratio * float(np.median(spreads)) if spreads else 0.0
        return {index: one for index, one in pictures.items() if one.spread_px <= most}

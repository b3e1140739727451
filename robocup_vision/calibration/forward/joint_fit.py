"""Fits one camera and its pose in each of many pictures together, by the field's edges that the pictures show.

What all pictures have in common is one vector (`ForwardParameters`). Each picture has its own place, heading, and
deviations of tilt, roll and height from their means. These are eliminated picture by picture, so a step costs as much
as its pictures. Edges are predicted and searched for anew in every step.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import BoolArray, FloatArray, UInt8Array
from robocup_vision.calibration.online.evidence import (
    POSE_PRECISION,
    NoiseSettings,
    Residuals,
    eliminate,
    has_support,
    known,
    normal_equations,
    spread_px,
    tukey_weights,
)
from robocup_vision.camera.fisheye import FisheyeCamera
from robocup_vision.camera.lens_table import lens_table
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.model_edges import tables
from robocup_vision.kernels.model_edges.carpet import CARPET, carpet_look
from robocup_vision.kernels.model_edges.follow import brightness
from robocup_vision.kernels.model_edges.prediction import predict
from robocup_vision.kernels.model_edges.search import search
from robocup_vision.localization.model_edges.field_edges import field_edges
from robocup_vision.localization.model_edges.settings import DESIGN_WIDTH_PX, EdgeSettings

# places: tilt, roll (rad), height (m), logarithm of the focal length's scale, centre (px), logarithm of the painted
# lines' width by that of the field file; then the first coefficients of the distortion
TILT, ROLL, HEIGHT, LOG_FOCAL, LINE_WIDTH = 0, 1, 2, 3, 6
CENTER = slice(4, 6)
LENS = 7
# coefficients of the distortion that are fitted where a lens is free
_COEFFICIENTS = 2
# step of the numerical derivatives, in each number's own unit
_STEP = 1e-4
# edges of one picture that are compared with it, at most
_MAX_SAMPLES = 600
# unknowns of each picture: pose, then tilt, roll and height by which it differs from those common to all
_OWN = 6


@dataclass(frozen=True, slots=True)
class StartStd:
    """How well a start is known: standard deviations before any picture."""

    #: of tilt and roll, of the height, and of the logarithm of the focal length
    angle_rad: float = 0.1
    height_m: float = 0.1
    log_focal: float = 0.15
    #: of each coordinate of the centre, by the picture's width: of a fisheye as lenses sit on sensors; of a pinhole
    #: camera less, as its centre is hardly told from its tilt
    center_ratio: float = 0.005
    fisheye_center_ratio: float = 0.02
    log_line_width: float = 0.05  #: of the logarithm of the painted lines' width: a tape measure's or a painter's tenth
    #: of the first two coefficients of the distortion, and of a fisheye: those of common lenses
    coefficients: tuple[float, float] = (0.2, 0.2)
    fisheye_coefficients: tuple[float, float] = (0.05, 0.02)


class ForwardParameters:
    """Turns cameras into vectors and back.

    Parameters
    ----------
    start : PinholeCamera
        What no number of the vector says is as of this camera. Its tilt is known.
    bends : bool
        Whether the distortion is unknown; else it is the start's.
    """

    def __init__(self, start: PinholeCamera, std: StartStd = StartStd(), *, bends: bool = True) -> None:
        self.start, self.std = start, std
        is_free = bends and (not isinstance(start, FisheyeCamera) or start.projection == "kannala_brandt")
        self.coefficients = _COEFFICIENTS if is_free else 0
        if is_free and not start.distortion:
            self.start = replace(start, distortion=(0.0,) * 4)
        self.size = LENS + self.coefficients

    @property
    def start_std(self) -> FloatArray:
        """(G,) float64: of a start."""
        s, is_fisheye = self.std, isinstance(self.start, FisheyeCamera)
        center = (s.fisheye_center_ratio if is_fisheye else s.center_ratio) * self.start.size_px[0]
        of_lens = s.fisheye_coefficients if is_fisheye else s.coefficients
        lens = of_lens[: self.coefficients]
        return np.array([s.angle_rad, s.angle_rad, s.height_m, s.log_focal, center, center, s.log_line_width, *lens])

    def vector(self, camera: PinholeCamera, log_line_width: float = 0.0) -> FloatArray:
        """Return the numbers (G,) of a camera."""
        log_focal = math.log(camera.focal_px[0] / self.start.focal_px[0])
        lens = (*camera.distortion, 0.0, 0.0)[: self.coefficients]
        mounting = camera.tilt_rad or 0.0, camera.roll_rad or 0.0, camera.height_m
        return np.array([*mounting, log_focal, *camera.center_px, log_line_width, *lens])

    def camera(self, vector: FloatArray) -> PinholeCamera:
        """Return the camera of numbers (G,)."""
        tilt, roll, height, log_focal, u, v, _, *lens = vector.tolist()
        scale, start = math.exp(log_focal), self.start
        return replace(
            start,
            focal_px=(start.focal_px[0] * scale, start.focal_px[1] * scale),
            center_px=(u, v),
            distortion=(*lens, *start.distortion[len(lens) :]),
            height_m=height,
            tilt_rad=tilt,
            roll_rad=roll,
        )

    def by_coefficients(self, camera: PinholeCamera, pixels: FloatArray, normal: FloatArray) -> FloatArray:
        """Return derivatives (N, C) of pixels (N, 2) along normals (N, 2) by the coefficients of the distortion.

        Pixels that the camera shows of no ray move with none.
        """
        rays = camera.pixel_to_camera_ray(pixels)
        at = camera.camera_ray_to_pixel(rays)
        columns = []
        for place in range(self.coefficients):
            lens = np.array(camera.distortion)
            lens[place] += _STEP
            moved = replace(camera, distortion=tuple(lens.tolist())).camera_ray_to_pixel(rays)
            columns.append(((moved - at) * normal).sum(axis=1) / _STEP)
        return np.asarray(np.nan_to_num(np.array(columns).reshape(self.coefficients, len(pixels)).T))


@dataclass(frozen=True, slots=True)
class JointFitSettings:
    """Settings of the joint fit. Pixels are of any picture, but for those of a picture 208 wide where it says so."""

    #: how far a body nods, rolls and rises about its rest
    sway_std_rad: float = 0.01
    sway_std_m: float = 0.003
    #: of the first steps, pixels of a picture 208 wide: from what a start is off down to noise
    gates_px: tuple[float, ...] = (4.0, 4.0, 3.0, 2.0, 1.5)
    #: of the steps that follow: in robust standard deviations of the residuals, and their number
    last_gate: float = 3.5
    last_steps: int = 5
    #: noise of a sample alone, and of what all samples of an edge have in common
    point_std_px: float = 0.15
    group_std_px: float = 0.2
    #: samples that a picture must show, and of these those that the fit must explain, or it is left out
    min_points: int = 12
    min_agreeing_ratio: float = 0.5
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

    #: (G,), (G, G) float64: of what is common
    vector: FloatArray
    covariance: FloatArray
    unknowns: Mapping[int, FloatArray]  #: of each picture that agrees: the unknowns of `kernels.model_edges`
    residual_px: Mapping[int, FloatArray]  #: of the samples that count in each of them

    def pose(self, index: int) -> Pose2:
        """Pose of the camera in a picture."""
        return Pose2(*self.unknowns[index][:3].tolist())


@dataclass(frozen=True, slots=True, eq=False)
class _Picture:
    """What a picture tells at one state: of all unknowns, and with its own eliminated."""

    information: FloatArray
    gradient: FloatArray
    inner: FloatArray
    cross: FloatArray
    inner_gradient: FloatArray
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
        width, edges = parameters.start.size_px[0], field_edges(field)
        self._numbers = EdgeSettings().for_unconfirmed_frames().for_width(width, field.line_width_m)
        self._workspace = tables.empty_buffers(_MAX_SAMPLES, 0)
        self._scale = max(width / DESIGN_WIDTH_PX, 1.0)
        own = settings
        roll_std = parameters.start.roll_std_rad
        sway = own.sway_std_rad if roll_std is None else roll_std
        self._own = np.array([POSE_PRECISION] * 3 + [sway**-2, sway**-2, own.sway_std_m**-2])
        first = [*edges.segments[edges.segments[:, 13] > 0, 11], *edges.arcs[:, 7]]
        self._of_lines = np.array([edge for one in first for edge in (one, one + 1)], dtype=np.int64)

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
        settings, start = self._settings, self._parameters.vector(self._parameters.start)
        precision = np.diag(self._parameters.start_std**-2.0)
        unknowns = {index: one.unknowns.copy() for index, one in sightings.items()}
        pictures: dict[int, _Picture] = {}
        gates = [self._scale * gate for gate in settings.gates_px] + [0.0] * settings.last_steps
        covariance: FloatArray = np.asarray(np.linalg.inv(precision), dtype=np.float64)
        for gate in gates:
            camera = self._parameters.camera(vector)
            lens = lens_table(camera)
            pictures = {}
            for index, one in unknowns.items():
                picture = self._linearised(sightings[index], one, vector, camera, lens, gate)
                if picture is not None:
                    pictures[index] = picture
            if not gate:
                pictures = self._without_misplaced(pictures)
            if not pictures:
                return None
            total = precision + sum(one.information for one in pictures.values())
            pull = precision @ (start - vector) + sum(one.gradient for one in pictures.values())
            covariance = np.asarray(np.linalg.inv(total), dtype=np.float64)
            step = covariance @ pull
            vector = vector + step
            for index, picture in pictures.items():
                own = np.linalg.solve(picture.inner, picture.inner_gradient - picture.cross.T @ step)
                unknowns[index][:_OWN] += own
            unknowns = {index: unknowns[index] for index in pictures}
        return JointFit(
            vector,
            covariance + _spread(list(pictures.values()), covariance),
            unknowns,
            {index: one.residual_px for index, one in pictures.items()},
        )

    def _linearised(
        self,
        sighting: Sighting,
        unknowns: FloatArray,
        vector: FloatArray,
        camera: PinholeCamera,
        lens: FloatArray,
        gate: float,
    ) -> _Picture | None:
        settings, workspace = self._settings, self._workspace
        count = self._search(sighting, unknowns, camera, lens, gate or self._scale * settings.gates_px[-1])
        samples, found = workspace.samples, workspace.found
        seen = found.candidates[:count] > 0
        if np.count_nonzero(seen) < settings.min_points:
            return None
        jacobian, normal = samples.jacobian[:count][seen], samples.normal[:count][seen]
        feature = samples.feature[:count][seen]
        pixels = samples.uv[:count][seen]
        by_width = self._by_line_width(samples, count, seen)
        by_camera = np.column_stack(
            [
                np.zeros((len(pixels), HEIGHT + 1)),
                jacobian[:, tables.LOG_FOCAL],
                normal,
                by_width,
                self._parameters.by_coefficients(camera, pixels, normal),
            ]
        )
        offsets, candidates = found.offset_px[:count][seen], found.candidates[:count][seen]
        offsets = np.where(np.arange(offsets.shape[1]) < candidates[:, None], offsets, np.inf)
        expected = by_width * vector[LINE_WIDTH]
        nearest = np.argmin(np.abs(offsets - expected[:, None]), axis=1)
        residual = expected - offsets[np.arange(len(offsets)), nearest]
        inside = np.abs(residual) < (gate or self._scale * settings.gates_px[-1])
        spread = spread_px(residual[inside], settings.point_std_px)
        limit = gate or settings.last_gate * spread
        weight = tukey_weights(residual, limit)
        used = weight > 0
        if not has_support(int(np.count_nonzero(used)), len(used), settings.min_points, settings.min_agreeing_ratio):
            return None
        points = Residuals(residual, by_camera, jacobian[:, :_OWN], feature)
        noise = NoiseSettings(spread, settings.group_std_px * spread / settings.point_std_px)
        information, gradient = normal_equations(known(used, points), weight[used], noise)
        size = len(vector)
        sway = np.zeros(_OWN)
        sway[tables.TILT : tables.HEIGHT + 1] = unknowns[tables.TILT : tables.HEIGHT + 1] - vector[: HEIGHT + 1]
        return _picture(information, gradient, size, self._own, -self._own * sway, residual[used], spread)

    def _without_misplaced(self, pictures: dict[int, _Picture]) -> dict[int, _Picture]:
        """Return the pictures that the camera fits about as well as the median one."""
        spreads = [one.spread_px for one in pictures.values()]
        most = self._settings.max_spread_ratio * float(np.median(spreads)) if spreads else 0.0
        return {index: one for index, one in pictures.items() if one.spread_px <= most}

    def _search(
        self, sighting: Sighting, unknowns: FloatArray, camera: PinholeCamera, lens: FloatArray, reach_px: float
    ) -> int:
        """Predict the field's edges, and look for them; return how many samples there are."""
        workspace, carpet, frame, edges = self._workspace, np.zeros(CARPET), sighting.frame, sighting.edges
        workspace.reach_px[:] = reach_px
        carpet_look(frame, int(camera.center_px[1] + camera.focal_px[1] * math.tan(unknowns[tables.TILT])), carpet)
        count = int(predict(edges, lens, unknowns, self._numbers.spacing_px, workspace.samples))
        search(frame, edges.channels, carpet, brightness(carpet), self._numbers, workspace, count)
        return count

    def _by_line_width(self, samples: tables.Samples, count: int, seen: BoolArray) -> FloatArray:
        """Return derivatives (N,) along the normals by the logarithm of the lines' width."""
        is_edge = (samples.kind[:count] == tables.EDGE) & np.isin(samples.feature[:count], self._of_lines)
        return np.where(is_edge, -0.5 * samples.width_px[:count], 0.0)[seen]


def _picture(
    information: FloatArray,
    gradient: FloatArray,
    size: int,
    own: FloatArray,
    own_gradient: FloatArray,
    residual_px: FloatArray,
    spread: float,
) -> _Picture:
    """Eliminate a picture's own unknowns; those that are off their rest pull what is common along."""
    common = information[:size, :size].copy()
    cross, right = information[:size, size:].copy(), gradient[:size].copy()
    inner, inner_gradient = information[size:, size:] + np.diag(own), gradient[size:] + own_gradient
    # tilt, roll and height of the picture are off those common to all by its sway
    at, sway = np.arange(HEIGHT + 1), np.arange(_OWN - HEIGHT - 1, _OWN)
    common[at, at] += own[sway]
    cross[at, sway] -= own[sway]
    right[at] -= own_gradient[sway]
    return _Picture(
        *eliminate(common, cross, inner, right, inner_gradient), inner, cross, inner_gradient, residual_px, spread
    )


def _spread(pictures: Sequence[_Picture], covariance: FloatArray) -> FloatArray:
    """Covariance by what each picture moves the result: pictures differ by more than their samples' noise."""
    count = len(pictures)
    if count < 2:
        return np.zeros_like(covariance)
    moved = np.array([covariance @ one.gradient for one in pictures])
    off = moved - moved.mean(axis=0)
    return np.asarray(count / (count - 1) * off.T @ off)

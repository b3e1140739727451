"""Where one camera is on a landmark map: near a prior by few well-chosen landmarks, or anywhere by all of them.

Ogawa et al. (2011), section 3, with the pixels' own noise in eq. 19 and Gauss-Newton in place of the exhaustive search.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray, Int64Array, UInt8Array, read_only
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.landmarks.fit import descend
from robocup_vision.landmarks.features import (
    PIXEL_STD_PER_SPACING,
    Extractor,
    Features,
    SiftExtractor,
    match,
    match_by_loop,
    near,
)
from robocup_vision.landmarks.index import MapIndex, kernel_camera
from robocup_vision.landmarks.landmark_map import Expected, LandmarkMap, expect
from robocup_vision.landmarks.pose_fit import CHI2_2DOF, PoseFit, fit_pixels
from robocup_vision.landmarks.projection import project, to_camera
from robocup_vision.landmarks.relocate import Relocator
from robocup_vision.landmarks.selection import Selection, TimeBudget, select

Matching = Literal["loop", "product"]

GATE_PX = 40.0  # eqs. 16 and 17, for images 320 wide
_KNOWN_GATE_PX = 4.0
_SIZE_RATIO = 1.6
_SCOUTS = 16
_REGIONS_SHARE = 0.17
_MIN_SCOUT_SHARE = 0.6
_WIDTHS = np.array([30.0, 15.0, 8.0, 5.0, 3.5, 3.0, 3.0, 3.0])
MIN_INLIERS = 6
_MIN_SHARE = 0.4
# a pose less certain than this tells too little
_MAX_STD_M = 0.2
PRIOR_COVARIANCE = np.diag([0.1**2, 0.1**2, math.radians(5.0) ** 2])


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """What a frame showed of the map.

    Parameters
    ----------
    pose : PoseEstimate or NotLocated
        The robot.
    expected : Expected
        The landmarks looked for.
    matched : (K,) int64
        Which of these were found.
    pixels : (K, 2) float64
        Where, ideal pixels.
    inliers : (K,) bool
        Which agree with the pose.
    timings_s : dict of str to float
        Seconds for ``features``, ``select``, ``match``, ``fit`` and, where it was needed, ``relocate``.
    """

    pose: PoseEstimate | NotLocated
    expected: Expected
    matched: Int64Array
    pixels: FloatArray
    inliers: npt.NDArray[np.bool_]
    timings_s: dict[str, float]


class LandmarkLocalizer:
    """Locates a robot's camera on a landmark map; one object a camera and thread.

    Parameters
    ----------
    landmarks : LandmarkMap
        The map.
    camera : PinholeCamera
        As mounted on the robot; its tilt must be known. With offset and pan 0 the pose is the camera's own.
    selection : Selection
        Which landmarks are looked for, and at most how many.
    limit_s : float, optional
        Look for no more landmarks than can be matched in this time; features are extracted besides.
    matching : {"loop", "product"}
        Landmark by landmark, or all by one matrix product; both find the same.
    extractor : Extractor, optional
        What finds the features; what the map was made with. SIFT unless given.
    regions : bool
        With a prior, look for SIFT features only in tiles around the most telling landmarks, a sixth of the frame.
        The prior must then be good to some 10 pixels; where it was not, the whole frame is looked at.
    exhaustive : bool
        Search the pose as the paper does: slow and coarse, a reference.
    """

    def __init__(
        self,
        landmarks: LandmarkMap,
        camera: PinholeCamera,
        *,
        selection: Selection | None = None,
        limit_s: float | None = None,
        matching: Matching = "loop",
        extractor: Extractor | None = None,
        regions: bool = False,
        exhaustive: bool = False,
    ) -> None:
        if not camera.known_orientation:
            raise ArgumentError("a landmark map needs a camera of known tilt_rad")
        if not len(landmarks):
            raise ArgumentError("the landmark map is empty")
        self.landmarks = landmarks
        self.camera = camera
        self.selection = selection or Selection()
        self.extractor = extractor or SiftExtractor(camera)
        self._regions = SiftExtractor(camera) if regions else None
        self._matching = matching
        self._exhaustive = exhaustive
        self._index = MapIndex(landmarks)
        self._budget = None if limit_s is None else TimeBudget(limit_s)
        self._relocator = Relocator(landmarks, camera)
        self._kernel_camera = kernel_camera(camera)
        self._scale = camera.size_px[0] / 320

    def locate(
        self, frame: UInt8Array, prior: PoseEstimate | Pose2 | None = None, *, rng: np.random.Generator | None = None
    ) -> PoseEstimate | NotLocated:
        """Locate the robot.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            BGR, of the camera's size.
        prior : PoseEstimate or Pose2, optional
            About where it is: landmarks are looked for within 40 pixels (of 320) of where this puts them. Without it,
            or where nothing is found there, the whole map is searched.
        rng : numpy.random.Generator, optional
            For the selection "random".

        Raises
        ------
        FrameError
            If the frame has another size or type.
        """
        return self.look(frame, prior, rng=rng).pose

    def look(
        self, frame: UInt8Array, prior: PoseEstimate | Pose2 | None = None, *, rng: np.random.Generator | None = None
    ) -> Sight:
        """Locate the robot as `locate` does, and tell how."""
        started = time.perf_counter()
        in_regions_s = 0.0
        if self._regions is not None and prior is not None:
            pose = prior.pose.array if isinstance(prior, PoseEstimate) else prior.array
            expected = self._expect(pose, rng)
            extracting = time.perf_counter()
            features = self._regions.extract_near(frame, expected.pixels, _REGIONS_SHARE)
            in_regions_s = time.perf_counter() - extracting
            sight = self._find(features, pose, expected, extracting - started)
            if sight.pose:
                sight.timings_s["features"] = in_regions_s
                return sight
        extracting = time.perf_counter()
        features = self.extractor.extract(frame)
        extracted_s = time.perf_counter() - extracting
        sight = self.look_at(features, prior, rng=rng)
        sight.timings_s["features"] = in_regions_s + extracted_s
        return sight

    def prepare(self) -> None:
        """Build the index of the whole map's descriptors now, not at the first frame without a prior."""
        self._relocator.prepare()

    def look_at(
        self, features: Features, prior: PoseEstimate | Pose2 | None = None, *, rng: np.random.Generator | None = None
    ) -> Sight:
        """Locate the robot by features that are known already."""
        sight = None
        if prior is not None:
            pose = prior.pose if isinstance(prior, PoseEstimate) else prior
            sight = self._near(features, pose.array, rng)
            if sight.pose:
                return sight
        started = time.perf_counter()
        found = self._relocator.relocate(features)
        relocated_s = time.perf_counter() - started
        if isinstance(found, NotLocated):
            sight = sight or _nothing(found)
            sight.timings_s["relocate"] = relocated_s
            return sight
        sight = self._near(features, found, rng)
        sight.timings_s["relocate"] = relocated_s
        return sight

    def look_near(self, features: Features, prior: Pose2) -> Sight:
        """Locate the robot by features near a prior only: the whole map is not searched where that fails."""
        return self._near(features, prior.array, None)

    def _near(self, features: Features, pose: FloatArray, rng: np.random.Generator | None) -> Sight:
        started = time.perf_counter()
        expected = self._expect(pose, rng)
        return self._find(features, pose, expected, time.perf_counter() - started)

    def _expect(self, pose: FloatArray, rng: np.random.Generator | None) -> Expected:
        """Landmarks to look for from this pose, as the selection says."""
        if self.selection.choice in ("informative", "cells"):
            expected = self._index.expect(self.camera, pose)
        else:
            expected = expect(self.landmarks, self.camera, pose)
        at_most = None if self._budget is None else self._budget.landmarks
        chosen = select(
            self.selection, self.landmarks, expected, self.camera, pose, PRIOR_COVARIANCE, at_most=at_most, rng=rng
        )
        return expected.take(chosen)

    def _find(self, features: Features, pose: FloatArray, expected: Expected, selected_s: float) -> Sight:
        """Match the expected landmarks and fit the pose to them."""
        started = time.perf_counter()
        matching_s = 0.0
        fit, rows, partners = None, np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
        # the first few say where the others must be: these then need no wide gate
        for first in (_SCOUTS, len(expected)) if self._in_order(expected) else (len(expected),):
            started_s = time.perf_counter()
            scouts = expected.take(np.arange(first))
            rows, partners = self._match(scouts, scouts.pixels, features, GATE_PX * self._scale, 0.7)
            matching_s += time.perf_counter() - started_s
            fit = self._fit(pose, expected, rows, features, partners) if len(rows) >= MIN_INLIERS else None
            if fit is not None and fit.inliers.sum() >= max(MIN_INLIERS, _MIN_SCOUT_SHARE * len(rows)):
                break
        if fit is not None and fit.inliers.sum() >= MIN_INLIERS:
            pixels = self._project(fit.pose, expected)
            started_s = time.perf_counter()
            rows, partners = self._match(expected, pixels, features, _KNOWN_GATE_PX * self._scale, 0.85)
            matching_s += time.perf_counter() - started_s
            fit = self._fit(fit.pose, expected, rows, features, partners) if len(rows) >= MIN_INLIERS else None
        done = time.perf_counter()
        timings = {"select": selected_s, "match": matching_s, "fit": done - started - matching_s}
        if self._budget is not None:
            self._budget.learn(selected_s + done - started - matching_s, matching_s, len(expected))
        inliers = np.zeros(len(rows), dtype=bool) if fit is None else fit.inliers
        pixels = features.pixels[partners]
        return Sight(self._judge(fit, len(rows), len(expected)), expected, rows, pixels, inliers, timings)

    def _in_order(self, expected: Expected) -> bool:
        """Whether the most telling landmarks come first, and there are more than the scouts."""
        return self.selection.choice == "informative" and len(expected) > _SCOUTS

    def _match(
        self, expected: Expected, pixels: FloatArray, features: Features, gate_px: float, ratio: float
    ) -> tuple[Int64Array, Int64Array]:
        unit = self.landmarks.view_unit[expected.view]
        gate = (gate_px, gate_px)
        if self._matching == "loop":
            return match_by_loop(unit, pixels, expected.size_px, features, gate, _SIZE_RATIO, ratio=ratio)
        allowed = near(pixels, expected.size_px, features, gate, _SIZE_RATIO)
        return match(unit, features.descriptors, allowed, ratio=ratio)

    def _project(self, pose: FloatArray, expected: Expected) -> FloatArray:
        return project(self.camera, to_camera(self.camera, pose, self.landmarks.positions_m[expected.landmark]))

    def _fit(
        self, start: FloatArray, expected: Expected, rows: Int64Array, features: Features, partners: Int64Array
    ) -> PoseFit:
        of = expected.landmark[rows]
        positions, covariances = self.landmarks.positions_m[of], self.landmarks.covariances[of]
        pixels = features.pixels[partners]
        std = PIXEL_STD_PER_SPACING * self.landmarks.noise[of] * features.spacing_px[partners]
        if self._exhaustive:
            return fit_pixels(self.camera, start, positions, covariances, pixels, std, exhaustive=True)
        pose, squared = np.empty(3), np.empty(len(rows))
        normal = descend(
            start, *self._kernel_camera, positions, covariances, pixels, std, _WIDTHS, CHI2_2DOF, pose, squared
        )
        covariance = np.asarray(np.linalg.inv(normal), dtype=np.float64)
        return PoseFit(pose, covariance, squared <= CHI2_2DOF, squared)

    def _judge(self, fit: PoseFit | None, matched: int, expected: int) -> PoseEstimate | NotLocated:
        if fit is None:
            return NotLocated(f"only {matched} of {expected} expected landmarks were found")
        agree = int(fit.inliers.sum())
        if agree < MIN_INLIERS or agree < _MIN_SHARE * matched:
            return NotLocated(f"only {agree} of {matched} found landmarks agree on a pose")
        # what the found landmarks leave open (more in poor light than the map was made in), and what they all share
        poorer = max(float(fit.squared[fit.inliers].sum()) / max(2 * agree - 3, 1), 1.0)
        covariance = fit.covariance * poorer + self.landmarks.drift(fit.pose)
        std = np.sqrt(np.diag(covariance))
        if not max(std[:2]) < _MAX_STD_M:
            return NotLocated(f"{agree} landmarks tell the position to {max(std[:2]):.2f} m only")
        residual = math.sqrt(float(fit.squared[fit.inliers].mean()) / 2)
        pose = Pose2(*(float(v) for v in fit.pose))
        return PoseEstimate(pose, read_only(covariance), agree / matched, residual)


def _nothing(reason: NotLocated) -> Sight:
    none = np.empty(0, dtype=np.int64)
    empty = Expected(none, none, np.empty((0, 2)), np.empty(0), np.empty(0), np.empty(0))
    return Sight(reason, empty, none, np.empty((0, 2)), np.empty(0, dtype=bool), {})

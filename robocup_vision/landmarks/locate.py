"""Locates one camera on a landmark map: near a prior by a few selected landmarks, or anywhere by all of them.

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
from robocup_vision.estimates import NotLocated, PoseEstimate, pose_of
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.landmarks.fit import LandmarkPixels, fit_pose
from robocup_vision.kernels.landmarks.matching import Described
from robocup_vision.landmarks.features import (
    KNOWN_RATIO,
    PIXEL_STD_PER_SPACING,
    RATIO,
    Extractor,
    Features,
    SiftExtractor,
    match,
    match_by_loop,
    near,
)
from robocup_vision.landmarks.landmark_map import Expected, LandmarkMap, MapIndex, expect, pinhole_view
from robocup_vision.landmarks.pose_fit import CHI2_2DOF, PoseFit, project, to_camera
from robocup_vision.landmarks.relocate import Relocator
from robocup_vision.landmarks.selection import Selection, TimeBudget, select

Matching = Literal["loop", "product"]

# pixels are those of an image 320 wide, and are scaled with the width
# half the window around a landmark's pixel by the prior (eqs. 16 and 17): an error of the prior of 0.1 m at 1 m
_GATE_PX = 40.0
_KNOWN_GATE_PX = 4.0  # half the window after a first fit
_SCOUTS = 16  # number of the most informative landmarks, which are matched first: their fit narrows the others' window
# least inlier ratio of the scouts' matches; below it all landmarks are matched in the wide window
_MIN_SCOUT_INLIER_RATIO = 0.6
# area of the tiles of `regions` as a fraction of the frame's: a third of a frame takes as long as the whole
_REGION_RATIO = 0.17
# widths of the weights in each iteration of the fit, standard deviations: wide for a poor prior, then down to the noise
_WEIGHT_WIDTHS = np.array((30.0, 15.0, 8.0, 5.0, 3.5, 3.0, 3.0, 3.0))
# a pose has three unknowns, and each landmark gives two numbers: six landmarks are redundant enough to reject a wrong
# pose
_MIN_INLIERS = 6
_MIN_INLIER_RATIO = 0.4  # least inlier ratio of the matches; below it the pose is as likely a coincidence
_MAX_STD_M = 0.2  # greatest standard deviation of the position
# standard deviations of the prior for the selection of landmarks: x (m), y (m) and theta (rad)
_PRIOR_STD = (0.1, 0.1, math.radians(5.0))


@dataclass(frozen=True, slots=True, eq=False)
class LandmarkMatch:
    """The landmarks found in a frame, and the pose by them."""

    pose: PoseEstimate | NotLocated  #: pose of the robot
    expected: Expected  #: the landmarks that were searched
    matched: Int64Array  #: (K,) int64: indices of those that were found
    pixels: FloatArray  #: (K, 2) float64: their ideal pixels
    inliers: npt.NDArray[np.bool_]  #: (K,) bool: whether each agrees with the pose
    #: seconds for ``features``, ``select``, ``match``, ``fit`` and, if it was needed, ``relocate``
    timings_s: dict[str, float]


class LandmarkPoseEstimator:
    """Locates a robot's camera on a landmark map; one object for each camera and thread.

    Parameters
    ----------
    camera : PinholeCamera
        As mounted on the robot; its tilt must be known. With offset and pan 0 the pose is the camera's own.
    selection : Selection
        Which landmarks are searched, and their greatest number.
    limit_s : float, optional
        Time for selection, matching and fit, without extraction of features; it limits the number of landmarks.
    matching : {"loop", "product"}
        Match landmark by landmark, or all by one matrix product; the results are the same.
    extractor : Extractor, optional
        Finds the features; must be the one with which the map was made. SIFT by default.
    regions : bool
        With a prior, find SIFT features only in tiles around the most informative landmarks, a sixth of the frame.
        The prior must then be right to about 10 pixels. If no pose is found, the whole frame is searched.
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
        self._index = MapIndex(landmarks)
        self._budget = None if limit_s is None else TimeBudget(limit_s)
        self._relocator = Relocator(landmarks, camera)
        self._view = pinhole_view(camera)
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
            Approximate pose: landmarks are searched within 40 pixels (of a picture 320 wide) of their prediction by it.
            Without it, or if that gives no pose, the whole map is searched.
        rng : numpy.random.Generator, optional
            Generator for the selection "random".

        Raises
        ------
        FrameError
            If the frame has another size or type.
        """
        return self.look(frame, prior, rng=rng).pose

    def look(
        self, frame: UInt8Array, prior: PoseEstimate | Pose2 | None = None, *, rng: np.random.Generator | None = None
    ) -> LandmarkMatch:
        """Locate the robot as `locate` does, and also return the landmarks found."""
        started = time.perf_counter()
        in_regions_s = 0.0
        near = pose_of(prior)
        if self._regions is not None and near is not None:
            expected = self._expect(near.array, rng)
            extracting = time.perf_counter()
            features = self._regions.extract_near(frame, expected.pixels, _REGION_RATIO)
            in_regions_s = time.perf_counter() - extracting
            result = self._find(features, near.array, expected, extracting - started)
            if result.pose:
                result.timings_s["features"] = in_regions_s
                return result
        extracting = time.perf_counter()
        features = self.extractor.extract(frame)
        extracted_s = time.perf_counter() - extracting
        result = self.look_at(features, prior, rng=rng)
        result.timings_s["features"] = in_regions_s + extracted_s
        return result

    def prepare(self) -> None:
        """Build the index of the whole map's descriptors now instead of at the first frame without a prior."""
        self._relocator.prepare()

    def look_at(
        self, features: Features, prior: PoseEstimate | Pose2 | None = None, *, rng: np.random.Generator | None = None
    ) -> LandmarkMatch:
        """Locate the robot by features that were already extracted."""
        result, near = None, pose_of(prior)
        if near is not None:
            result = self._near(features, near.array, rng)
            if result.pose:
                return result
        started = time.perf_counter()
        found = self._relocator.relocate(features)
        relocated_s = time.perf_counter() - started
        if isinstance(found, NotLocated):
            result = result or _nothing(found)
            result.timings_s["relocate"] = relocated_s
            return result
        result = self._near(features, found, rng)
        result.timings_s["relocate"] = relocated_s
        return result

    def look_near(self, features: Features, prior: Pose2) -> LandmarkMatch:
        """Locate the robot by features near a prior, without a search of the whole map if that fails."""
        return self._near(features, prior.array, None)

    def _near(self, features: Features, pose: FloatArray, rng: np.random.Generator | None) -> LandmarkMatch:
        started = time.perf_counter()
        expected = self._expect(pose, rng)
        return self._find(features, pose, expected, time.perf_counter() - started)

    def _expect(self, pose: FloatArray, rng: np.random.Generator | None) -> Expected:
        """Return the landmarks that are selected for a pose (3,)."""
        if self.selection.choice in ("informative", "cells"):
            expected = self._index.expect(self.camera, pose)
        else:
            expected = expect(self.landmarks, self.camera, pose)
        at_most = None if self._budget is None else self._budget.landmarks
        chosen = select(
            self.selection,
            self.landmarks,
            expected,
            self.camera,
            pose,
            np.diag(np.square(_PRIOR_STD)),
            at_most=at_most,
            rng=rng,
        )
        return expected.take(chosen)

    def _find(self, features: Features, pose: FloatArray, expected: Expected, selected_s: float) -> LandmarkMatch:
        """Match the expected landmarks and fit the pose to them."""
        started = time.perf_counter()
        matching_s = 0.0
        fit, rows, partners = None, np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
        # the fit to the first landmarks predicts the others, which then need no wide gate
        for first in (_SCOUTS, len(expected)) if self._in_order(expected) else (len(expected),):
            started_s = time.perf_counter()
            scouts = expected.take(np.arange(first))
            rows, partners = self._match(scouts, scouts.pixels, features, _GATE_PX, RATIO)
            matching_s += time.perf_counter() - started_s
            fit = self._fit(pose, expected, rows, features, partners) if len(rows) >= _MIN_INLIERS else None
            if fit is not None and fit.inliers.sum() >= max(_MIN_INLIERS, _MIN_SCOUT_INLIER_RATIO * len(rows)):
                break
        if fit is not None and fit.inliers.sum() >= _MIN_INLIERS:
            positions_m = self.landmarks.positions_m[expected.landmark]
            pixels = project(self.camera, to_camera(self.camera, fit.pose, positions_m))
            started_s = time.perf_counter()
            rows, partners = self._match(expected, pixels, features, _KNOWN_GATE_PX, KNOWN_RATIO)
            matching_s += time.perf_counter() - started_s
            fit = self._fit(fit.pose, expected, rows, features, partners) if len(rows) >= _MIN_INLIERS else None
        done = time.perf_counter()
        timings = {"select": selected_s, "match": matching_s, "fit": done - started - matching_s}
        if self._budget is not None:
            self._budget.learn(selected_s + done - started - matching_s, matching_s, len(expected))
        inliers = np.zeros(len(rows), dtype=bool) if fit is None else fit.inliers
        pixels = features.pixels[partners]
        return LandmarkMatch(self._judge(fit, len(rows), len(expected)), expected, rows, pixels, inliers, timings)

    def _in_order(self, expected: Expected) -> bool:
        """Whether the most informative landmarks come first, and there are more than the scouts."""
        return self.selection.choice == "informative" and len(expected) > _SCOUTS

    def _match(
        self, expected: Expected, pixels: FloatArray, features: Features, gate_px: float, ratio: float
    ) -> tuple[Int64Array, Int64Array]:
        unit = self.landmarks.view_unit[expected.view]
        gate = (gate_px * self._scale, gate_px * self._scale)
        if self._matching == "loop":
            described = Described(unit, pixels, expected.size_px)
            return match_by_loop(described, features, gate, ratio=ratio)
        allowed = near(pixels, expected.size_px, features, gate)
        return match(unit, features.descriptors, allowed, ratio=ratio)

    def _fit(
        self, start: FloatArray, expected: Expected, rows: Int64Array, features: Features, partners: Int64Array
    ) -> PoseFit:
        of = expected.landmark[rows]
        positions, covariances = self.landmarks.positions_m[of], self.landmarks.covariances[of]
        pixels = features.pixels[partners]
        std = PIXEL_STD_PER_SPACING * self.landmarks.noise[of] * features.spacing_px[partners]
        pose, squared = np.empty(3), np.empty(len(rows))
        matches = LandmarkPixels(positions, covariances, pixels, std)
        normal = fit_pose(self._view, start, matches, _WEIGHT_WIDTHS, CHI2_2DOF, pose, squared)
        covariance = np.asarray(np.linalg.inv(normal), dtype=np.float64)
        return PoseFit(pose, covariance, squared <= CHI2_2DOF, squared)

    def _judge(self, fit: PoseFit | None, matched: int, expected: int) -> PoseEstimate | NotLocated:
        if fit is None:
            return NotLocated(f"only {matched} of {expected} expected landmarks were found")
        agree = int(fit.inliers.sum())
        if agree < _MIN_INLIERS or agree < _MIN_INLIER_RATIO * matched:
            return NotLocated(f"only {agree} of {matched} found landmarks agree on a pose")
        # residuals are larger in poorer light than that of the map's run; the map's drift is added
        poorer = max(float(fit.squared[fit.inliers].sum()) / max(2 * agree - 3, 1), 1.0)
        covariance = fit.covariance * poorer + self.landmarks.drift(fit.pose)
        std = np.sqrt(np.diag(covariance))
        if not max(std[:2]) < _MAX_STD_M:
            return NotLocated(f"{agree} landmarks give the position to {max(std[:2]):.2f} m only")
        residual = math.sqrt(float(fit.squared[fit.inliers].mean()) / 2)
        pose = Pose2(*(float(v) for v in fit.pose))
        return PoseEstimate(pose, read_only(covariance), agree / matched, residual)


def _nothing(reason: NotLocated) -> LandmarkMatch:
    none = np.empty(0, dtype=np.int64)
    empty = Expected(none, none, np.empty((0, 2)), np.empty(0), np.empty(0), np.empty(0))
    return LandmarkMatch(reason, empty, none, np.empty((0, 2)), np.empty(0, dtype=bool), {})

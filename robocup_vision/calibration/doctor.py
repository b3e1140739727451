"""Comparison of similar set-ups by the number of pictures that fit."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.calibration.near_set_ups import NEAR, NearSetUp, SetUp
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import PoseEstimate
from robocup_vision.evaluation.dataset import Dataset
from robocup_vision.geometry import Pose2
from robocup_vision.progress import progress
from robocup_vision.view import View
from robocup_vision.vision import Vision

# greatest number of pictures tested with each set-up, evenly spread
_MAX_PICTURES = 8
# least ratio of them that fit a better set-up; least increase of this ratio over the given set-up; and ratio at which
# other kinds of mistakes are no longer tested
_MIN_FITTING, _MIN_MORE, _DECIDED_RATIO = 0.6, 0.3, 0.8
# greatest difference of a pose from truth or odometry, to which three of its standard deviations are added
_MAX_ERROR_M, _MAX_ERROR_RAD = 0.1, math.radians(3.0)
# greatest relative error of odometry between two pictures
_ODOMETRY_ERROR = 0.1


@dataclass(frozen=True, eq=False)
class Picture:
    """An unchanged picture, and a later one if odometry between them is known."""

    name: str  #: its file name
    frame: UInt8Array  #: (H, W, 3) uint8: BGR
    later: UInt8Array | None = None  #: (H, W, 3) uint8: a later picture
    moved: Pose2 | None = None  #: motion of the robot between them, by odometry


@dataclass(frozen=True, slots=True)
class _Look:
    fits: bool
    residual_px: float


def make_vision(dataset: Dataset, field: Field, camera: OmniCamera | PinholeCamera, *, learnt: bool = False) -> Vision:
    """Return a `Vision` for a dataset's pictures with the given field and camera, or with learnt colours.

    Raises
    ------
    ArgumentError
        If the dataset's method does not support them.
    """
    colors = None if learnt else dataset.colors
    needs_bounds = dataset.method in ("floor", "hull") and not field.is_bounded
    method = None if dataset.method == "landmarks" or needs_bounds else dataset.method
    return Vision(field, camera, colors, method=method, mask=dataset.mask)


class Doctor:
    """Tests set-ups on pictures.

    Parameters
    ----------
    pictures : sequence of Picture
        All of one size, possibly different from the camera's.
    own_views : mapping of str to View, optional
        Known views of pictures with the given set-up.
    """

    def __init__(
        self,
        dataset: Dataset,
        pictures: Sequence[Picture],
        own_views: Mapping[str, View] | None = None,
    ) -> None:
        self._dataset, self._pictures = dataset, pictures
        height, width = pictures[0].frame.shape[:2]
        self.own = SetUp(dataset.field, dataset.camera, (width, height), dataset.truth)
        # poses with the given set-up, which do not depend on the truth
        self._own_poses = {(name, False): self._pose(view) for name, view in (own_views or {}).items()}
        self._own_vision: Vision | None = None

    @property
    def compares(self) -> str:
        """Reference of the poses: "truth" or "odometry"; empty without any."""
        if any(one.name in self.own.truth for one in self._pictures):
            return "truth"
        return "odometry" if any(one.later is not None for one in self._pictures) else ""

    @property
    def measure(self) -> str:
        """Description of fitting, to follow "pictures"."""
        return f"agree with the {self.compares}" if self.compares else "are located"

    def fitting(self, set_up: SetUp | None = None) -> int:
        """Return the number of all pictures that fit a set-up, by default the given one."""
        return sum(look.fits for look in self._looks(set_up or self.own, self._pictures, 0))

    def find(self) -> tuple[NearSetUp, int] | None:
        """Return the set-up that fits most pictures, with their number; None if none is clearly better."""
        chosen = self._pictures[:: -(-len(self._pictures) // _MAX_PICTURES)]
        count = len(chosen)
        as_it_is = sum(look.fits for look in self._looks(self.own, chosen, 0))
        needed = max(math.ceil(_MIN_FITTING * count), as_it_is + max(1, math.ceil(_MIN_MORE * count)))
        if needed > count:
            return None
        best: NearSetUp | None = None
        # number of pictures that fit it, and their median residual, negative
        best_fit = needed, -math.inf
        kinds = [(kind, near) for kind, tried in enumerate(NEAR) for near in tried(self.own)]
        last = None
        for kind, near in progress(kinds, len(kinds), "trying near set-ups"):
            if kind != last and best is not None and best_fit[0] >= _DECIDED_RATIO * count:
                break
            last = kind
            residual_px = [look.residual_px for look in self._looks(near.set_up, chosen, best_fit[0]) if look.fits]
            if len(residual_px) < needed:
                continue
            fit = len(residual_px), -float(np.median(residual_px))
            if fit > best_fit:
                best, best_fit = near, fit
        return None if best is None else (best, self.fitting(best.set_up))

    def _looks(self, set_up: SetUp, pictures: Sequence[Picture], needed: int) -> list[_Look]:
        """Test pictures until fewer than `needed` of them can fit."""
        own = self.own
        is_own = (set_up.field, set_up.camera, set_up.seen) == (own.field, own.camera, own.seen)
        try:
            vision = self._vision_of_own() if is_own else make_vision(self._dataset, set_up.field, set_up.camera)
        except ArgumentError:
            # the dataset's method does not support this set-up
            return []
        looks: list[_Look] = []
        missed = 0
        for one in pictures:
            known = self._own_poses if is_own else {}
            for frame, is_later in ((one.frame, False), (one.later, True)):
                if frame is not None and (one.name, is_later) not in known:
                    known[one.name, is_later] = self._locate(vision, set_up, frame)
            look = self._judge(set_up, one, known[one.name, False], known.get((one.name, True)))
            looks.append(look)
            missed += not look.fits
            if len(pictures) - missed < needed:
                break
        return looks

    def _vision_of_own(self) -> Vision:
        if self._own_vision is None:
            self._own_vision = make_vision(self._dataset, self.own.field, self.own.camera)
        return self._own_vision

    def _locate(self, vision: Vision, set_up: SetUp, frame: UInt8Array) -> PoseEstimate | None:
        seen = np.ascontiguousarray(set_up.seen(frame))
        width, height = set_up.camera.size_px
        if seen.shape[:2] != (height, width):
            return None
        vision.forget()
        return self._pose(vision.look(seen))

    def _pose(self, view: View) -> PoseEstimate | None:
        pose = view.pose if self._dataset.pose_of == "robot" else view.camera_pose
        return pose if isinstance(pose, PoseEstimate) else None

    def _judge(self, set_up: SetUp, picture: Picture, pose: PoseEstimate | None, later: PoseEstimate | None) -> _Look:
        if pose is None:
            return _Look(False, math.inf)
        truth = set_up.truth.get(picture.name)
        fits = True
        if truth is not None:
            fits = self._is_near(pose, [(truth.x_m, truth.y_m, truth.theta_rad)], 0.0)
        elif picture.moved is not None and picture.later is not None:
            if later is None:
                return _Look(True, pose.residual_px)
            way = math.hypot(picture.moved.x_m, picture.moved.y_m) + abs(picture.moved.theta_rad)
            expected = [candidate.compose(picture.moved) for candidate in pose.candidates]
            fits = self._is_near(later, [(one.x_m, one.y_m, one.theta_rad) for one in expected], way)
        return _Look(fits, pose.residual_px)

    def _is_near(self, pose: PoseEstimate, places: Sequence[tuple[float, float, float | None]], way: float) -> bool:
        """Whether a candidate is near one of these poses, within the error of odometry over this way."""
        slack = 3 * pose.std + _ODOMETRY_ERROR * way
        symmetric = self._dataset.symmetry == "point"
        for x_m, y_m, theta_rad in places:
            for one in pose.candidates:
                place = Pose2(x_m, y_m, one.theta_rad if theta_rad is None else theta_rad)
                off_m, off_rad = one.error_to(place, symmetric=symmetric)
                if off_m < _MAX_ERROR_M + slack[:2].max() and off_rad < _MAX_ERROR_RAD + slack[2]:
                    return True
        return False

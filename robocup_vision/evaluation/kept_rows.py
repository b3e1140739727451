"""Results of single images as JSON values, so that an interrupted run can be gone on with."""

from __future__ import annotations

import base64
import hashlib
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from robocup_vision.estimates import PoseEstimate
from robocup_vision.evaluation.dataset import Dataset
from robocup_vision.evaluation.detections import detections_json, detections_of
from robocup_vision.evaluation.overlays import Crop
from robocup_vision.evaluation.scoring import Row, SteerResult, pose_error
from robocup_vision.evaluation.steering import SteerPlan
from robocup_vision.geometry import Pose2


@dataclass(frozen=True, slots=True)
class FrameResult:
    """A row of the results, and what the report may show of it."""

    row: Row  #: of the results
    jpeg: bytes | None = None  #: the encoded picture
    overlay_problem: str = ""  #: why its overlay was not drawn
    crops: tuple[Crop, ...] = ()  #: what was missed in it, and what was told where nothing is


def run_json(dataset: Dataset, steering: SteerPlan | None = None) -> dict[str, Any]:
    """Return what the rows of a dataset depend on."""
    return {
        "format": 4,
        "images": len(dataset.image_names),
        "image names": _digest(dataset.image_names),
        "field": dataset.field.name,
        "camera": _digest(dataset.camera if dataset.rig is None else dataset.rig),
        "colors": _digest(dataset.colors),
        "method": dataset.method,
        "pose_of": dataset.pose_of,
        "steering": None if steering is None else repr(steering),
        "boxes": _digest(dataset.boxes),
    }


def _digest(value: object) -> str:
    return hashlib.sha256(repr(value).encode()).hexdigest()[:12]


def result_json(result: FrameResult) -> dict[str, Any]:
    """Return a result as JSON values; truth and error are left to the dataset."""
    row = result.row
    values: dict[str, Any] = {"image": row.image, "time_s": row.time_s, "reason": row.reason, "failed": row.failed}
    values["unreadable"] = row.unreadable
    if row.estimate is not None:
        estimate = row.estimate
        values["candidates"] = [pose.array.tolist() for pose in estimate.candidates]
        values["covariance"] = estimate.covariance.tolist()
        values["inlier_ratio"], values["residual_px"] = float(estimate.inlier_ratio), float(estimate.residual_px)
    if row.steering is not None:
        values["steering"] = asdict(row.steering)
    values["detections"] = detections_json(row.detections)
    values["crops"] = [[crop.caption, base64.b64encode(crop.jpeg).decode()] for crop in result.crops]
    if result.jpeg is not None:
        values["jpeg"] = base64.b64encode(result.jpeg).decode()
        values["overlay_problem"] = result.overlay_problem
    return values


def result_of(values: dict[str, Any], dataset: Dataset) -> FrameResult:
    """Return the result that `result_json` took apart."""
    truth = dataset.truth.get(values["image"])
    estimate = error = None
    if "candidates" in values:
        candidates = tuple(Pose2(*pose) for pose in values["candidates"])
        covariance = np.array(values["covariance"])
        estimate = PoseEstimate(candidates[0], covariance, values["inlier_ratio"], values["residual_px"], candidates)
        if truth is not None:
            error = pose_error(estimate, truth, symmetric=dataset.symmetry == "point")
    steering = values.get("steering")
    if steering is not None:
        pairs = {name: tuple(steering[name]) for name in ("velocity_mps", "command_mps")}
        steering = SteerResult(**{**steering, **pairs})
    row = Row(
        values["image"],
        estimate,
        truth,
        error,
        values["time_s"],
        values["reason"],
        values["failed"],
        values["unreadable"],
        steering,
        detections_of(values["detections"]),
    )
    jpeg = values.get("jpeg")
    picture = None if jpeg is None else base64.b64decode(jpeg)
    crops = tuple(Crop(caption, base64.b64decode(crop)) for caption, crop in values["crops"])
    return FrameResult(row, picture, values.get("overlay_problem", ""), crops)

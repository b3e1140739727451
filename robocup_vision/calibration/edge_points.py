"""Points on the field's edges in a forward camera's picture, predicted from a pose and searched along the normals.

The samples are those of the edge follower (`kernels.model_edges`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray, Int64Array, UInt8Array, plain_frame
from robocup_vision.compiling.prepared_kernels import prepare
from robocup_vision.kernels.model_edges import tables
from robocup_vision.kernels.model_edges.carpet import CARPET, carpet_look
from robocup_vision.kernels.model_edges.follow import brightness
from robocup_vision.kernels.model_edges.prediction import predict
from robocup_vision.kernels.model_edges.search import search
from robocup_vision.localization.model_edges.field_edges import field_edges
from robocup_vision.localization.model_edges.settings import EdgeSettings

# greatest number of samples in a picture
_MAX_SAMPLES = 600
# indices of focal length and centre in a lens table
_FOCAL_V, _CENTER_V = 1, 3


class EdgePoints(NamedTuple):
    """Measured edge points, with derivatives along the normals of their edges."""

    #: (N, C) float64: offset of each candidate from the prediction; infinite for missing candidates
    offset_px: FloatArray
    by_camera: FloatArray  #: (N, 6) float64: derivatives by tilt, roll, height, logarithm of the focal length, centre
    by_frame: FloatArray  #: (N, 6) float64: by the camera's place and heading on the field, and tilt, roll and height
    by_line_width: FloatArray  #: (N,) float64: derivatives by the logarithm of the painted lines' width
    feature: Int64Array  #: (N,) int64: index of the edge
    pixels: FloatArray  #: (N, 2) float64: the predictions
    normal: FloatArray  #: (N, 2) float64

    def residual(self, expected_px: FloatArray) -> FloatArray:
        """Return the expected offset (N,) minus that of the nearest candidate."""
        nearest = np.argmin(np.abs(self.offset_px - expected_px[:, None]), axis=1)
        return np.asarray(expected_px - self.offset_px[np.arange(len(nearest)), nearest])


class EdgePointFinder:
    """Finds points on a field's edges in pictures of one size.

    Parameters
    ----------
    mask : (H, W) uint8, optional
        Pixels where it is not zero are not used.
    """

    def __init__(self, field: Field, width_px: int, mask: UInt8Array | None = None) -> None:
        prepare("pinhole_edges")
        self._numbers, self._mask = EdgeSettings().for_width(width_px, field.line_width_m), mask
        self.edges = field_edges(field)
        self._workspace = tables.empty_buffers(_MAX_SAMPLES, 0)
        first = [*self.edges.segments[self.edges.segments[:, 13] > 0, 11], *self.edges.arcs[:, 7]]
        self._of_lines = np.array([edge for one in first for edge in (one, one + 1)], dtype=np.int64)

    def find(
        self,
        frame: UInt8Array,
        lens: FloatArray,
        unknowns: FloatArray,
        reach_px: float,
        edges: tables.FieldEdges | None = None,
    ) -> EdgePoints:
        """Find points in a picture.

        Parameters
        ----------
        lens : (L,) float64
            The camera's `lens_table`.
        unknowns : (7,) float64
            Unknowns of `kernels.model_edges`: the camera's place, heading, tilt, roll and height; then 0.
        reach_px : float
            Range of the search on either side of the prediction.
        edges : FieldEdges, optional
            The field's edges, with the paint brightness of this picture.
        """
        edges, workspace, carpet = edges or self.edges, self._workspace, np.zeros(CARPET)
        frame, samples, found = plain_frame(frame), workspace.samples, workspace.found
        workspace.reach_px[:] = reach_px
        carpet_look(frame, int(lens[_CENTER_V] + lens[_FOCAL_V] * math.tan(unknowns[tables.TILT])), carpet)
        count = int(predict(edges, lens, unknowns, self._numbers.spacing_px, samples))
        search(frame, edges.channels, carpet, brightness(carpet), self._numbers, workspace, count)
        candidates = found.candidates[:count]
        seen = candidates > 0
        if self._mask is not None:
            u, v = np.rint(samples.uv[:count]).astype(np.int64).T
            seen &= self._mask[v, u] == 0
        offset, jacobian, normal = (part[:count][seen] for part in (found.offset_px, samples.jacobian, samples.normal))
        feature = samples.feature[:count][seen]
        is_line = (samples.kind[:count][seen] == tables.EDGE) & np.isin(feature, self._of_lines)
        return EdgePoints(
            np.where(np.arange(offset.shape[1]) < candidates[seen][:, None], offset, np.inf),
            np.column_stack([jacobian[:, tables.TILT :], normal]),
            jacobian[:, : tables.LOG_FOCAL],
            np.where(is_line, -0.5 * samples.width_px[:count][seen], 0.0),
            feature,
            samples.uv[:count][seen],
            normal,
        )

"""Reads the weights of a fit's figures in the log odds of a pose.

They are data: `evidence.toml`, which `robocup-vision fit-edge-evidence` writes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np

from field_models.toml_file import StrictStruct, load_toml
from robocup_vision.arrays import FloatArray

PACKAGED = Path(__file__).with_name("evidence.toml")


class _Weights(StrictStruct):
    squared_distance: float
    log_inliers: float
    missing: float
    hidden: float
    unexplained: float
    rms_px: float
    edges: float
    log_std_m: float


#: what is weighed, in the order of `EdgeWeights`
WEIGHTS = _Weights.__struct_fields__


class _EvidenceFile(StrictStruct):
    format: Literal[1]
    command: str
    sets: list[str]
    near_prior: float
    anywhere: float
    within_picture: float
    sure_log_odds: float
    weights: _Weights


@dataclass(frozen=True, slots=True, eq=False)
class EdgeWeights:
    """Weights of the log odds of a pose."""

    #: (9,) float64: of a fit near a prior, as `kernels.model_edges.verdict.log_odds` takes them
    near_prior: FloatArray
    anywhere: float  #: constant of a fit without a prior, relative to the outcome that none is right
    #: factor on the terms where poses of one picture are compared: there they discriminate better than between pictures
    within_picture: float
    sure_log_odds: float  #: log odds that fits of wrong poses hardly exceed


def load_edge_weights(path: str | Path = PACKAGED) -> EdgeWeights:
    """Read the fitted weights.

    Parameters
    ----------
    path : str or Path, optional
        A file of `robocup-vision fit-edge-evidence`; without it the one that comes with the package.

    Raises
    ------
    FileError
        If the file is missing or wrong.
    """
    described = load_toml(path, _EvidenceFile)
    near_prior = np.array([described.near_prior, *msgspec.structs.astuple(described.weights)])
    return EdgeWeights(near_prior, described.anywhere, described.within_picture, described.sure_log_odds)


@lru_cache(maxsize=1)
def packaged_edge_weights() -> EdgeWeights:
    """Return the weights that come with the package, read once: calibration in play makes new followers."""
    return load_edge_weights()

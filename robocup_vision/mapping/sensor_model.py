"""Models a sensor's reliability: P(O|E) and P(O|not E), learnt from runs with truth, read from a file."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError, FileError
from field_models.toml_file import StrictStruct, convert, load_toml
from robocup_vision.arrays import BoolArray, Int8Array
from robocup_vision.files.text_files import write_lines
from robocup_vision.kernels.mapping import occupancy as kernel

DEFAULT_FILE = Path(__file__).parent / "sensors.toml"


@dataclass(frozen=True, slots=True)
class SensorModel:
    """The map's model of one sensor (Miura 2004, section 2.2.3).

    Parameters
    ----------
    hit_if_occupied : float
        P(O|E): fraction of the occupied cells with evidence in which it measures a hit.
    hit_if_free : float
        P(O|not E): the same fraction of the free cells.
    nearest_m, reach_m : float
        Ranges between which it measures, from the robot's centre.

    Raises
    ------
    ArgumentError
        If not 0 < hit_if_free < hit_if_occupied < 1, or not 0 <= nearest_m < reach_m.
    """

    hit_if_occupied: float
    hit_if_free: float
    nearest_m: float = 0.0
    reach_m: float = 2.0

    def __post_init__(self) -> None:
        if not 0 < self.hit_if_free < self.hit_if_occupied < 1:
            raise ArgumentError(
                "probabilities must be 0 < hit_if_free < hit_if_occupied < 1, got "
                f"hit_if_free {self.hit_if_free}, hit_if_occupied {self.hit_if_occupied}"
            )
        if not 0 <= self.nearest_m < self.reach_m < math.inf:
            raise ArgumentError(
                f"ranges must be 0 <= nearest_m < reach_m, got nearest_m {self.nearest_m}, reach_m {self.reach_m}"
            )

    @property
    def hit_step(self) -> float:
        """Change of a cell's log-odds by the event O."""
        return math.log(self.hit_if_occupied / self.hit_if_free)

    @property
    def crossed_step(self) -> float:
        """Change of a cell's log-odds by the event not O; negative."""
        return math.log((1 - self.hit_if_occupied) / (1 - self.hit_if_free))

    def observations_needed(self, free_probability: float) -> int:
        """Return n_req, the correct observations that take a cell from 0.5 to this probability of being occupied."""
        return math.ceil(-math.log(free_probability / (1 - free_probability)) / -self.crossed_step)


class _Sensor(StrictStruct):
    hit_if_occupied: float
    hit_if_free: float
    nearest_m: float
    reach_m: float


class _SensorFile(StrictStruct):
    format: Literal[1]
    source: str
    sensors: dict[str, Any]


def load_sensors(path: str | Path) -> dict[str, SensorModel]:
    """Read sensor models by name from a file.

    Raises
    ------
    FileError
        If the file cannot be read, a key is missing or unknown, or a value is impossible.
    """
    content = load_toml(path, _SensorFile)
    if not content.sensors:
        raise FileError(path, "must name at least one sensor", key="sensors")
    return {name: _model(path, name, raw) for name, raw in content.sensors.items()}


def _model(path: str | Path, name: str, raw: Any) -> SensorModel:
    try:
        entry = convert(path, raw, _Sensor)
        return SensorModel(entry.hit_if_occupied, entry.hit_if_free, entry.nearest_m, entry.reach_m)
    except FileError as error:
        key = f"sensors.{name}.{error.key}" if error.key else f"sensors.{name}"
        raise FileError(path, error.problem, key=key, value=error.value) from None
    except ArgumentError as error:
        raise FileError(path, str(error), key=f"sensors.{name}") from None


def write_sensors(path: str | Path, sensors: Mapping[str, SensorModel], source: str) -> None:
    """Write sensor models by name to a file that `load_sensors` reads.

    Parameters
    ----------
    path : str or Path
        The file.
    sensors : mapping of str to SensorModel
        Names are of letters, digits, ``_`` and ``-``.
    source : str
        How they were learnt.

    Raises
    ------
    ArgumentError
        If a name cannot be a bare TOML key.
    FileError
        If the file cannot be written.
    """
    lines = ["format = 1", f"source = {json.dumps(source, ensure_ascii=False)}"]
    for name, model in sensors.items():
        if not name or not all(c.isascii() and (c.isalnum() or c in "_-") for c in name):
            raise ArgumentError(f"a sensor's name must be of letters, digits, _ and -, got {name!r}")
        lines += ["", f"[sensors.{name}]"]
        lines.append(f"hit_if_occupied = {model.hit_if_occupied:.6g}  # P(O|E)")
        lines.append(f"hit_if_free = {model.hit_if_free:.6g}  # P(O|not E)")
        lines += [f"nearest_m = {model.nearest_m!r}", f"reach_m = {model.reach_m!r}"]
    write_lines(path, lines)


def default_sensors() -> dict[str, SensorModel]:
    """Return the models that come with the project: ``floor``, a mirror camera's floor colour, and ``range``."""
    return load_sensors(DEFAULT_FILE)


class SensorTally:
    """Counts the evidence of a sensor over cells of known truth, to learn its probabilities."""

    def __init__(self) -> None:
        self._counts = np.zeros((2, 2), dtype=np.int64)

    def add(self, evidence: Int8Array, occupied: BoolArray, free: BoolArray) -> None:
        """Count one profile.

        Parameters
        ----------
        evidence : (N, N) int8
            From `FreeSpaceMap.evidence`.
        occupied, free : (N, N) bool
            The truth; cells that are neither do not count.
        """
        for row, cells in enumerate((occupied, free)):
            kinds = evidence[cells]
            self._counts[row] += np.count_nonzero(kinds == kernel.HIT), np.count_nonzero(kinds == kernel.CROSSED)

    def merge(self, other: SensorTally) -> None:
        """Add another tally's counts."""
        self._counts += other._counts

    @property
    def counts(self) -> npt.NDArray[np.int64]:
        """(2, 2) int64: occupied and free cells by hit and crossed."""
        return self._counts.copy()

    def model(self, nearest_m: float, reach_m: float) -> SensorModel:
        """Return the sensor's model: ratios with one count of each kind added, so that none is 0 or 1.

        Raises
        ------
        ArgumentError
            If the sensor gives no information: it has hits in free cells as often as in occupied ones.
        """
        occupied, free = ((self._counts[:, 0] + 1) / (self._counts.sum(axis=1) + 2)).tolist()
        if not free < occupied:
            raise ArgumentError(
                f"the sensor gives no information: it has hits in {occupied:.1%} of the occupied cells with evidence "
                f"and in {free:.1%} of the free ones"
            )
        return SensorModel(occupied, free, nearest_m, reach_m)

"""Names of the array types for annotations, and read-only copies for immutable values."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

BoolArray = npt.NDArray[np.bool_]
Int8Array = npt.NDArray[np.int8]
Int16Array = npt.NDArray[np.int16]
Int32Array = npt.NDArray[np.int32]
Int64Array = npt.NDArray[np.int64]
UInt8Array = npt.NDArray[np.uint8]
UInt16Array = npt.NDArray[np.uint16]
UInt32Array = npt.NDArray[np.uint32]
UInt64Array = npt.NDArray[np.uint64]
Float32Array = npt.NDArray[np.float32]
FloatArray = npt.NDArray[np.float64]
# images passed by users: OpenCV's annotations only say that elements are numbers; type and size are checked later
Frame = npt.NDArray[np.integer[Any] | np.floating[Any]]


def plain_frame(frame: UInt8Array) -> UInt8Array:
    """Return a frame as expected by compiled loops, in C order and writable; the same object if it already is."""
    flags = frame.flags
    # `np.require` takes five times as long if nothing has to be done
    if type(frame) is np.ndarray and flags.c_contiguous and flags.writeable:
        return frame
    return np.require(frame, requirements=("C", "W"))


def read_only(array: npt.ArrayLike) -> FloatArray:
    """Return a read-only float64 copy, as all immutable values use; the same object if it already is read-only."""
    if type(array) is np.ndarray and array.base is None and array.dtype == np.float64 and not array.flags.writeable:
        return array
    copy = np.array(array, dtype=np.float64)
    copy.setflags(write=False)
    return copy

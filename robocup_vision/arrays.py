"""Names of the array types that annotations use, and read-only copies for immutable values.

Kernels, values and estimators name the same few element types; each name stands here once.
"""

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
# what users hand over: OpenCV says of an image that it is an array of some number, and None where it could not be read;
# the type and size are checked when it is used
Frame = npt.NDArray[np.integer[Any] | np.floating[Any]]


def plain_frame(frame: UInt8Array) -> UInt8Array:
    """Return a frame as loops are compiled for: in C order and writable; itself where it is so."""
    flags = frame.flags
    # `np.require` takes five times as long to find that nothing is to be done
    if type(frame) is np.ndarray and flags.c_contiguous and flags.writeable:
        return frame
    return np.require(frame, requirements=("C", "W"))


def read_only(array: npt.ArrayLike) -> FloatArray:
    """Return a float64 copy that nobody can write to, as every value type here holds; such a one itself."""
    if type(array) is np.ndarray and array.base is None and array.dtype == np.float64 and not array.flags.writeable:
        return array
    copy = np.array(array, dtype=np.float64)
    copy.setflags(write=False)
    return copy

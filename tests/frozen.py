"""Arrays that nobody can write to, as the product hands them to its loops: another type would be compiled anew."""

import numpy as np


def frozen(array: np.ndarray) -> np.ndarray:
    array.setflags(write=False)
    return array

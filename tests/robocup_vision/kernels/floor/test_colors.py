"""The floor's compiled loops against plain NumPy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.floor import colors as kernel
from robocup_vision.perception.color_table import LLR_CLIP, LLR_PER_UNIT
from robocup_vision.perception.floor_color import LEVELS, FloorColor, PaintColor


@settings(deadline=None, max_examples=40)
@given(
    level=st.floats(8.0, 220.0),
    noise=st.floats(0.0, 12.0),
    red=st.floats(0.2, 1.5),
    blue=st.floats(0.2, 1.5),
    white=st.tuples(st.floats(0.5, 1.6), st.floats(0.5, 1.6)),
    seed=st.integers(0, 2**31),
)
def test_the_table_is_the_model(level, noise, red, blue, white, seed):
    rng = np.random.default_rng(seed)
    curve = np.exp(rng.normal(0, 0.1, (2, len(LEVELS))))
    floor = FloorColor(level, noise, red * curve[0], blue * curve[1], np.array([0.05, 0.08]))
    paint = PaintColor(*white)
    # eighths of a count, so that the table's steps of brightness fall on them
    bins = [np.sort(rng.integers(0, 255, n)).astype(np.float64) for n in (32, 64, 32)]
    out = np.empty(65536, dtype=np.int8)
    kernel.tabulate(*bins, *floor.densities(paint), LLR_CLIP, LLR_PER_UNIT, out)
    colors = [channel.ravel() for channel in np.meshgrid(*bins, indexing="ij")]
    expected = np.clip(floor.log_likelihood_ratio(*colors, paint), -LLR_CLIP, LLR_CLIP) / LLR_PER_UNIT
    assert np.abs(out - expected).max() <= 0.5 + 1e-6


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 2**31), stride=st.integers(1, 5), sure=st.integers(-20, 60))
def test_light_is_added_up_by_brightness(seed, stride, sure):
    rng = np.random.default_rng(seed)
    samples = rng.integers(0, 256, (23, 17, 3)).astype(np.uint8)
    llr = rng.integers(-64, 65, (23, 17)).astype(np.int8)
    step_of_sum = np.sort(rng.integers(0, len(LEVELS), 1021)).astype(np.uint8)
    ratios, sunny = rng.uniform(0.3, 3.0, (2, len(LEVELS))), rng.uniform(0.0, 1.0)
    found = kernel.light_on_floor(samples, llr, sure, stride, step_of_sum, ratios, sunny)
    b, g, r = (samples[::stride, :, i][llr[::stride] >= sure].astype(int) for i in range(3))
    step = step_of_sum[r + 2 * g + b]
    if not len(step):
        assert found == (0, 0.0, 0.0, 0.0)
        return
    counts = np.bincount(step, minlength=len(LEVELS))
    upper = np.cumsum(counts)
    sunlit = int(np.searchsorted(upper, sunny * len(step), side="right"))
    share = (sunny * len(step) - upper[sunlit - 1]) / counts[sunlit] - 0.5 if sunlit else 0.5
    casts = [
        np.log(max(seen.sum(), 1) / max((ratio[step] * g).sum(), 1)) for seen, ratio in zip((r, b), ratios, strict=True)
    ]
    assert found == pytest.approx((len(step), sunlit + share, *casts), abs=1e-9)

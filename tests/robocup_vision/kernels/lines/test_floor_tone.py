"""The floor's tone learnt from made-up pixels."""

import numpy as np
import pytest

from robocup_vision.kernels.lines.floor_tone import ToneRules, learn_tone

RULES = ToneRules()


def test_a_vivid_green_is_a_tone_though_red_and_blue_are_black():
    frame = np.full((40, 50, 3), 40, dtype=np.uint8)
    frame[:, :20] = (2, 110, 0)
    frame[:, 18:20] = (9, 110, 12)
    tone = np.empty(7, dtype=np.float32)
    assert learn_tone(frame, np.arange(2000), RULES, tone)
    assert tone[0] == tone[2] == 0.0
    assert max(tone[1], tone[3]) < 0.3
    assert tone[4] == pytest.approx(0.35 * 110)


@pytest.mark.parametrize("color", [(255, 255, 255), (0, 0, 0), (2, 20, 0), (1, 60, 45)])
def test_pictures_burnt_out_or_with_a_black_channel_tell_no_tone_but_of_a_vivid_green(color):
    frame = np.full((40, 50, 3), color, dtype=np.uint8)
    assert not learn_tone(frame, np.arange(2000), RULES, np.empty(7, dtype=np.float32))


def test_too_few_pixels_tell_no_tone():
    frame = np.full((40, 50, 3), (50, 110, 55), dtype=np.uint8)
    assert not learn_tone(frame, np.arange(49), RULES, np.empty(7, dtype=np.float32))

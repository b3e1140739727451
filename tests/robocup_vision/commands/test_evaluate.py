"""`robocup-vision evaluate` of a recording: a click on an image in its report opens that moment in the live page."""

from pathlib import Path

import cv2
import pytest

from field_models import load_field
from robocup_vision import Vision, cli, load_camera
from robocup_vision.recording.recorder import Recorder

DATASET = Path(__file__).parents[3] / "images" / "omni_ssl_2001"


@pytest.mark.slow
def test_images_of_a_recording_are_linked_to_their_moments(tmp_path):
    """Only this finds a report whose images lead to other moments of the recording."""
    vision = Vision(load_field("ssl_2001"), load_camera(DATASET / "camera.toml"))
    frames = [cv2.imread(str(path)) for path in sorted((DATASET / "images").glob("*.png"))[:3]]
    with Recorder(tmp_path / "run.mcap", vision) as recorder:
        for number, frame in enumerate(frames):
            recorder.look(frame, t_s=100.0 + 0.5 * number)
    assert cli.main(["evaluate", str(tmp_path / "run.mcap"), "--out", str(tmp_path / "out")]) == 0
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    for t_s in ("0.000", "0.500", "1.000"):
        assert f'href="http://127.0.0.1:8090/?recording=run.mcap&amp;t={t_s}"' in page

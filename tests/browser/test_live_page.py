"""The live page in a real browser, during a simulated match: `make browser-test` installs the browser and runs this."""

import json
import math
import re
import subprocess
import sys
import time

import pytest

from robocup_vision.evaluation.dataset import load_dataset

pytestmark = [pytest.mark.slow, pytest.mark.browser]


@pytest.fixture
def match(tmp_path):
    """Serve a match; yield the page's address."""
    arguments = ["sim:ssl_2001,players=1,robots=0+1,seed=2,ours=memory", "--port", "0", "--out", str(tmp_path / "out")]
    program = [sys.executable, "-m", "robocup_vision.cli", "live", *arguments, "--seconds", "400"]
    with subprocess.Popen(program, stdout=subprocess.PIPE, text=True) as process:
        line = process.stdout.readline()
        assert line.startswith("live at "), line
        # compiled code is loaded before the browser comes
        time.sleep(3.0)
        yield line.split()[2]
        process.terminate()


def test_a_user_watches_a_match(node, match, tmp_path):
    """Only this finds what a browser refuses of the live page, and what it shows in a wrong place."""
    done = node("live_page.mjs", match, tmp_path)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout.splitlines()[-1])
    assert told["errors"] == []
    assert told["done"]
    assert told["console"] == []
    host = match.split("//")[1]
    elsewhere = [url for url in told["requests"] if not url.startswith((match, f"ws://{host}", "blob:", "data:"))]
    assert told["requests"]
    assert elsewhere == []

    assert told["robots"] == 2
    assert told["image_changes"]
    assert len(told["poses"]) >= 20
    errors_m = [math.dist(pose["shown"], pose["truth"][:2]) for pose in told["poses"]]
    # which frames the page shows depends on the machine; in one of a hundred others have just moved the robot
    assert sorted(errors_m)[len(errors_m) * 3 // 4] < 0.01, told["poses"]
    assert max(errors_m) < 0.05, told["poses"]
    for pose in told["poses"]:
        # the text a user reads is that pose
        read = [float(text.replace("−", "-")) for text in re.findall(r"[xy] ([+−][0-9.]+) m", pose["text"])]
        assert read == pytest.approx(pose["shown"], abs=6e-4)

    assert told["stands_still"]
    assert (told["step_on"], told["step_back"]) == (1, -1)
    assert "before the newest" in told["state"]
    assert all(layer["returns"] for layer in told["layers"].values())
    changing = {name for name, layer in told["layers"].items() if layer["changes"]}
    assert changing >= {"edge", "lines", "free", "field", "map", "truth", "trail"}
    assert told["key_switches"]
    assert told["theme_switches"]
    assert len(load_dataset(told["saved"]).image_names) == 1

    assert told["middle"][:2] == pytest.approx([0.0, 0.0], abs=0.02)
    assert told["right"][0] > 0.5
    assert told["zoomed"][0] == pytest.approx(told["right"][0] / 1.5, abs=0.02)
    assert told["zoom_changes"]
    assert told["zoom_returns"]
    assert told["pixel"] == pytest.approx([128, 110], abs=2)
    assert [text.split()[0] for text in told["plots"]] == ["Position", "Heading", "Time"]
    assert all(re.search(r"\d", text) for text in told["plots"])
    # one control period later it has hardly moved
    assert math.dist(told["put"][:2], told["asked"]) < 0.05
    for width, seen in told["widths"].items():
        assert seen["document_px"] <= int(width)
        assert seen["beyond"] == []
        assert seen["overlaps"] == []

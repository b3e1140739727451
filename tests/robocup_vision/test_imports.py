"""Public names, and what importing them loads."""

import json
import subprocess
import sys
from importlib import metadata

import pytest

import robocup_vision

HEAVY = ["pymunk", "matplotlib", "scipy", "skimage", "jinja2"]
LESS_THAN_HEAVY = [name for name in HEAVY if name != "scipy"]
BEYOND_THE_LINK = [f"sim2d.{part}" for part in ("world", "match", "rendering", "sensors", "players", "kernels")]
WEB = ["starlette", "uvicorn", "websockets", "anyio", "mcap", "rosbags"]
HELP = """
import contextlib, io
from robocup_vision import cli
for words in (["--help"], ["evaluate", "--help"], ["render", "--help"]):
    with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()) as said:
        cli.main(words)
    assert "usage: robocup-vision" in said.getvalue()
"""
# in the order of how much they load: one process asks them all
STEPS = {
    "the package": ("import robocup_vision", ["robocup_vision."]),
    "the command line's help": (HELP, ["numpy", "cv2", "numba", *HEAVY]),
    "what stands at the package's top": (
        "robocup_vision.__version__, robocup_vision.ArgumentError, robocup_vision.load_field",
        ["numba", *BEYOND_THE_LINK, *HEAVY],
    ),
    "the cameras": ("import field_models, robocup_vision.camera", ["google", *BEYOND_THE_LINK, *HEAVY]),
    # numba, which loops need, loads a part of SciPy
    "the simulator's link": ("import sim2d.robot_link", [*BEYOND_THE_LINK, *LESS_THAN_HEAVY]),
    "vision and the live page": (
        "import robocup_vision.vision, robocup_vision.live",
        ["google", *BEYOND_THE_LINK, *WEB, *LESS_THAN_HEAVY],
    ),
}
PROGRAM = """
import json, sys
loaded = {}
for name, (step, names) in json.loads(sys.argv[1]).items():
    exec(step)
    loaded[name] = sorted({
        module for module in sys.modules
        if any(module == one or module.startswith(one if one.endswith(".") else one + ".") for one in names)
    })
print(json.dumps(loaded))
"""


@pytest.fixture(scope="module")
def loaded():
    words = [sys.executable, "-c", PROGRAM, json.dumps(STEPS)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize("name", STEPS)
def test_it_loads_nothing_that_it_does_not_need(loaded, name):
    assert loaded[name] == []


def test_every_public_name_exists():
    assert "Vision" in robocup_vision.__all__
    for name in robocup_vision.__all__:
        assert getattr(robocup_vision, name).__name__ == name
    assert set(robocup_vision.__all__) <= set(dir(robocup_vision))


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="nothing_of_this_name"):
        robocup_vision.nothing_of_this_name  # noqa: B018


def test_field_errors_and_version_stand_at_the_top():
    assert robocup_vision.__version__ == metadata.version("robocup-vision")
    assert issubclass(robocup_vision.FileError, robocup_vision.RobocupVisionError)
    assert robocup_vision.load_field("ssl_2001").length_m == 2.74

"""The file of how often goals are found: what it says, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from field_models.errors import FileError
from robocup_vision.planning.gaze.goal_evidence import CORNERS, GoalEvidence, load_goal_evidence

GOOD = """
format = 1
command = "by hand"
width_px = [20.0]
again_found = 3
again_missed = 1
""" + "".join(f"[[seen]]\ncorners = {k}\ncounts = [[0, 0, 8], [{k}, 0, 4]]\n" for k in range(CORNERS + 1))


def test_what_comes_with_the_package_is_sound() -> None:
    evidence = load_goal_evidence()
    assert evidence.found.sum(axis=-1) == pytest.approx(1.0)
    assert (evidence.found > 0).all()
    # a whole goal of middling width is nearly always found, and hardly ever taken for the other
    right, wrong, nothing = evidence.chances(CORNERS, 50.0)
    assert right > 0.85
    assert wrong < 0.02
    assert nothing < 0.15
    assert evidence.chances(0, 50.0)[2] > 0.9
    assert 0 < evidence.again < 1


def test_counts_become_chances(tmp_path: Path) -> None:
    path = tmp_path / "evidence.toml"
    path.write_text(GOOD, encoding="utf-8")
    evidence = load_goal_evidence(path)
    assert evidence.chances(2, 19.0) == pytest.approx(np.array([0.5, 0.5, 9.0]) / 10)
    assert evidence.chances(2, 20.0) == pytest.approx(np.array([2.5, 0.5, 5.0]) / 8)
    # first looks at whole goals: 4 of 16 found; second ones 3 of 4, which cannot be more than always
    assert evidence.again == 1.0
    seldom = GoalEvidence.from_counts((20.0,), np.full((CORNERS + 1, 2, 3), (18.0, 0.0, 2.0)), 1, 9)
    assert seldom.again == pytest.approx((2 / 12) / (37 / 42))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("format = 1", "format = 2", "key 'format': is not a format this version reads: must be 1, got 2"),
        ("width_px = [20.0]", "width_px = []", r"key 'width_px': must be positive and ascending, got \[\]"),
        ("width_px = [20.0]", "width_px = [20.0, 10.0]", "key 'width_px': must be positive and ascending"),
        ("width_px = [20.0]", "width_px = [20.0, 30.0]", r"key 'seen\[0\].counts': must have 3 rows"),
        ("again_missed = 1", "again_missed = -1", "key 'again_found': must not be negative"),
        ("corners = 2", "corners = 3", "key 'seen.corners': must be 0 to 4, each once"),
        ("[[0, 0, 8], [2, 0, 4]]", "[[0, -1, 8], [2, 0, 4]]", r"key 'seen\[2\].counts': must not be negative"),
        ('command = "by hand"', "", "key 'command': is missing"),
    ],
)
def test_refuses_bad_files(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in GOOD
    path = tmp_path / "evidence.toml"
    path.write_text(GOOD.replace(old, new), encoding="utf-8")
    with pytest.raises(FileError, match=message):
        load_goal_evidence(path)


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"none\.toml: cannot be read"):
        load_goal_evidence(tmp_path / "none.toml")

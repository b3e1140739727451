"""Which goal to look at for the half, and the file of how often a look finds one."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from strategies import numbers, poses
from wrong_files import problem_of

from field_models import load_field
from field_models.errors import ArgumentError, FileError
from robocup_vision.belief import Hypothesis
from robocup_vision.camera import PinholeCamera
from robocup_vision.disc import Disc
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2, half_turn_covariance
from robocup_vision.planning.gaze.goal_evidence import CORNERS, GoalEvidence, load_goal_evidence
from robocup_vision.planning.gaze.goal_question import DECIDED_NAT, GoalQuestion, identified_goal
from robocup_vision.planning.gaze.pose_gaze import Neck

FIELD = load_field("four_legged_2007")
CAMERA = PinholeCamera((208, 160), (192.0, 192.0), (103.5, 79.5), 0.185, tilt_rad=-0.2, roll_rad=0.0)
NECK = Neck(1.4)
SMALL = np.diag([0.01, 0.01, 0.01]) ** 2


def _evidence(found: float, wrong: float = 0.0, again: float = 1.0) -> GoalEvidence:
    """Only whole goals are found, whatever their width."""
    table = np.zeros((CORNERS + 1, 2, 3))
    table[..., 2] = 1.0
    table[CORNERS] = (found, wrong, 1 - found - wrong)
    return GoalEvidence((40.0,), table, again)


def _halves(pose: Pose2, probability: float = 0.5, covariance: np.ndarray = SMALL) -> list[Hypothesis]:
    turned = Hypothesis(pose.half_turn(), half_turn_covariance(covariance), 1 - probability)
    return [Hypothesis(pose, covariance, probability), turned]


def test_looks_at_the_goal_within_reach() -> None:
    pose = Pose2(0.0, 0.0, 0.0)
    look = GoalQuestion(FIELD, CAMERA, NECK, _evidence(0.9)).choose(_halves(pose))
    assert look.answer == "look"
    assert look.pan_rad == pytest.approx(0.0, abs=0.1)
    assert look.entropy_nat == pytest.approx(math.log(2))
    # found in nine of ten looks, and then nothing is left in doubt
    assert look.expected_nat == pytest.approx(0.1 * math.log(2), abs=1e-6)
    assert look.reason == f"look {math.degrees(look.pan_rad):+.0f} deg: 0.07 of 0.69 nat to be left"


def test_prefers_the_goal_that_no_robot_hides() -> None:
    # both goals within reach, the one at +x nearer
    pose = Pose2(0.5, -1.4, math.pi / 2)
    question = GoalQuestion(FIELD, CAMERA, NECK, _evidence(0.9))
    assert question.choose(_halves(pose)).pan_rad is not None
    robot = Disc(1.6, -0.6, 0.4, 1e-6 * np.eye(2), height_m=0.6)
    hidden = question.choose(_halves(pose), blockers=[robot])
    assert hidden.pan_rad is not None
    assert hidden.pan_rad > 0
    assert question.choose(_halves(pose), pan_rad=-0.9).pan_rad < 0
    # the same robot beside the same dog, said of the other half
    turned = Disc(-1.6, 0.6, 0.4, 1e-6 * np.eye(2), height_m=0.6)
    other = question.choose(_halves(pose.half_turn()), blockers=[turned])
    assert other.expected_nat == pytest.approx(hidden.expected_nat)


def test_a_goal_gives_the_half() -> None:
    question = GoalQuestion(FIELD, CAMERA, NECK, _evidence(0.88, wrong=0.02))
    halves = _halves(Pose2(0.0, 0.0, 0.0))
    assert question.observe(halves, 0.0, 1) == pytest.approx([0.88 / 0.9, 0.02 / 0.9])
    assert question.observe(halves, 0.0, -1) == pytest.approx([0.02 / 0.9, 0.88 / 0.9])
    assert question.observe(halves, 0.0, 0) == pytest.approx([0.5, 0.5])


def test_nothing_seen_speaks_against_whoever_promised_a_goal() -> None:
    facing = Hypothesis(Pose2(1.0, 0.0, 0.0), SMALL, 0.5)
    sideways = Hypothesis(Pose2(1.0, 0.0, math.pi / 2), SMALL, 0.5)
    share = GoalQuestion(FIELD, CAMERA, NECK, _evidence(0.9)).observe([facing, sideways], 0.0, 0)
    assert share == pytest.approx([0.1 / 1.1, 1 / 1.1])


def test_decided_when_little_entropy_is_left() -> None:
    question = GoalQuestion(FIELD, CAMERA, NECK, _evidence(0.9))
    sure = question.choose(_halves(Pose2(0.0, 0.0, 0.0), 0.985))
    assert sure.answer == "decided"
    assert sure.pan_rad is None
    assert sure.entropy_nat <= DECIDED_NAT
    assert sure.reason.startswith("decided: 98.5% sure")
    assert question.choose(_halves(Pose2(0.0, 0.0, 0.0), 0.9)).answer == "look"


@pytest.mark.parametrize("name", ["spl_2020", "msl_18x12", "ssl_division_b", "msl_6x4"])
def test_a_pitch_whose_halves_look_alike_is_undecidable_at_once(name: str) -> None:
    question = GoalQuestion(load_field(name), CAMERA, NECK, _evidence(1.0))
    look = question.choose(_halves(Pose2(0.5, 0.5, 0.0)))
    assert look.answer == "undecidable"
    assert look.reason == "undecidable: the goals of this field look alike"
    assert question.observe(_halves(Pose2(0.5, 0.5, 0.0)), 0.0, 1) == pytest.approx([0.5, 0.5])


def test_undecidable_from_where_no_goal_can_be_seen() -> None:
    # in a corner, facing out
    pose = Pose2(2.4, 1.6, math.pi / 4)
    look = GoalQuestion(FIELD, CAMERA, Neck(0.3), _evidence(0.9)).choose(_halves(pose))
    assert look.answer == "undecidable"
    assert look.reason.startswith("undecidable from here: the best look would leave 0.69 of 0.69 nat")


def test_does_not_look_for_ever_where_looks_fail() -> None:
    question = GoalQuestion(FIELD, CAMERA, NECK, _evidence(0.9, again=0.0))
    halves = _halves(Pose2(0.0, 0.0, 0.0))
    look = question.choose(halves)
    assert look.pan_rad is not None
    question.observe(halves, look.pan_rad, 0)
    assert question.choose(halves).answer == "undecidable"


@settings(max_examples=10)
@given(poses(2.0), numbers(0.05, 0.95), numbers(0.3, 0.9), numbers(0.0, 0.1))
def test_laws_of_a_question(pose: Pose2, probability: float, found: float, wrong: float) -> None:
    question = GoalQuestion(FIELD, CAMERA, NECK, _evidence(found, wrong))
    halves = _halves(pose, probability, np.diag([0.1, 0.1, 0.1]) ** 2)
    look = question.choose(halves)
    # a look never adds entropy on average
    assert look.expected_nat <= look.entropy_nat + 1e-12
    assert (look.pan_rad is None) == (look.answer != "look")
    for goal in (1, -1, 0):
        assert GoalQuestion(FIELD, CAMERA, NECK, _evidence(found, wrong + 0.01)).observe(halves, 0.3, goal).sum() == (
            pytest.approx(1.0)
        )
    # which of the two stands first does not matter
    swapped = GoalQuestion(FIELD, CAMERA, NECK, _evidence(found, wrong)).choose(halves[::-1])
    assert swapped.expected_nat == pytest.approx(look.expected_nat, abs=1e-9)


def test_goal_seen_is_the_one_before_the_camera() -> None:
    covariance = np.eye(3)
    at_positive = PoseEstimate(Pose2(1.0, 0.0, 0.2), covariance, 1.0, 0.0)
    assert identified_goal(FIELD, at_positive) == 1
    assert identified_goal(FIELD, at_positive.half_turn()) == -1
    assert identified_goal(FIELD, NotLocated("no goal")) == 0
    both = PoseEstimate(at_positive.pose, covariance, 1.0, 0.0, (at_positive.pose, at_positive.pose.half_turn()))
    assert identified_goal(FIELD, both) == 0
    assert identified_goal(load_field("msl_6x4"), at_positive) == 0


def test_refuses_bad_values() -> None:
    question = GoalQuestion(FIELD, CAMERA, NECK, _evidence(0.9))
    halves = _halves(Pose2(0.0, 0.0, 0.0))
    with pytest.raises(ArgumentError, match="at least one hypothesis"):
        question.choose([])
    with pytest.raises(ArgumentError, match="probabilities must not be negative"):
        question.choose([Hypothesis(Pose2(0, 0, 0), SMALL, -0.1), Hypothesis(Pose2(0, 0, 1), SMALL, 1.1)])
    with pytest.raises(ArgumentError, match=r"goal must be \+1, -1 or 0, got 2"):
        question.observe(halves, 0.0, 2)


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
        ("format = 1", "format = 2", "key 'format': is not a value that this version reads: must be 1, got 2"),
        ("width_px = [20.0]", "width_px = []", "key 'width_px': must be positive and ascending, got []"),
        ("width_px = [20.0]", "width_px = [20.0, 10.0]", "key 'width_px': must be positive and ascending"),
        ("width_px = [20.0]", "width_px = [20.0, 30.0]", "key 'seen[0].counts': must have 3 rows"),
        ("again_missed = 1", "again_missed = -1", "key 'again_missed': must be at least 0, got -1"),
        ("corners = 2", "corners = 3", "key 'seen.corners': must be 0 to 4, each once"),
        ("[[0, 0, 8], [2, 0, 4]]", "[[0, -1, 8], [2, 0, 4]]", "key 'seen[2].counts[0][1]': must be at least 0"),
        ('command = "by hand"', "", "key 'command': is missing"),
    ],
)
def test_refuses_bad_files(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert problem_of(load_goal_evidence, tmp_path / "evidence.toml", GOOD, old, new).startswith(message)


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"none\.toml: cannot be read"):
        load_goal_evidence(tmp_path / "none.toml")

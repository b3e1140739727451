"""Built-in fields against the numbers of the rule books, and a user's own file by the same door."""

import math
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from wrong_files import problem_of

from field_models import ArgumentError, Field, FileError, Net, field_names, load_field

OWN = """format = 1
name = "own"
source = "tape measure"
length_m = 7.8
width_m = 5.4
line_width_m = 0.01
center_circle_radius_m = 0.5
ball_color = "orange"
[boundary]
kind = "boards"
margin_m = 0.3
height_m = 0.1
color = "black"
[goal]
kind = "panels"
width_m = 1.0
depth_m = 0.18
height_m = 0.155
[penalty_area]
depth_m = 0.9
width_m = 1.8
[penalty_arc]
center_x_m = 3.0
radius_m = 0.5
[[beacons]]
x_m = 1
y_m = 3
radius_m = 0.05
height_m = 0.4
colors = ["white", "pink"]
"""

Write = Callable[[str], Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def _write(text: str) -> Path:
        path = tmp_path / "own.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return _write


def has_line(field: Field, x0: float, y0: float, x1: float, y1: float) -> bool:
    ends = field.lines.reshape(-1, 2, 2)
    wanted = np.array([[x0, y0], [x1, y1]])
    return any(np.allclose(e, wanted) or np.allclose(e[::-1], wanted) for e in ends)


def has_area(field: Field, depth: float, width: float) -> bool:
    x = field.length_m / 2
    return all(
        has_line(field, side * (x - depth), -width / 2, side * (x - depth), width / 2)
        and has_line(field, side * x, width / 2, side * (x - depth), width / 2)
        and has_line(field, side * x, -width / 2, side * (x - depth), -width / 2)
        for side in (1, -1)
    )


def goal_numbers(field: Field) -> list[tuple[object, ...]]:
    return [(g.side, g.kind, g.color, g.line_x_m, g.width_m, g.depth_m, g.height_m) for g in field.goals]


def circle_radius(field: Field) -> float:
    [circle] = [arc for arc in field.arcs if abs(arc[4]) > 6]
    np.testing.assert_allclose(circle[[0, 1, 4]], [0, 0, 2 * math.pi])
    return float(circle[2])


def test_the_built_in_fields():
    assert field_names() == (
        "four_legged_2005",
        "four_legged_2007",
        "humanoid_adult_2025",
        "humanoid_kid_2025",
        "msl_18x12",
        "msl_6x4",
        "spl_2020",
        "ssl_2001",
        "ssl_division_a",
        "ssl_division_b",
    )
    for name in field_names():
        field = load_field(name)
        assert field.name == name
        assert len(field.source) > 10


def test_ssl_2001():
    field = load_field("ssl_2001")
    assert (field.length_m / 2, field.width_m / 2, field.line_width_m) == (1.370, 0.7625, 0.010)
    assert (field.boundary, field.wall_height_m, field.wall_color) == ("walls", 0.10, "white")
    assert (field.ball_radius_m, field.robot_radius_m, field.ball_color) == (0.0215, 0.09, "orange")
    assert goal_numbers(field) == [
        (1, "recess", "yellow", 1.370, 0.60, 0.180, 0.18),
        (-1, "recess", "blue", -1.370, 0.60, 0.180, 0.18),
    ]
    assert field.goals[0].back_x_m == pytest.approx(1.550)
    assert circle_radius(field) == 0.25
    assert has_line(field, 0, -0.7625, 0, 0.7625)
    assert has_line(field, 1.37, -0.3, 1.37, 0.3)  # the mouth, but no lines along the walls
    assert not has_line(field, -1.37, 0.7625, 1.37, 0.7625)
    assert np.abs(field.floor_polygon).max(axis=0) == pytest.approx([1.550, 0.7625])
    assert len(field.floor_polygon) == 12
    assert field.halves_differ
    assert field.is_bounded


@pytest.mark.parametrize("half", [False, True])
def test_round_corners_of_an_area_join_its_lines(write: Write, half: bool):
    text = OWN.replace("width_m = 1.8", "width_m = 1.8\ncorner_radius_m = 0.4")
    field = load_field(write(text.replace("length_m = 7.8", f"length_m = 7.8\nhalf = {str(half).lower()}")))
    corners = field.arcs[field.arcs[:, 2] == 0.4]
    assert len(corners) == (2 if half else 4)
    for x, y, radius, start, sweep in corners:
        assert (abs(x), abs(y)) == pytest.approx((3.4, 0.5))
        for angle in (start, start + sweep):
            end = np.array([x + radius * np.cos(angle), y + radius * np.sin(angle)])
            assert np.hypot(*(field.lines.reshape(-1, 2) - end).T).min() < 1e-9
        # the corner is rounded off towards the field's middle
        middle = start + sweep / 2
        assert np.cos(middle) * x < 0 < np.sin(middle) * y


@pytest.mark.parametrize(
    ("name", "length", "width", "goal_width", "depth"),
    [("ssl_division_a", 12, 9, 1.8, 1.8), ("ssl_division_b", 9, 6, 1.0, 1.0)],
)
def test_ssl_divisions(name: str, length: float, width: float, goal_width: float, depth: float):
    field = load_field(name)
    assert (field.length_m, field.width_m, field.line_width_m) == (length, width, 0.010)
    assert [g[1:2] + g[3:] for g in goal_numbers(field)] == [
        ("panels", length / 2, goal_width, 0.18, 0.155),
        ("panels", -length / 2, goal_width, 0.18, 0.155),
    ]
    assert has_area(field, depth, 2 * depth)
    assert circle_radius(field) == 0.5
    assert np.abs(field.floor_polygon).max(axis=0) == pytest.approx([length / 2 + 0.3, width / 2 + 0.3])
    assert (field.robot_radius_m, field.ball_radius_m) == (0.09, 0.0215)
    assert not field.halves_differ


def test_four_legged_2007():
    field = load_field("four_legged_2007")
    assert (field.length_m, field.width_m, field.line_width_m) == (5.4, 3.6, 0.025)
    assert [(g.kind, g.color, g.line_x_m, g.width_m / 2, g.height_m, g.post_radius_m) for g in field.goals] == [
        ("posts", "cyan", 2.7, 0.45, 0.45, 0.05),
        ("posts", "yellow", -2.7, 0.45, 0.45, 0.05),
    ]
    assert field.halves_differ


@pytest.mark.parametrize("name", ["four_legged_2005", "four_legged_2007"])
def test_four_legged_beacons_stand_on_the_carpet_beside_the_touch_lines(name: str):
    field = load_field(name)
    assert {(b.x_m, math.copysign(1, b.y_m)) for b in field.beacons} == {(x, y) for x in (1.35, -1.35) for y in (1, -1)}
    for beacon in field.beacons:
        assert (beacon.radius_m, beacon.height_m) == (0.05, 0.40)
        assert abs(beacon.y_m) - beacon.radius_m > field.width_m / 2
        assert field.contains([beacon.x_m, beacon.y_m])
    assert len({b.colors for b in field.beacons}) == 4


def test_four_legged_2005():
    field = load_field("four_legged_2005")
    assert np.ptp(field.floor_polygon, axis=0) == pytest.approx([5.4, 4.0])
    assert {(g.kind, g.width_m) for g in field.goals} == {("panels", 0.80)}
    assert circle_radius(field) == 0.18
    assert has_area(field, 0.65, 1.30)


def test_spl_2020():
    field = load_field("spl_2020")
    assert (field.length_m, field.width_m, field.line_width_m) == (9.0, 6.0, 0.05)
    for goal in field.goals:
        assert (goal.kind, goal.color, goal.width_m / 2, goal.post_radius_m) == ("posts", "white", 0.80, 0.05)
        assert goal.width_m + 2 * goal.post_radius_m == pytest.approx(1.70)  # outer frame
        assert goal.height_m + goal.post_radius_m == pytest.approx(0.90)
    assert circle_radius(field) == 0.75
    assert has_area(field, 1.65, 4.0)
    assert has_area(field, 0.60, 2.2)
    assert not field.halves_differ


@pytest.mark.parametrize(
    ("name", "size_m", "circle_m", "goal_area_m", "penalty_area_m", "bar_m", "ball_m"),
    [
        ("humanoid_kid_2025", (9, 6), 0.75, (1, 3), (2, 5), 1.2, 0.07),
        ("humanoid_adult_2025", (14, 9), 1.5, (1, 4), (3, 6), 1.8, 0.11),
    ],
)
def test_humanoid_fields(name, size_m, circle_m, goal_area_m, penalty_area_m, bar_m, ball_m):
    field = load_field(name)
    assert (field.length_m, field.width_m, field.line_width_m) == (*size_m, 0.05)
    assert circle_radius(field) == circle_m
    assert has_area(field, *goal_area_m)
    assert has_area(field, *penalty_area_m)
    for goal in field.goals:
        assert (goal.kind, goal.color, goal.depth_m) == ("posts", "white", 0.6)
        assert goal.width_m - 2 * goal.post_radius_m == pytest.approx(2.6)
        assert goal.height_m - goal.post_radius_m == pytest.approx(bar_m)
    assert np.abs(field.floor_polygon).max(axis=0) == pytest.approx([size_m[0] / 2 + 1, size_m[1] / 2 + 1])
    assert field.ball_radius_m == ball_m
    assert not field.halves_differ


def test_msl_18x12():
    field = load_field("msl_18x12")
    assert (field.length_m, field.width_m, field.line_width_m) == (18.0, 12.0, 0.125)
    assert circle_radius(field) == 2.0
    assert has_area(field, 0.75, 3.5)
    assert has_area(field, 2.25, 6.5)
    assert all(g.width_m - 2 * g.post_radius_m == pytest.approx(2.0) for g in field.goals)
    corners = field.arcs[np.abs(field.arcs[:, 4]) < 3]
    assert {(x, y, r) for x, y, r, _, _ in corners} == {(x, y, 0.75) for x in (9.0, -9.0) for y in (6.0, -6.0)}


def test_msl_6x4():
    field = load_field("msl_6x4")
    assert (field.length_m, field.width_m, field.boundary) == (6.0, 4.0, "carpet")
    assert circle_radius(field) == 0.60
    assert has_area(field, 0.40, 1.60)
    assert has_area(field, 0.65, 2.00)
    arcs = field.arcs[np.abs(field.arcs[:, 4]) < 6]
    np.testing.assert_allclose(sorted(arcs[:, 0]), [-2.26, 2.26])
    np.testing.assert_allclose(arcs[:, 1:3], [[0, 0.60]] * 2)


def test_users_own_file_works_the_same_way(write: Write):
    path = write(OWN)
    for given in (path, str(path)):
        field = load_field(given)
        assert (field.name, field.length_m, field.ball_color) == ("own", 7.8, "orange")
        assert has_area(field, 0.9, 1.8)
        assert field.beacons[0].colors == ("white", "pink")
        assert field.halves_differ  # one beacon alone tells the halves apart


def test_relative_path_is_taken_from_the_working_folder(write: Write, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(write(OWN).parent)
    assert load_field("own.toml").name == "own"
    with pytest.raises(FileError, match=r"^absent\.toml: cannot be read"):
        load_field("absent.toml")


@pytest.mark.parametrize("name", ["ssl_2002", "", "own\n", "fields/ssl_2001"])
def test_unknown_name_lists_the_known_ones_in_one_line(name: str):
    with pytest.raises(ArgumentError, match=r"is neither a \.toml file nor one of: four_legged_2005, ") as caught:
        load_field(name)
    assert repr(name) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_field_without_goal_circle_and_lines(write: Write):
    text = OWN[: OWN.index("[goal]")].replace(
        "center_circle_radius_m = 0.5", "center_line = false\nouter_lines = false"
    )
    field = load_field(write(text))
    assert field.goals == ()
    assert field.lines.shape == (0, 4)
    assert field.arcs.shape == (0, 5)
    assert field.line_points(0.1).shape == (0, 2)


def test_a_line_from_goal_to_goal_where_the_file_says_so(write: Write):
    plain = load_field(write(OWN))
    striped = load_field(write(OWN.replace("length_m = 7.8\n", "length_m = 7.8\ngoal_to_goal_line = true\n")))
    assert len(striped.lines) == len(plain.lines) + 1
    assert [-3.9, 0.0, 3.9, 0.0] in striped.lines.tolist()
    assert [-3.9, 0.0, 3.9, 0.0] not in plain.lines.tolist()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("format = 1", "format = 2", "key 'format': is not a value that this version reads: must be 1, got 2"),
        ("length_m = 7.8\n", "", "key 'length_m': is missing"),
        ("length_m = 7.8", "length_m = -7.8", "key 'length_m': must be above 0.0, got -7.8"),
        ("length_m = 7.8", "length_m = inf", "key 'length_m': must be a finite number, got inf"),
        ("length_m = 7.8", 'length_m = "7.8"', "key 'length_m': expected `float`, got `str`, got '7.8'"),
        ("depth_m = 0.18", "depth = 0.18", "key 'goal.depth': is unknown, got 0.18"),
        (
            'kind = "panels"',
            'kind = "net"',
            "key 'goal.kind': is not a value that this version reads: must be 'panels' or 'posts' or 'recess'",
        ),
        ('kind = "panels"', 'kind = "posts"', "key 'goal.post_radius_m': must be positive for posts, got 0.0"),
        ('kind = "panels"', 'kind = "recess"', "key 'goal.kind': needs boundary walls without a margin and a depth"),
        ("depth_m = 0.18", "depth_m = 0.4", "key 'goal.depth_m': reaches through the boards, got 0.4"),
        ("width_m = 1.0", "width_m = 5.4", "key 'goal.width_m': is wider than the field (5.4 m), got 5.4"),
        ("height_m = 0.1\n", "", "key 'boundary.height_m': must be positive for kind 'boards', got 0.0"),
        ("margin_m = 0.3", "margin_m = -0.3", "key 'boundary.margin_m': must be at least 0.0, got -0.3"),
        ('"orange"', '"tangerine"', "key 'ball_color': is not one of white, "),
        ('"orange"', '"white"\nball_patches = "coal"', "key 'ball_patches': is not one of white, "),
        ('"black"', '"coal"', "key 'boundary.color': is not one of white, "),
        ('"white", "pink"', '"white", "rose"', "key 'beacons[0].colors': is not one of white, "),
        ('["white", "pink"]', "[]", "key 'beacons[0].colors': expected `array` of length >= 1, got []"),
        ("width_m = 1.8", "width_m = 5.5", "key 'penalty_area.width_m': is wider than the field (5.4 m), got 5.5"),
        ("depth_m = 0.9", "depth_m = 4", "key 'penalty_area.depth_m': reaches over the centre line, got 4.0"),
        (
            "width_m = 1.8",
            "width_m = 1.8\ncorner_radius_m = 0.91",
            "key 'penalty_area.corner_radius_m': is wider than the area",
        ),
        ("m = 0.5\nball", "m = 2.8\nball", "key 'center_circle_radius_m': is wider than the field, got 2.8"),
        ("format = 1", "format = 1\ncorner_arc_radius_m = 3", "key 'corner_arc_radius_m': is wider than the field"),
        (
            "radius_m = 0.5\n[[",
            "radius_m = 3.5\n[[",
            "key 'penalty_arc.radius_m': reaches over the centre line, got 3.5",
        ),
        ("center_x_m = 3.0", "center_x_m = 3.6", "key 'penalty_arc.radius_m': ends inside the penalty area, got 0.5"),
        (
            "[penalty_arc]",
            "[penalty_mark]\ndistance_m = 4\nsize_m = 0.1\n[penalty_arc]",
            "key 'penalty_mark.distance_m': is beyond the centre line, got 4.0",
        ),
        (
            "[penalty_arc]",
            "[penalty_mark]\ndistance_m = 1\nsize_m = 0.01\n[penalty_arc]",
            "key 'penalty_mark.size_m': is no larger than a line is wide, got 0.01",
        ),
        (
            "[penalty_arc]",
            '[penalty_mark]\ndistance_m = 1\nsize_m = 0.1\nkind = "ring"\n[penalty_arc]',
            "key 'penalty_mark.kind': ",
        ),
    ],
)
def test_bad_field_file_is_refused_in_one_line(tmp_path: Path, old: str, new: str, message: str):
    assert problem_of(load_field, tmp_path / "own.toml", OWN, old, new).startswith(message)


def test_a_ball_has_patches_where_the_field_file_says_so(write: Write):
    assert load_field(write(OWN)).ball_patches == ""
    assert load_field(write(OWN.replace('"orange"', '"white"\nball_patches = "black"'))).ball_patches == "black"
    assert [name for name in field_names() if load_field(name).ball_patches] == [
        "humanoid_adult_2025",
        "humanoid_kid_2025",
        "spl_2020",
    ]


NET = "height_m = 0.1\nmesh_m = 0.05\ncord_m = 0.002\n"


def test_a_goal_has_a_net_where_the_field_file_says_so(write: Write, tmp_path: Path):
    assert all(goal.net is None for goal in load_field(write(OWN)).goals)
    assert OWN.count("[penalty_area]") == 1
    text = OWN.replace("[penalty_area]", f"[goal.net]\n{NET}\n[penalty_area]")
    assert [goal.net for goal in load_field(write(text)).goals] == [Net(0.1, 0.05, 0.002, "white")] * 2
    assert [name for name in field_names() if any(goal.net for goal in load_field(name).goals)] == [
        "humanoid_adult_2025",
        "humanoid_kid_2025",
        "msl_18x12",
        "spl_2020",
    ]
    for old, new, message in (
        (NET, NET.replace("0.1", "0.5"), "key 'goal.net.height_m': is higher than the goal, got 0.5"),
        (NET, NET.replace("0.002", "0.05"), "key 'goal.net.cord_m': is as thick as the mesh is wide, got 0.05"),
        (NET, NET + 'color = "coal"\n', "key 'goal.net.color': is not one of white, "),
        ("depth_m = 0.18\n", "", "key 'goal.depth_m': must be positive behind a net's mouth, got 0.0"),
    ):
        assert problem_of(load_field, tmp_path / "own.toml", text, old, new).startswith(message)
    recess = (files("field_models") / "fields" / "ssl_2001.toml").read_text(encoding="utf-8") + f"[goal.net]\n{NET}"
    with pytest.raises(FileError, match="has no net"):
        load_field(write(recess))


def test_a_field_file_may_leave_out_its_source(tmp_path):
    path = tmp_path / "bare.toml"
    path.write_text(
        'format = 1\nname = "bare"\nlength_m = 3.0\nwidth_m = 2.0\nline_width_m = 0.05\n[boundary]\nkind = "carpet"\n'
    )
    assert load_field(path).source == ""


@pytest.mark.parametrize("name", field_names())
def test_half_a_field_is_what_lies_at_positive_x_of_the_whole(name: str, write: Write):
    text = (files("field_models") / "fields" / f"{name}.toml").read_text(encoding="utf-8")
    whole, half = load_field(name), load_field(write(text.replace("format = 1", "format = 1\nhalf = true", 1)))
    assert half.is_half
    assert not whole.is_half
    assert half.halves_differ
    assert half.goals == whole.goals[:1]
    assert half.beacons == tuple(beacon for beacon in whole.beacons if beacon.x_m >= 0)
    points = whole.line_points(0.1)
    there, cut = points[points[:, 0] > 0.02], half.line_points(0.1)
    assert cut[:, 0].min() >= -1e-9
    for some, others in ((there, cut), (cut, points)):
        away = np.sqrt(((some[:, None] - others[None]) ** 2).sum(axis=-1).min(axis=1)) if len(some) else np.zeros(1)
        assert away.max() < 0.051
    margin = whole.floor_polygon[:, 1].max() - whole.width_m / 2
    assert half.floor_polygon[:, 0].min() == pytest.approx(-margin)
    inside = whole.floor_polygon[:, 0] > 0
    np.testing.assert_allclose(half.floor_polygon[: inside.sum()], whole.floor_polygon[inside])
    np.testing.assert_allclose(np.sort(half.floor_polygon[-2:, 1]), (-1, 1) * np.array(whole.width_m / 2 + margin))


@pytest.mark.parametrize(("kind", "half"), [("cross", "false"), ("dot", "false"), ("dot", "true")])
def test_a_penalty_mark_is_painted_before_each_goal(write: Write, kind: str, half: str):
    mark = f'[penalty_mark]\ndistance_m = 1.2\nsize_m = 0.05\nkind = "{kind}"\n[penalty_arc]'
    text = OWN.replace("[penalty_arc]", mark).replace("format = 1", f"format = 1\nhalf = {half}")
    field = load_field(write(text))
    assert [(one.x_m, one.y_m) for one in field.marks] == (
        [(2.7, 0.0)] if half == "true" else [(2.7, 0.0), (-2.7, 0.0)]
    )
    lines, arcs = field.painted_lines[len(field.lines) :], field.painted_arcs[len(field.arcs) :]
    assert (len(lines) > 0, len(arcs) > 0) == (kind == "cross", kind == "dot")
    # a stroke's paint goes on by half a line's width beyond its ends
    half_m = field.line_width_m / 2
    reach = [np.abs(lines[:, 2] - lines[:, 0]).max() / 2 + half_m] if len(lines) else [arcs[:, 2].max() + half_m]
    assert reach == pytest.approx([0.025])
    if len(arcs):
        own = np.sort(arcs[arcs[:, 0] > 0, 2])
        # no ring of carpet is left within
        assert own[0] <= half_m + 1e-9
        assert (np.diff(own) <= 2 * half_m + 1e-9).all()

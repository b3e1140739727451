"""A vision system's geometry becomes the field that the rules describe, and a field the geometry that peers expect."""

import dataclasses

import numpy as np
import pytest

from field_models import field_names, load_field
from field_models.errors import PacketError
from robocup_vision.ssl.field import field_from_geometry, geometry_from_field
from robocup_vision.ssl.log import SslLog
from robocup_vision.ssl.protocol.mapping import decode, encode
from robocup_vision.ssl.values.geometry import FieldSize, Geometry, LineKind

LEAGUE = ["ssl_2001", "ssl_division_a", "ssl_division_b"]


def told(recordings):
    with SslLog(recordings / "erforce_vision.log.gz") as log:
        return next(entry.value.geometry for entry in log if entry.value.geometry is not None)


def ends(lines):
    """Both ends of each line, in an order that does not depend on where it begins."""
    return {tuple(sorted([(round(x0, 3), round(y0, 3)), (round(x1, 3), round(y1, 3))])) for x0, y0, x1, y1 in lines}


def text_of(path):
    """Return the numbers of a printed geometry, in their order."""
    return [
        float(word)
        for line in path.read_text().splitlines()
        if ": " in line
        for word in [line.split(": ")[1]]
        if word[0] != '"'
    ]


def numbers(value):
    """All numbers of a value in their order, as the message has them: millimetres, float32."""
    found = []
    for field in dataclasses.fields(value):
        item = getattr(value, field.name)
        entries = item if isinstance(item, tuple) else [item]
        for entry in entries:
            if dataclasses.is_dataclass(entry):
                found += numbers(entry)
            elif isinstance(entry, float | int):
                found.append(1000 * entry if field.name.endswith("_m") else entry)
    return found


def test_the_foreign_geometry_is_the_printed_one(recordings):
    geometry = told(recordings)
    printed = text_of(recordings / "erforce_geometry.txt")
    assert np.float32(numbers(geometry)).tolist() == np.float32(printed).tolist()
    assert len(geometry.cameras) == 1


def test_the_foreign_geometry_is_the_field_of_the_rules(recordings):
    field, rules = field_from_geometry(told(recordings)), load_field("ssl_division_b")
    assert (field.length_m, field.width_m, field.line_width_m) == (rules.length_m, rules.width_m, rules.line_width_m)
    # the foreign simulator paints a line from goal to goal, which the rules have dropped
    assert ends(field.lines) == ends(rules.lines) | {((-4.5, 0.0), (4.5, 0.0))}
    np.testing.assert_allclose(field.arcs, rules.arcs, atol=1e-6)
    np.testing.assert_allclose(field.floor_polygon, rules.floor_polygon, atol=1e-9)
    assert field.goals == rules.goals
    assert (field.ball_radius_m, field.robot_radius_m) == (rules.ball_radius_m, rules.robot_radius_m)
    assert field.boundary == rules.boundary


@pytest.mark.parametrize("name", LEAGUE)
def test_a_field_survives_the_network(name):
    field = load_field(name)
    geometry = decode(Geometry, encode(geometry_from_field(field)))
    again = field_from_geometry(geometry, name)
    # lengths travel as float32 and whole millimetres
    np.testing.assert_allclose(again.lines, field.lines, atol=1e-3)
    np.testing.assert_allclose(again.arcs, field.arcs, atol=1e-3)
    np.testing.assert_allclose(
        np.abs(again.floor_polygon).max(axis=0)[1], np.abs(field.floor_polygon).max(axis=0)[1], atol=1e-3
    )
    for ours, theirs in zip(again.goals, field.goals, strict=True):
        assert abs(ours.line_x_m - theirs.line_x_m) < 1e-3
        assert abs(ours.width_m - theirs.width_m) < 1e-3


def test_lines_have_the_names_that_peers_look_for(recordings):
    ours = {line.name: line for line in geometry_from_field(load_field("ssl_division_b")).field.lines}
    theirs = {line.name: line for line in told(recordings).field.lines}
    assert set(theirs) - set(ours) == {"CenterLine"}
    assert set(ours) - set(theirs) == set()
    for name, line in ours.items():
        there = theirs[name]
        assert ends([[line.start.x_m, line.start.y_m, line.end.x_m, line.end.y_m]]) == ends(
            [[there.start.x_m, there.start.y_m, there.end.x_m, there.end.y_m]]
        )
        assert line.kind not in (None, LineKind.UNDEFINED)


def test_every_built_in_field_with_goals_has_a_geometry():
    for name in field_names():
        field = load_field(name)
        if field.goals:
            assert len(geometry_from_field(field).field.lines) == len(field.lines)


def test_an_impossible_geometry_is_refused():
    geometry = geometry_from_field(load_field("ssl_division_b"))
    for key, value in (("length_m", -1.0), ("width_m", float("nan")), ("boundary_width_m", -0.1)):
        bad = dataclasses.replace(geometry, field=dataclasses.replace(geometry.field, **{key: value}))
        if key == "boundary_width_m":
            with pytest.raises(PacketError, match="boundary must not be negative"):
                field_from_geometry(bad)
        else:
            with pytest.raises(PacketError, match=f"{key} must be positive"):
                field_from_geometry(bad)
    with pytest.raises(PacketError, match="has no goals"):
        geometry_from_field(dataclasses.replace(load_field("ssl_division_b"), goals=()))


def test_a_geometry_without_lines_is_refused():
    with pytest.raises(PacketError, match="a geometry must have lines, got none"):
        field_from_geometry(Geometry(FieldSize(9.0, 6.0, 1.0, 0.18, 0.3)))

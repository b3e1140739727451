"""`robocup-vision fields`: lists the built-in fields."""

from __future__ import annotations

import argparse
from typing import Any


def add_parser(subparsers: Any) -> None:
    """Add the command `fields`."""
    parser = subparsers.add_parser("fields", help="list the built-in fields")
    parser.set_defaults(run=run_fields)


def run_fields(_: argparse.Namespace) -> int:
    """Print the built-in fields; return 0."""
    from field_models.catalog import field_names, load_field

    print(f"{'name':<18} {'length (m)':>10} {'width (m)':>10}  {'boundary':<8}  {'goals':<37} camera: located by")
    for name in field_names():
        field = load_field(name)
        goals = "none"
        if field.goals:
            goal = field.goals[0]
            colors = " and ".join(dict.fromkeys(goal.color for goal in field.goals))
            goals = f"{colors} {goal.kind}, {goal.width_m:g} x {goal.height_m:g} m"
        mirror = f"mirror: {field.boundary if field.is_bounded else 'lines'}"
        pinhole = "pinhole: lines, a goal" if any(goal.kind == "posts" for goal in field.goals) else "pinhole: lines"
        sizes = f"{field.length_m:>10g} {field.width_m:>10g}"
        print(f"{name:<18} {sizes}  {field.boundary:<8}  {goals:<37} {mirror}; {pinhole}")
    return 0

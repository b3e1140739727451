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

    print(f"{'name':<18} {'length (m)':>10} {'width (m)':>10}  {'boundary':<8} goals")
    for name in field_names():
        field = load_field(name)
        goals = ", ".join(f"{goal.color} {goal.kind}" for goal in field.goals)
        print(f"{name:<18} {field.length_m:>10g} {field.width_m:>10g}  {field.boundary:<8} {goals}")
    return 0

"""Common options of the commands that play matches, and the plan made from them."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sim2d.match.disturbances import Disturbances
    from sim2d.match.run import MatchPlan
    from sim2d.match.setups import MatchSetup


# names only, because parsing options must not load the simulator, so that --help answers at once
CAMERA_NAMES = (
    "sekimori",
    "ers7",
    "nao",
    "kid_head",
    "kid_fisheye",
    "adult_head",
    "ssl_forward",
    "ssl_mirror",
    "msl_mirror",
    "msl_fisheyes",
)
ROBOT_NAMES = ("small", "small_size", "four_legged", "humanoid", "kid", "adult", "middle_size")


def add_match_options(parser: argparse.ArgumentParser, out: str) -> None:
    """Add the options of a match and the output folder to a command's parser."""
    add = parser.add_argument
    add("--field", default="ssl_2001", metavar="F", help="built-in field's name, or a field file (default: ssl_2001)")
    add("--players", type=int, metavar="N", help="players per side (default: as the field's league)")
    add("--camera", metavar="C", help="camera of every robot: a camera.toml or rig.toml, or " + ", ".join(CAMERA_NAMES))
    add("--robot", metavar="R", help="every robot: " + ", ".join(ROBOT_NAMES))
    add("--seconds", type=float, default=60.0, metavar="T", help="length of a match (default: 60)")
    add("--seed", type=int, default=0, metavar="S", help="the same seed plays the same match (default: 0)")
    names = "plain, memory, planning, asking, looking, silent, what they use as memory+plans, or one's own as "
    names += "MODULE:NAME (default: plain)"
    add("--ours", default="plain", metavar="NAME", help=f"players of the side that attacks +x: {names}")
    add("--theirs", default="plain", metavar="NAME", help=f"players of the other side: {names}")
    add(
        "--disturb",
        default="default",
        metavar="NAMES",
        help="what disturbs robots: default (by the field's league), none, all, or some of sway, latency, slip, "
        "drift, shutter, camera, knock and messages, with commas between",
    )
    add("--out", default=out, metavar="DIR", help=f"folder for the files (default: {out})")


def match_plan(args: argparse.Namespace) -> MatchPlan:
    """Make the plan of one match from a command's parsed options."""
    from sim2d.match.run import MatchPlan
    from sim2d.players.catalog import player_factory

    ours, theirs = player_factory(args.ours), player_factory(args.theirs)
    plan = MatchPlan(
        args.field, args.players, args.seconds, args.seed, ours, theirs, camera=args.camera, robot=args.robot
    )
    return replace(plan, players=plan.setup.players, disturbances=_disturbances(plan.setup, args.disturb))


def _disturbances(setup: MatchSetup, names: str) -> Disturbances | None:
    """Return the disturbances that `--disturb` names; None: the default."""
    from sim2d.match.disturbances import NAMES, NONE, disturbances_for

    if names == "default":
        return None
    if names == "none":
        return NONE
    usual = disturbances_for(setup.robot, setup.camera, setup.rig)
    return usual.only(NAMES if names == "all" else names.split(","))

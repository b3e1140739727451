"""Matches of robots whose cameras are not what their files say, and are knocked: with and without calibration in play.

Two against two with the built-in players, all other disturbances on (four_legged_2007: those of legs; ssl_2001, mirror
cameras: sway, late frames, drifting light); the same seeds for each row. Each true camera is drawn about its file (see
`CameraErrorSettings`); at a moment between 10 and 40 s a knock moves it as much again. "near": fraction of the control
periods after 10 s in which a robot's estimate is within 3 cm and 3 degrees of the truth (four_legged_2007: 10 cm, 5
degrees), but for the 5 s after its knock; "after a knock": of those 5 s. "knocks": noticed, of all; "false": noticed
before there was one. "file": players that do not calibrate. "exact": true cameras as in their files, no knock.
--quick plays on ssl_2001 only, for 3 s: robots have settled after 0.5 s, and knocks come within 1.5 s.
"""

from __future__ import annotations

from argparse import Namespace
from collections import Counter
from dataclasses import dataclass, replace

from benchmarks.harness import Table, percent, program, verdict
from benchmarks.scores.match_score import BOUNDS, count_failed
from sim2d.match.disturbances import LEGS, MIRRORS_ON_WHEELS, Disturbances
from sim2d.match.run import MatchPlan
from sim2d.players.catalog import BuiltInTeam
from sim2d.players.settings import PlayerSettings
from sim2d.sensors.faults import LatencySettings
from sim2d.sensors.match_camera import LightDriftSettings
from sim2d.sensors.true_cameras import CameraErrorSettings, KnockSettings

# (matches, seconds each, seconds until robots have settled, when knocks come)
QUICK = 1, 3.0, 0.5, KnockSettings(0.5, 1.5)
DEFAULT, FULL = (1, 40.0, 10.0, KnockSettings()), (10, 60.0, 10.0, KnockSettings())
AFTER_KNOCK_S = 5.0


@dataclass(frozen=True)
class League:
    """What is played, how often robots must be near the truth."""

    disturbances: Disturbances
    min_near: float


LEAGUES = {
    "ssl_2001": League(replace(MIRRORS_ON_WHEELS, latency=LatencySettings(), drift=LightDriftSettings()), 0.99),
    "four_legged_2007": League(LEGS, 0.97),
}


def play(plan: MatchPlan, settled_s: float) -> Counter[str]:
    """Play a match; count control periods that are near, and all, settled and after a knock; knocks; failed players."""
    count: Counter[str] = Counter()
    match, bound = plan.begin(), BOUNDS[plan.field]
    noticed: dict[int, int] = {}
    last_s = 0.0
    for moment in match.play(plan.seconds):
        last_s = moment.state.t_s
        for k, (robot, truth) in enumerate(zip(moment.robots, moment.state.robots, strict=True)):
            calibration = robot.status.calibration
            if calibration is not None:
                before = noticed.get(k, 0)
                if last_s < match.arena.knock_s(k):
                    count["false"] += calibration.knocks - before
                noticed[k] = calibration.knocks
            if last_s < settled_s:
                continue
            pose = robot.status.pose
            is_near = bound.holds(pose.pose if pose else None, truth.pose)
            if 0.0 <= last_s - match.arena.knock_s(k) < AFTER_KNOCK_S:
                count["after"] += 1
                count["near_after"] += is_near
            else:
                count["settled"] += 1
                count["near"] += is_near
    came = [k for k in range(4) if match.arena.knock_s(k) < last_s - 1.0]
    count["knocks"] += len(came)
    count["failed"] += count_failed(match.figures)
    count["noticed"] += sum(noticed.get(k, 0) > 0 for k in came)
    return count


@program()
def main(arguments: Namespace) -> None:
    """Measure and print."""
    matches, seconds, settled_s, knock = QUICK if arguments.quick else FULL if arguments.full else DEFAULT
    table = Table(
        (
            "field | camera | near %: rate | after a knock %: rate | knocks | false | "
            "players that failed: count | verdict"
        ),
        f"{matches} matches of {seconds:g} s, {4 * matches} robots a row",
        name="wrong",
        samples=round(matches * (seconds - settled_s) * 4),
    )
    for name, league in list(LEAGUES.items())[: 1 if arguments.quick else None]:
        wrong = replace(league.disturbances, camera=CameraErrorSettings(), knock=knock)
        exact = replace(league.disturbances, camera=None)
        rows = {"exact": (exact, True), "file": (wrong, False), "calibrated": (wrong, True)}
        for row, (disturbances, calibrates) in rows.items():
            team = BuiltInTeam(settings=PlayerSettings(calibrates=calibrates))
            count: Counter[str] = Counter()
            for index in range(matches):
                plan = MatchPlan(name, 2, seconds, arguments.seed + index, team, team, disturbances=disturbances)
                count += play(plan, settled_s)
            near = count["near"] / max(count["settled"], 1)
            ok = near >= league.min_near and not count["failed"]
            table.row(
                name,
                row,
                percent(near),
                percent(count["near_after"] / count["after"]) if count["after"] else "-",
                f"{count['noticed']} of {count['knocks']}" if row == "calibrated" else "-",
                f"{count['false']}" if row == "calibrated" else "-",
                count["failed"],
                verdict(ok) if row == "calibrated" or count["failed"] else "",
            )

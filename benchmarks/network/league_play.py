"""Our players as a network team: a refereed match on division B, and the tracker that they see by.

Six against six on `rc2021`: yellow by overhead vision, as `robocup-vision play` plays, blue the opponents named, inside
the simulator. Judged by the league's rules; every 4 s of play a person halts it. All through encoded packets, without
sockets, as fast as it goes; the truth is measured. Rows: goals; fouls of our team for speed and distance in a stop, and
all others; how long after a halt the last command that moves a robot was sent, and how long until all stand (a robot
at 1.5 m/s needs 0.25 s to brake); and the tracker's errors on the match's own log. Default 30 s of opponents
`overhead`, which are the same players; `--full` plays ten minutes. Other opponents by `--opponents plain`,
`planning`: they render and process six cameras.
"""

from __future__ import annotations

import math
from argparse import Namespace

from benchmarks.harness import Table, program, verdict
from benchmarks.network.league_network import KINDS, TRACKER_TARGET, tracker_errors
from field_models import load_field
from robocup_vision.ssl.log import LogEntry
from robocup_vision.ssl.protocol.mapping import decode, encode
from robocup_vision.ssl.values.detection import VisionPacket
from robocup_vision.ssl.values.referee import Referee
from robocup_vision.ssl.values.simulation import RobotCommand, RobotControl, RobotControlResponse, Team
from sim2d.match.league_referee import LeagueReferee
from sim2d.network.built_in import built_in_robots
from sim2d.network.league import STEPS_A_COMMAND, Channel, LeagueSimulator
from sim2d.network.realism import REALISMS
from sim2d.network.team.team import OverheadTeam
from sim2d.network.world import SIDES, STEPS_PER_S

FIELD = load_field("ssl_division_b")
PLAYERS, HALT_EVERY_S = 6, 4.0
STANDS_MPS, MAX_HALT_S, MAX_BRAKE_S = 0.01, 0.1, 0.4
STOP_FOULS = ("fast_in_stop", "near_ball")


class Halts:
    """How fast our team obeys halts, seconds after the referee's command."""

    def __init__(self) -> None:
        self.began_s: float | None = None
        self.last_command_s = self.stands_s = 0.0
        self.count = 0

    def begin(self, t_s: float) -> None:
        """Note a halt."""
        self.began_s = t_s
        self.count += 1

    def add(self, t_s: float, commands: list[RobotCommand], speeds_mps: list[float]) -> None:
        """Note what was commanded and how fast our robots are, at a time."""
        if self.began_s is None:
            return
        after_s = t_s - self.began_s
        if any(_moves(command) for command in commands):
            self.last_command_s = max(self.last_command_s, after_s)
        if max(speeds_mps, default=0.0) > STANDS_MPS:
            self.stands_s = max(self.stands_s, after_s)


def _moves(command: RobotCommand) -> bool:
    velocity = None if command.move is None else command.move.local
    return velocity is not None and any((velocity.forward_mps, velocity.left_mps, velocity.turn_rps))


def play(opponents: str, seconds: float, seed: int) -> tuple[LeagueReferee, Halts, list[LogEntry]]:
    """Play a match; return its referee, the halts, and its log."""
    referee = LeagueReferee(FIELD, FIELD.robot_radius_m)
    blue = built_in_robots(f"blue={opponents}", FIELD, PLAYERS, seed)
    made = LeagueSimulator(FIELD, PLAYERS, REALISMS["rc2021"], seed, 0.0, referee, built_in=[blue])
    team, halts, entries = OverheadTeam(Team.YELLOW, FIELD), Halts(), []
    played_s = 0.0
    for _ in range(round(STEPS_PER_S * seconds / STEPS_A_COMMAND)):
        for _ in range(STEPS_A_COMMAND):
            for channel, data in made.step():
                entries.append(LogEntry(round(1e9 * made.world.t_s), KINDS[channel], data))
                if channel is Channel.VISION:
                    team.hear_vision(decode(VisionPacket, data))
                elif channel is Channel.REFEREE:
                    team.hear_referee(decode(Referee, data))
        t_s, state = made.world.t_s, made.world.state
        if referee.command == "halt":
            if halts.began_s is None:
                halts.begin(referee.command_s)
        else:
            halts.began_s = None
            played_s += STEPS_A_COMMAND / STEPS_PER_S if referee.phase == "play" else 0.0
        if played_s > HALT_EVERY_S:
            referee.halt(t_s, state.ball)
            halts.begin(t_s)
            played_s = 0.0
        commands = team.commands(t_s)
        answer, _ = made.answer_robots(Team.YELLOW, encode(RobotControl(tuple(commands))))
        if answer is not None:
            team.hear_robots(decode(RobotControlResponse, answer))
        halts.add(t_s, commands, [math.hypot(*r.velocity_mps) for r in state.robots if r.side == SIDES[Team.YELLOW]])
    return referee, halts, entries


def measure_tracker(entries: list[LogEntry]) -> None:
    """Print the tracker's errors on a match's log."""
    table = Table(
        "robots | place mm | last mm | ratio | velocity m/s | refound s | target | verdict",
        "Tracker in that match",
        name="match_tracker",
    )
    for moment, place, last, velocity, refound, ok in tracker_errors(entries):
        table.row(
            moment.replace("the", "at the"),
            round(1000 * place, 2),
            round(1000 * last, 2),
            round(place / last, 3),
            round(velocity, 3),
            round(refound, 3),
            TRACKER_TARGET,
            verdict(ok),
        )


@program({"--opponents": {"default": "overhead", "help": "overhead (default), plain, memory or planning"}})
def main(arguments: Namespace) -> None:
    """Play, and print both tables."""
    seconds = 7.0 if arguments.quick else 600.0 if arguments.full else 30.0
    referee, halts, entries = play(arguments.opponents, seconds, arguments.seed)
    ours = [foul for foul in referee.fouls if foul.side > 0]
    in_stop = sum(foul.kind in STOP_FOULS for foul in ours)
    table = Table("what | found | target | verdict", f"Match against {arguments.opponents}", name="match")
    table.row("simulated", f"{seconds:g} s", "", "")
    table.row("goals", f"{referee.score[1]} : {referee.score[-1]}", "", "")
    table.row("fouls for speed or distance in a stop", in_stop, "0", verdict(in_stop == 0))
    table.row("other fouls", len(ours) - in_stop, "", "")
    table.row("halts", halts.count, "", "")
    row = round(halts.last_command_s, 3)
    table.row("last moving command after a halt, s", row, f"<= {MAX_HALT_S:g}", verdict(row <= MAX_HALT_S))
    row = round(halts.stands_s, 3)
    table.row("all robots stand after a halt, s", row, f"<= {MAX_BRAKE_S:g}", verdict(row <= MAX_BRAKE_S))
    measure_tracker(entries)

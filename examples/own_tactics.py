"""A player of your own on the four-legged field: one part is new, all others are those of the built-in player.

Its goalkeeper follows the play: while the ball is in the other half it waits before the middle of its own half.
"""

from dataclasses import replace

from sim2d.match.run import MatchPlan, run_match
from sim2d.players.catalog import BuiltInTeam
from sim2d.players.parts import PlayerParts
from sim2d.players.plan import Plan, Situation
from sim2d.players.settings import PlayerSettings
from sim2d.players.tactics.tactics import Tactics
from sim2d.robot_link import PlayerSetup


class Sweeper:
    """The built-in tactics, but for a keeper that is not needed in its goal."""

    def __init__(self, setup: PlayerSetup, settings: PlayerSettings) -> None:
        self.usual = Tactics(setup.field, setup.limits, setup.number, setup.players, settings.tactics)
        self.is_keeper = self.usual.is_keeper
        self.before_m = -0.25 * setup.field.length_m

    def decide(self, now: Situation) -> Plan:
        """Choose the next plan; everything is in the team's frame, whose x points to the opponent's goal."""
        plan = self.usual.decide(now)
        if plan.intent == "keep" and now.ball is not None and now.ball[0] > 0.0:
            return replace(plan, intent="sweep", target=(self.before_m, 0.4 * now.ball[1]))
        return plan


if __name__ == "__main__":
    team = BuiltInTeam(("memory", "plans", "messages"), parts=PlayerParts(tactics=Sweeper))
    summary = run_match(MatchPlan("four_legged_2007", 2, seconds=4.0, seed=1, ours=team), "out/own_tactics")
    print("score {} : {},".format(*summary.figures.score), summary.report or summary.out)

"""A player of your own: it sees by its camera alone, drives to the ball and kicks it at the other goal."""

import math

from robocup_vision import View, Vision
from robocup_vision.localization.filter.pose_filter import PoseFilter
from sim2d.match.run import MatchPlan, run_match
from sim2d.robot_link import Command, PlayerSetup, PlayerStatus, Senses


class Chaser:
    """Gets its robot's senses 30 times a second, and answers with a command."""

    def __init__(self, setup: PlayerSetup) -> None:
        self.vision, self.filter = Vision(setup.field, setup.camera), PoseFilter()
        self.view: View | None = None
        self.goal_m = (setup.attacks * setup.field.length_m / 2, 0.0)

    def act(self, senses: Senses) -> Command:
        """Return what the robot shall do; `senses` is all there is to know."""
        self.filter.predict(senses.odometry, senses.t_s)
        if senses.frame is not None and senses.frame_t_s is not None:
            self.view = self.vision.look(senses.frame, prior=self.filter.prior(senses.frame_t_s))
            self.filter.update(self.view.pose, senses.frame_t_s)
        pose, ball = self.filter.belief, self.view.ball if self.view else None
        if senses.phase == "kick_off":
            return Command()
        if not pose or (ball is None and not senses.ball_in_mouth):
            return Command(turn_rps=2.0)
        ahead_m, left_m = pose.pose.inverse().transform(self.goal_m)
        if senses.ball_in_mouth:  # turn with it, then shoot
            off_rad = math.atan2(left_m, ahead_m)
            return Command(0.1, turn_rps=1.5 * off_rad, dribble=True, kick_mps=2.0 * (abs(off_rad) < 0.2))
        assert ball is not None
        return Command(1.5 * ball.x_m, 1.5 * ball.y_m, 4.0 * math.atan2(ball.y_m, ball.x_m), dribble=True)

    @property
    def status(self) -> PlayerStatus:
        """What the film shows of it."""
        return PlayerStatus(self.filter.belief, None, "chase", self.view)


if __name__ == "__main__":
    summary = run_match(MatchPlan(players=1, seconds=10.0, seed=1, ours=Chaser), "out/own_player")
    print("score {} : {},".format(*summary.figures.score), summary.report or summary.out)

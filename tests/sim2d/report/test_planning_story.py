"""What planning decided, in the report's table and plot, in the film, and from above."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from sim2d_players import SMALL_CAMERA, Reckoner, Sleeper

from sim2d.match.match import Match
from sim2d.match.run import MatchPlan, run_match
from sim2d.report.story import MatchStory
from sim2d.report.video import MatchPictures
from sim2d.robot_link import Reason

SLOW = Reason("speed", "slow: opponents", "slow, 0.40 m/s: gap 0.41 m, sigma 0.06 m")
FULL = Reason("speed", "full speed", "full speed: nothing near")
ROUND = Reason("gap", "detour", "detour 1.2 s: gap 0.22 m, sigma 0.04 m, no look is worth its time")
GAZE = Reason("gaze", "planned", "2.0 landmarks there leave 0.030 m of 0.050 m")


class Reasoner(Reckoner):
    """Slow from 0.2 s to 0.4 s, at full speed before and after, and silent from 0.6 s on."""

    @property
    def status(self):  # noqa: D102
        now = self.senses[-1].t_s
        if now > 0.59:
            return super().status
        slow = 0.19 < now < 0.39
        return dataclasses.replace(
            super().status,
            reasons=(ROUND, SLOW if slow else FULL, GAZE),
            waypoint_in_field=(0.2, -0.3),
            gap_in_field=((0.2, -0.1), (0.2, -0.6)),
            speed_mps=0.4 if slow else 1.0,
            gaze_rad=0.8,
        )


PLAN = MatchPlan(players=1, seconds=0.8, ours=Reasoner, theirs=Sleeper, camera=SMALL_CAMERA)


def begin(ours=Reasoner):
    return dataclasses.replace(PLAN, ours=ours).begin()


def test_shares_are_of_the_time_in_which_it_was_decided():
    story = MatchStory(2)
    for moment in begin().play(PLAN.seconds):
        story.add(moment)
    assert story.planners == [0]
    rows = {(row.topic, row.choice): row for row in story.rates}
    assert list(rows) == [("gap", "detour"), ("speed", "full speed"), ("speed", "slow: opponents"), ("gaze", "planned")]
    assert rows["gap", "detour"].rate == 1.0
    assert rows["speed", "full speed"].rate == pytest.approx(2 / 3, abs=0.04)
    assert rows["speed", "slow: opponents"].rate == pytest.approx(1 / 3, abs=0.04)
    assert [rows["speed", choice].times for choice in ("full speed", "slow: opponents")] == [2, 1]
    assert rows["speed", "slow: opponents"].example == SLOW.text
    assert len(story.t_s) == len(story.speed_mps[0]) == 8
    assert np.isnan(story.speed_mps[0][-1])
    assert np.isnan(story.speed_mps[1]).all()


def test_the_report_has_a_table_and_a_plot_of_it(tmp_path):
    run_match(PLAN, tmp_path)
    page = (tmp_path / "report.html").read_text()
    for text in ("<h2>Planning</h2>", SLOW.text, ROUND.text, GAZE.text, "slow: opponents", "lets itself go"):
        assert text in page
    assert page.count("data:image/png;base64") == 3


@pytest.mark.usefixtures("without_plots")
def test_a_match_without_planners_has_none(tmp_path):
    run_match(dataclasses.replace(PLAN, ours=Reckoner, seconds=0.1), tmp_path)
    page = (tmp_path / "report.html").read_text()
    assert "Planning" not in page
    assert page.count("data:image/png;base64") == 2


def test_the_film_shows_way_gap_gaze_and_words():
    pictures = []
    for ours in (Reasoner, Reckoner):
        match: Match = begin(ours)
        arena = match.arena
        draw = MatchPictures(arena.field, arena.camera, 2, arena.limits.radius_m).draw
        pictures.append(draw(match.step()).astype(int))
    changed = np.abs(pictures[0] - pictures[1]).max(axis=2) > 60
    field = changed[60:340, :620]
    # the gap, half a metre long, stands upright on the right half; words are under the field and in one panel
    assert field.any(axis=0)[330:].any()
    assert changed[-30:, :620].any()
    assert changed[:, 620:].any()

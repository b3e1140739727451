"""The built-in player in the world it plays in: it knows its place, scores, and gets over faults of its senses."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.camera import PinholeCamera
from robocup_vision.geometry import Pose2
from robocup_vision.mapping.occupancy import FREE
from sim2d.kick_off import kick_off_pose
from sim2d.match.run import MatchPlan
from sim2d.match.setups import camera_for
from sim2d.players.built_in import BuiltInPlayer, BuiltInTeam
from sim2d.players.settings import PlayerSettings
from sim2d.rendering.cameras import sekimori_camera
from sim2d.report.video import MatchPictures
from sim2d.robot_link import Command, PlayerSetup, RobotLimits, Senses
from sim2d.sensors.match_camera import MatchCamera
from sim2d.world.state import RobotState, WorldState
from sim2d.world.world import World

FIELD = load_field("ssl_2001")
LIMITS = RobotLimits()
CAMERA = sekimori_camera()


def play(seconds, *, players=1, seed=1, spoil=None, disturb=None, field=FIELD, camera=CAMERA, limits=LIMITS):
    """Let a match run; return the world, and rows of time, robot, position and heading error (inf: not known)."""
    world = World(field, players, limits, np.random.default_rng(seed))
    eye = MatchCamera(field, camera, limits, np.random.default_rng(seed + 1))
    team = [
        BuiltInPlayer(PlayerSetup(field, camera, limits, robot.side, robot.number, players, robot.index))
        for robot in world.state.robots
    ]
    rows, goals = [], 0
    for period in range(round(30 * seconds)):
        state, commands = world.state, {}
        goals += sum(event.kind == "goal" for event in state.events)
        for index, robot in enumerate(state.robots):
            frame = np.array(eye.render(state, index))
            senses = Senses(
                state.t_s,
                frame,
                state.t_s,
                world.odometry(index),
                world.ball_in_mouth(index),
                state.phase,
                state.kick_off_side == robot.side,
                robot.pan_rad if isinstance(camera, PinholeCamera) else None,
            )
            if spoil is not None:
                senses = spoil(period, index, senses)
            command = team[index].act(senses)
            numbers = (command.forward_mps, command.left_mps, command.turn_rps, command.kick_mps)
            assert all(map(math.isfinite, numbers))
            commands[index] = command
            pose = team[index].status.pose
            error = pose.pose.error_to(robot.pose) if pose else (math.inf, math.inf)
            rows.append((state.t_s, index, *error))
        if disturb is not None:
            disturb(period, world)
        world.step(commands)
    return world, np.array(rows), goals, team


def right(rows):
    return (rows[:, 2] < 0.05) & (rows[:, 3] < math.radians(3))


@pytest.mark.slow
def test_a_ball_before_the_opponents_goal_is_shot_into_it():
    """Only this finds a player that never scores."""

    def lay_out(period, world):
        if period == 40:
            # the opponent stands in a far corner
            world.place(0, Pose2(0.5, 0.1, 0.0))
            world.place(1, Pose2(-1.2, -0.6, 0.0))
            world.place_ball(0.9, 0.1)

    world, _, goals, _ = play(7.0, disturb=lay_out)
    assert goals >= 1
    assert world.state.score[0] >= 1


def dropped(rng):
    def spoil(period, index, senses):
        lost = rng.random() < 0.3 and period > 0
        return dataclasses.replace(senses, frame=None, frame_t_s=None) if lost else senses

    return spoil


def test_frames_that_are_dropped_leave_it_its_place():
    _, rows, _, _ = play(1.5, spoil=dropped(np.random.default_rng(5)), seed=7)
    assert right(rows[rows[:, 0] > 0.5]).mean() >= 0.95


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["frozen", "black"])
def test_a_camera_that_fails_for_a_second_stops_the_robot_until_it_sees_again(fault):
    """Only this finds a robot that drives on blindly."""
    kept = {}

    def spoil(period, index, senses):
        if not 60 <= period < 90:
            kept[index] = senses.frame
            return senses
        frame = kept[index] if fault == "frozen" else np.zeros_like(senses.frame)
        return dataclasses.replace(senses, frame=frame)

    speeds = {}

    def watch(period, world):
        speeds[period] = max(math.hypot(*robot.velocity_mps) for robot in world.state.robots)

    _, rows, _, _ = play(4.2, spoil=spoil, disturb=watch, seed=7)
    assert speeds[88] < 0.15 < max(speeds.values())
    assert right(rows[rows[:, 0] > 4.0]).all()


def test_odometry_that_is_no_number_never_leaves_it():
    def spoil(period, index, senses):
        return dataclasses.replace(senses, odometry=Pose2(math.nan, 0.0, math.nan)) if period % 7 == 3 else senses

    _, rows, _, _ = play(1.0, spoil=spoil)
    assert right(rows).mean() > 0.8


def test_before_anything_is_seen_it_waits():
    player = BuiltInPlayer(PlayerSetup(FIELD, CAMERA, LIMITS, 1, 0, 1, 0))
    assert player.status.ball_in_field is None
    command = player.act(Senses(0.0, None, None, Pose2(0.0, 0.0, 0.0), False, "play", False))
    assert command == Command()
    assert player.status.intent == "wait"
    assert not player.status.pose
    assert player.status.view is None


def test_it_calibrates_where_its_camera_file_is_rough():
    rough = PlayerSetup(FIELD, CAMERA, LIMITS, 1, 0, 1, 0, camera_is_rough=True)
    calibration = BuiltInPlayer(rough).status.calibration
    assert calibration is not None
    assert calibration.center_px == CAMERA.center_px
    assert BuiltInTeam(settings=PlayerSettings(calibrates=False))(rough).status.calibration is None
    exact = dataclasses.replace(rough, camera_is_rough=False)
    assert BuiltInPlayer(exact).status.calibration is None


def test_at_a_kick_off_it_knows_its_place_before_any_frame():
    player = BuiltInPlayer(PlayerSetup(FIELD, CAMERA, LIMITS, -1, 0, 1, 0))
    player.act(Senses(0.0, None, None, Pose2(0.0, 0.0, 0.0), False, "kick_off", False))
    assert player.status.pose
    assert player.status.pose.pose == kick_off_pose(FIELD, -1, 0, 1, LIMITS.radius_m)
    assert max(player.status.pose.std[:2]) == pytest.approx(0.05, rel=0.05)
    player.act(Senses(0.1, None, None, Pose2(0.03, 0.0, 0.0), False, "kick_off", False))
    assert player.status.pose.pose.x_m == pytest.approx(kick_off_pose(FIELD, -1, 0, 1).x_m - 0.03, abs=1e-6)


def test_a_lost_player_with_a_forward_camera_looks_no_more_than_ten_times_a_second():
    field = load_field("four_legged_2007")
    camera = camera_for(field)
    player = BuiltInPlayer(PlayerSetup(field, camera, LIMITS, 1, 0, 1, 0))
    rng = np.random.default_rng(2)
    looked = []
    for step in range(7):
        dark = rng.integers(0, 4, (*camera.size_px[::-1], 3), dtype=np.uint8)
        player.act(Senses(step / 30, dark, step / 30, Pose2(0.0, 0.0, 0.0), False, "play", False, 0.0))
        looked.append(player.status.view)
    assert len({id(view) for view in looked}) == 3  # at 0, 0.1 and 0.2 s


@pytest.mark.slow
def test_a_head_that_pans_finds_its_place_by_the_goals():
    """Only this finds a place that is off by what the head turns between two frames."""
    field = load_field("four_legged_2007")
    camera = PinholeCamera((208, 160), (210.0, 210.0), (103.5, 79.5), 0.25, tilt_rad=math.radians(-6), roll_rad=0.0)
    limits = RobotLimits(radius_m=field.robot_radius_m, speed_mps=0.4)
    _, rows, _, team = play(3.0, field=field, camera=camera, limits=limits)
    known = np.isfinite(rows[:, 2])
    assert known.mean() > 0.5
    assert np.median(rows[known, 2]) < 0.05
    # the head turns all the time, and farther between two frames than this
    assert np.percentile(rows[known, 3], 90) < math.radians(2)
    assert all(player.status.view is not None for player in team)


def test_what_a_turning_head_sees_is_seen_from_where_it_was():
    field = load_field("four_legged_2007")
    camera = camera_for(field)
    truth = Pose2(-1.0, 0.3, -0.6)
    state = WorldState(0.0, (RobotState(0, 1, 0, truth, (0.0, 0.0), 0.0, pan_rad=0.55),), None, (0, 0), "play", 1, ())
    frame = MatchCamera(field, camera, LIMITS, np.random.default_rng(3)).render(state, 0)

    def believed(*pan_rad):
        player = BuiltInPlayer(PlayerSetup(field, camera, LIMITS, 1, 0, 1, 0))
        player.act(Senses(0.0, frame, 0.0, Pose2(0.0, 0.0, 0.0), False, "play", False, *pan_rad))
        return player.status.pose.pose

    assert believed(0.55).error_to(truth) == pytest.approx((0.0, 0.0), abs=0.05)
    # without the joint's word the head counts as straight ahead
    assert believed().theta_rad == pytest.approx(truth.theta_rad + 0.55, abs=0.05)


@pytest.mark.slow
def test_players_that_remember_follow_the_others_and_know_the_floor():
    """Only this finds tracks or a map that a player's own driving smears."""
    plan = MatchPlan(seconds=3.0, seed=3, ours=BuiltInTeam(("memory",)))
    match = plan.begin()
    pictures = MatchPictures(match.arena.field, match.arena.camera, 4, match.arena.limits.radius_m)
    off_m = []
    for moment in match.play(plan.seconds):
        for index, robot in enumerate(moment.robots[:2]):
            others = [truth.pose for truth in moment.state.robots if truth.index != index]
            tracks = robot.status.view.belief.tracks
            off_m.extend(min(math.hypot(p.x_m - t.x_m, p.y_m - t.y_m) for p in others) for t in tracks)
    assert len(off_m) > 90
    assert np.mean(np.array(off_m) < 0.10) > 0.9
    belief = robot.status.view.belief
    assert (belief.free_map.state == FREE).sum() * belief.free_map.cell_m**2 > 0.5
    assert moment.robots[2].status.view.belief.free_map is None
    # the film shows more of those who remember
    plain = tuple(
        dataclasses.replace(
            r, status=dataclasses.replace(r.status, view=dataclasses.replace(r.status.view, belief=None))
        )
        for r in moment.robots
    )
    shown = pictures.draw(moment) != pictures.draw(dataclasses.replace(moment, robots=plain))
    assert shown.any(axis=2).sum() > 1000

"""Draws the pictures of the guides: `python docs/pictures.py`, or with names `python docs/pictures.py steering team`.

Each is drawn by the library from the sample images or from made-up values, into this folder. `live.jpg` is what
`make browser-test` sees, `match.jpg` a film's poster, `overlay*` are written by the first program of README.md.
"""

from __future__ import annotations

import dataclasses
import math
import sys
from pathlib import Path

import cv2
import numpy as np
from matplotlib.patches import Ellipse

from field_models import load_field
from robocup_vision import MotionLimits, Pose2, Steering, Vision, draw, load_camera
from robocup_vision.camera import FisheyeCamera, PinholeCamera
from robocup_vision.evaluation.dataset import load_dataset
from robocup_vision.evaluation.plots import draw_field, new_figure, tidy
from robocup_vision.image_layers import ImageLayerMaker
from robocup_vision.team.ball_fusion import TeamBall
from robocup_vision.team.message import BallSighting, TeamMessage
from sim2d.rendering.cameras import sekimori_camera

HERE = Path(__file__).parent
MIRROR = HERE.parent / "images" / "omni_ssl_2001"
AHEAD = HERE.parent / "images" / "goal_four_legged"
INK, BLUE, RED, ORANGE, GREEN, GREY = "#1f2933", "#1f6fd1", "#c2313b", "#d9730d", "#2b8a3e", "#8a949e"


def mirror_frame(number=7):
    """Return the field, what looks, and a sample image of the mirror camera."""
    field = load_field("ssl_2001")
    return (
        field,
        Vision(field, load_camera(MIRROR / "camera.toml")),
        cv2.imread(str(MIRROR / f"images/{number:04}.png")),
    )


def save_plot(figure, name):
    """Write a figure in 256 colours: a third of the size."""
    figure.savefig(HERE / name, dpi=100, pil_kwargs={"optimize": True})


def save_photo(picture, name):
    """Write pictures of a camera."""
    cv2.imwrite(str(HERE / name), picture, [cv2.IMWRITE_JPEG_QUALITY, 78])


def arrow(axes, start, end, color, **how):
    """Draw an arrow between two points of the plot."""
    axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": color, "linewidth": 1.8, **how}, zorder=6)


def frames():
    """Draw the frames of field and robot, and a measurement."""
    figure, axes = draw_field(load_field("ssl_division_b"))
    robot, ball = Pose2(-2.2, 0.9, math.radians(-28.0)), (1.4, -0.4)
    for pose, size, color, names in (
        (Pose2(0, 0, 0), 1.3, INK, ("x", "y")),
        (robot, 1.1, BLUE, ("ahead: x", "left: y")),
    ):
        for turn, name in zip((0.0, math.pi / 2), names, strict=True):
            end = pose.compose(Pose2(0, 0, turn)).transform((size, 0.0))
            arrow(axes, (pose.x_m, pose.y_m), end, color)
            axes.text(end[0] + 0.08, end[1] + 0.12, name, color=color)
    axes.add_patch(Ellipse((robot.x_m, robot.y_m), 0.5, 0.5, facecolor=BLUE, alpha=0.4, zorder=5))
    axes.plot(*ball, "o", color=ORANGE, markersize=9, zorder=6)
    axes.plot([robot.x_m, ball[0]], [robot.y_m, ball[1]], "--", color=ORANGE, linewidth=1.4)
    axes.text(0.3, -0.95, "range and bearing of the ball", color=ORANGE)
    axes.text(
        robot.x_m - 2.1, robot.y_m + 1.35, f"robot at ({robot.x_m}, {robot.y_m}) m,\nturned by -28 degrees", color=BLUE
    )
    axes.text(4.3, 0.1, "goal that is\nattacked", color=INK, fontsize=9, ha="right")
    axes.set_aspect("equal")
    tidy(axes, "x of the field (m)", "y of the field (m)")
    save_plot(figure, "frames.png")


def score():
    """Draw the errors of the sample images."""
    dataset = load_dataset(MIRROR)
    figure, axes = draw_field(dataset.field)
    vision, scale = Vision(dataset.field, dataset.camera), 40.0
    for name in dataset.image_names:
        pose, truth = vision.look(cv2.imread(str(MIRROR / "images" / name))).pose, dataset.truth[name]
        vision.forget()
        axes.plot(truth.x_m, truth.y_m, "o", color=GREY, markersize=9, fillstyle="none", zorder=4)
        there = min(
            (pose.pose, pose.pose.half_turn()), key=lambda one: math.hypot(one.x_m - truth.x_m, one.y_m - truth.y_m)
        )
        error = np.array([there.x_m - truth.x_m, there.y_m - truth.y_m])
        arrow(axes, (truth.x_m, truth.y_m), (truth.x_m, truth.y_m) + scale * error, RED, shrinkA=0, shrinkB=0)
    axes.set_title(f"Circles: the truth; arrows: errors, {scale:.0f} times as long", fontsize=10)
    axes.set_aspect("equal")
    tidy(axes, "x (m)", "y (m)")
    save_plot(figure, "score.png")


def calibration():
    """Draw the field into a frame by the right camera, and by one whose centre is wrong."""
    field, vision, frame = mirror_frame()
    pose, layers = vision.look(frame).pose.pose, ImageLayerMaker(field)
    sides = []
    for title, moved_px in (("as calibrated", 0.0), ("centre 4 pixels off", 4.0)):
        u, v = vision.camera.center_px
        camera = dataclasses.replace(vision.camera, center_px=(u + moved_px, v))
        side = cv2.resize(frame, None, fx=2, fy=2, interpolation=cv2.INTER_LINEAR)
        for path in layers.field_at(camera, pose):
            cv2.polylines(side, [np.round(2 * path + 0.5).astype(np.int32)], False, (255, 255, 0), 1, cv2.LINE_AA)
        cv2.putText(side, title, (10, 24), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (255, 255, 255), 1, cv2.LINE_AA)
        sides.append(side)
    save_photo(np.hstack(sides), "calibration.jpg")


def steering():
    """Draw what a view holds, from above, and the command that steering makes of it."""
    _, vision, frame = mirror_frame()
    view = vision.look(frame)
    target_rad, velocity = 0.3, (0.2, 0.0)
    command = Steering(0.09, MotionLimits(0.4, 0.3, dead_time_s=0.03)).steer(view.free_space, velocity, target_rad)
    figure = new_figure(8.0, 4.2)
    axes = figure.subplots()
    bearing, reach = view.free_space.bearing_rad, np.nan_to_num(view.free_space.range_m)
    axes.fill(reach * np.cos(bearing), reach * np.sin(bearing), color=GREEN, alpha=0.25, label="free floor")
    for thing in view.obstacles:
        axes.plot(thing.x_m, thing.y_m, "s", color=RED, markersize=10, label="obstacle")
    if view.ball is not None:
        axes.plot(view.ball.x_m, view.ball.y_m, "o", color=ORANGE, markersize=8, label="ball")
    axes.add_patch(Ellipse((0, 0), 0.18, 0.18, facecolor=BLUE, zorder=5))
    axes.plot(
        [0, 1.2 * math.cos(target_rad)], [0, 1.2 * math.sin(target_rad)], ":", color=GREY, label="towards the target"
    )
    arrow(axes, (0, 0), tuple(2.0 * np.array(command.velocity_mps)), BLUE)
    axes.set_title(f"{command.reason}: {np.hypot(*command.velocity_mps):.2f} m/s", fontsize=10)
    axes.legend(frameon=False, fontsize=9, loc="center left", bbox_to_anchor=(1.0, 0.5))
    axes.set_aspect("equal")
    tidy(axes, "ahead of the robot (m)", "to its left (m)")
    save_plot(figure, "steering.png")


def refused():
    """Draw frames that are not located, each with its reason."""
    _, vision, frame = mirror_frame()
    ahead = cv2.imread(str(AHEAD / "images/0017.jpg"))
    forward = Vision(load_field("four_legged_2007"), load_camera(AHEAD / "camera.toml"))
    covered = frame.copy()
    cv2.circle(covered, (covered.shape[1] // 2, covered.shape[0] // 2), covered.shape[0] // 3, (40, 40, 45), -1)
    pictures = [draw(vision.look(covered), covered, vision)]
    for bad in ((0.02 * ahead).astype(np.uint8), np.ascontiguousarray(ahead[::-1])):
        pictures.append(draw(forward.look(bad), bad, forward))
        forward.forget()
    height = 300
    save_photo(
        np.hstack(
            [
                cv2.resize(one, (round(one.shape[1] * height / one.shape[0]), height), interpolation=cv2.INTER_AREA)
                for one in pictures
            ]
        ),
        "refused.jpg",
    )


def cameras():
    """Draw a floor of tiles as three kinds of camera show it."""
    ahead = PinholeCamera((320, 240), (160.0, 160.0), (159.5, 119.5), height_m=0.4, tilt_rad=math.radians(-15))
    fisheye = FisheyeCamera(
        (320, 240), (75.0, 75.0), (159.5, 119.5), height_m=0.4, tilt_rad=math.radians(-25), projection="equidistant"
    )
    figure = new_figure(9.0, 2.9)
    steps, dense = np.arange(-3.0, 3.01, 0.5), np.linspace(-3.0, 3.0, 400)
    for axes, (title, camera) in zip(
        figure.subplots(1, 3),
        (("pinhole", ahead), ("fisheye", fisheye), ("mirror", sekimori_camera(320, 240))),
        strict=True,
    ):
        for at in steps:
            for line in (
                np.column_stack([np.full_like(dense, at), dense]),
                np.column_stack([dense, np.full_like(dense, at)]),
            ):
                pixels = camera.floor_to_pixel(line)
                if camera is not ahead and camera is not fisheye:
                    pixels[np.hypot(*(pixels - camera.center_px).T) > camera.usable_radius_px[1]] = np.nan
                axes.plot(*pixels.T, color=GREEN, linewidth=0.8)
        axes.set_xlim(0, 319)
        axes.set_ylim(239, 0)
        axes.set_aspect("equal")
        axes.set_title(title, fontsize=10)
        axes.set_xticks([])
        axes.set_yticks([])
    save_plot(figure, "cameras.png")


def team():
    """Draw what three robots say of the ball, and what is believed."""
    figure, axes = draw_field(load_field("four_legged_2007"))
    team_ball = TeamBall()
    seen = (
        (Pose2(-1.6, 0.8, -0.3), (0.62, 0.14), (0.20, 0.08)),
        (Pose2(0.9, -1.1, 1.9), (0.52, 0.02), (0.06, 0.12)),
        (Pose2(-0.4, 1.3, 2.9), (-1.9, -0.9), (0.1, 0.1)),
    )
    for number, (pose, place, std) in enumerate(seen, start=1):
        covariance = np.diag(np.square(std))
        sighting = BallSighting(10.0, *place, 0.0, 0.0, covariance)
        team_ball.update(TeamMessage(number, 10.0, "fetch", 1.0, pose, 1e-4 * np.eye(3), sighting), own=None)
        axes.add_patch(Ellipse((pose.x_m, pose.y_m), 0.26, 0.26, facecolor=BLUE, zorder=5))
        axes.text(pose.x_m, pose.y_m, str(number), color="white", ha="center", va="center", zorder=6)
        axes.plot([pose.x_m, place[0]], [pose.y_m, place[1]], ":", color=BLUE, linewidth=1.2)
        axes.add_patch(Ellipse(place, *(2 * 2.45 * np.array(std)), edgecolor=BLUE, facecolor="none", zorder=5))
    ball = team_ball.fuse(own=None, t_s=10.1)
    std = np.sqrt(np.diag(ball.covariance))
    axes.add_patch(Ellipse((ball.x_m, ball.y_m), *(2 * 2.45 * std), facecolor=ORANGE, alpha=0.5, zorder=6))
    axes.text(ball.x_m + 0.35, ball.y_m + 0.2, "believed", color=ORANGE)
    axes.text(-2.6, -1.25, "3 is not believed: it disagrees with the others", color=BLUE, fontsize=9)
    axes.set_aspect("equal")
    tidy(axes, "x (m)", "y (m)")
    save_plot(figure, "team.png")


def boxes(name, size, places, arrows, width=10.0):
    """Draw boxes by name and place, and arrows between them with words."""
    figure = new_figure(*size)
    axes = figure.subplots()
    for text, (x, y) in places.items():
        axes.text(
            x,
            y,
            text,
            ha="center",
            va="center",
            color=INK,
            bbox={"boxstyle": "round,pad=0.6", "facecolor": "#eef3f7", "edgecolor": GREY},
        )
    for (x0, y0), (x1, y1), words in arrows:
        arrow(axes, (x0, y0), (x1, y1), BLUE)
        axes.text(
            (x0 + x1) / 2,
            (y0 + y1) / 2 + 0.05,
            words,
            ha="center",
            va="bottom",
            fontsize=8.5,
            color=BLUE,
            bbox={"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none"},
            zorder=7,
        )
    axes.set_xlim(0, width)
    axes.set_ylim(0, 4)
    axes.axis("off")
    save_plot(figure, name)


def league():
    """Draw who sends what to which port of the small-size league's network."""
    boxes(
        "league.png",
        (9.0, 3.8),
        {
            "game controller\nor simulate's own referee": (1.5, 3.4),
            "robocup-vision\nsimulate": (1.5, 1.0),
            "play,\nor your team": (8.5, 1.0),
            "other programs:\nlog record, trackers": (8.5, 3.4),
        },
        [
            ((2.6, 1.45), (7.7, 1.45), "vision 10020, tracker 10010"),
            ((7.7, 0.95), (2.6, 0.95), "robots 10301 and 10302"),
            ((7.7, 0.45), (2.6, 0.45), "simulation control 10300"),
            ((3.0, 3.5), (7.3, 3.5), "referee 10003"),
            ((3.0, 3.0), (7.7, 1.75), "referee 10003"),
        ],
    )


def machines():
    """Draw how pieces of work are handed out."""
    boxes(
        "machines.png",
        (9.0, 3.2),
        {
            "the command\nreads and writes in order": (1.6, 2.0),
            "worker: a process\n(--jobs 2)": (8.2, 3.3),
            "worker: another machine\n(--dask ADDRESS)": (8.2, 2.0),
            "worker that dies:\nits piece is done again": (8.2, 0.7),
        },
        [
            ((3.1, 2.3), (6.9, 3.3), "images 0 to 15"),
            ((3.1, 2.0), (6.5, 2.0), "images 16 to 31"),
            ((3.1, 1.7), (6.7, 0.7), "images 32 to 47"),
        ],
    )


def recordings():
    """Draw where a recording comes from and what reads it."""
    boxes(
        "recordings.png",
        (9.0, 3.6),
        {
            "robot's loop with Recorder,\nlive --record, match --record": (1.7, 2.0),
            "run.mcap:\nframes, odometry,\nviews, commands, settings": (5.2, 2.0),
            "replay: the same, bit for bit?": (8.6, 3.6),
            "evaluate: how well?": (8.6, 2.5),
            "live: look at a moment": (8.6, 1.4),
            "Foxglove, ROS 2, evo": (8.6, 0.3),
        },
        [
            ((3.3, 2.0), (4.0, 2.0), ""),
            *(((6.4, 2.0), (7.3, y), "") for y in (3.5, 2.5, 1.4, 0.4)),
        ],
    )


def landmarks():
    """Draw how a map is built and used."""
    boxes(
        "landmarks.png",
        (9.0, 2.6),
        {
            "three cameras,\nonce round the room": (1.2, 2.0),
            "map.npz: features\nwith covariances": (4.6, 2.0),
            "60 of them, chosen\nfor one place": (8.4, 3.3),
            "one camera's frame": (8.4, 0.7),
            "pose with\ncovariance": (11.4, 2.0),
        },
        [
            ((2.3, 2.0), (3.5, 2.0), "map build"),
            ((5.7, 2.2), (7.2, 3.2), ""),
            ((9.5, 3.1), (10.6, 2.3), ""),
            ((9.5, 0.9), (10.6, 1.7), "map locate"),
        ],
        width=12.4,
    )


_ALL = (frames, score, calibration, steering, refused, cameras, team, league, machines, recordings, landmarks)
PICTURES = {one.__name__: one for one in _ALL}

if __name__ == "__main__":
    for chosen in sys.argv[1:] or PICTURES:
        PICTURES[chosen]()
        print(chosen)

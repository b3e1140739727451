"""Writes match.webm: the match from above with truth and estimates, and each robot's frame with its detections."""

from __future__ import annotations

import dataclasses
import math
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from queue import Queue
from threading import Thread

import cv2
import numpy as np

from field_models.errors import FileError, FrameError
from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.belief import MapPicture
from robocup_vision.camera import OmniCamera, PinholeCamera
from robocup_vision.estimates import PoseEstimate
from robocup_vision.overlay import draw_layers
from robocup_vision.vision import Vision
from sim2d.report.top_view import SIDE_COLORS, Bgr, TopView
from sim2d.robot_link import CONTROL_PERIOD_S
from sim2d.world.state import Moment, RobotMoment, RobotState, WorldState

# ten pictures per second, of 0.4 million pixels: drawing more would take longer than the match itself
_PERIODS_PER_FRAME = 3
# moments that may wait to be drawn, bounded because each holds the robots' frames in memory
_MAX_WAITING = 16
# smoothing removes the sensor's noise, which would make up two thirds of the file
_SMOOTHING_PX = 0.8
_TOP_WIDTH, _MIN_HEIGHT, _MIN_PANEL_HEIGHT = 620, 380, 180
_LINE_HEIGHT = 22
_POSTER_QUALITY = 80
# colours of FREE, NO_GO and UNDECIDED cells
_MAP_COLORS = np.array([(90, 160, 90), (60, 60, 200), (120, 120, 120)], dtype=np.uint8)
_PAPER, _INK, _SOFT = (38, 34, 32), (240, 240, 240), (170, 170, 170)

# frame rate stated to the encoder, which spreads a fixed bit rate over it (see `FilmFile`): small text stays readable
_CLAIMED_PER_S = 7_000.0
_VP8 = cv2.VideoWriter.fourcc(*"VP80")


class MatchVideo:
    """Writes a match as VP8 in a webm file. If that is not possible, `problem` says why, and nothing is written.

    A thread of its own draws and encodes the pictures while the match continues. After `close`, `poster` is a JPEG of
    the moment in play with the ball nearest to a goal; it is empty if there was no picture.
    """

    def __init__(
        self, path: Path, field: Field, camera: OmniCamera | PinholeCamera, robots: int, robot_radius_m: float
    ) -> None:
        self._pictures = MatchPictures(field, camera, robots, robot_radius_m)
        self._goals_x_m = tuple(goal.line_x_m for goal in field.goals)
        self.poster = b""
        # distance of the ball from a goal, and the picture
        self._best: tuple[float, UInt8Array] | None = None
        self._count = 0
        self._film = FilmFile(path, 1 / (_PERIODS_PER_FRAME * CONTROL_PERIOD_S), self._pictures.size_px)
        self.problem = self._film.problem
        self._waiting: Queue[Moment | None] = Queue(_MAX_WAITING)
        self._failure: Exception | None = None
        self._thread = Thread(target=self._draw_all, name="film", daemon=True)
        self._thread.start()

    def add(self, moment: Moment) -> None:
        """Add a control period; every third becomes a picture.

        Raises
        ------
        FrameError, cv2.error
            If an earlier picture could not be drawn or written.
        """
        if self._failure is not None:
            raise self._failure
        if not self.problem and self._count % _PERIODS_PER_FRAME == 0:
            self._waiting.put(moment)
        self._count += 1

    def _draw_all(self) -> None:
        while True:
            moment = self._waiting.get()
            if moment is None:
                return
            # after a failure the queue is still emptied, so that the match does not wait for a free place
            if self._failure is None:
                try:
                    picture = self._pictures.draw(moment)
                    self._film.write(picture)
                    self._choose(moment, picture)
                except Exception as failure:
                    self._failure = failure

    def _choose(self, moment: Moment, picture: UInt8Array) -> None:
        """Keep the picture as the poster if the ball is nearer to a goal than in the poster so far."""
        distance_m, ball = math.inf, moment.state.ball
        if ball is not None and moment.state.phase == "play":
            distance_m = min((math.hypot(x_m - ball.x_m, ball.y_m) for x_m in self._goals_x_m), default=math.inf)
        # without any ball in play the last picture is kept: on the first ones nothing has been detected yet
        if self._best is None or distance_m < self._best[0] or math.isinf(self._best[0]):
            self._best = (distance_m, picture)

    def close(self) -> None:
        """Finish the file.

        Raises
        ------
        FrameError, FileError, cv2.error
            If a picture or the file could not be written.
        """
        self._waiting.put(None)
        self._thread.join()
        self._film.close()
        if self._failure is not None:
            raise self._failure
        if self._best is not None:
            self.poster = cv2.imencode(".jpg", self._best[1], [cv2.IMWRITE_JPEG_QUALITY, _POSTER_QUALITY])[1].tobytes()


class MatchPictures:
    """Draws moments of one match; see `MatchVideo`."""

    def __init__(self, field: Field, camera: OmniCamera | PinholeCamera, robots: int, robot_radius_m: float) -> None:
        rows = math.ceil(robots / 2)
        self._columns = min(robots, 2)
        height = max(_MIN_HEIGHT, rows * _MIN_PANEL_HEIGHT)
        self._panel_height = (height // rows) // 2 * 2
        height = self._panel_height * rows
        self._view_height = self._panel_height - _LINE_HEIGHT
        width, tall = camera.size_px
        self._panel_width = round(self._view_height * width / tall / 2) * 2
        self._head_height = 2 * _LINE_HEIGHT
        self._top = TopView(field, (_TOP_WIDTH, height - self._head_height), robot_radius_m)
        if isinstance(camera, PinholeCamera):
            # a frame is shown in the head's own frame, without the neck's pan
            camera = dataclasses.replace(camera, pan_rad=0.0, offset_m=(0.0, 0.0))
        self._vision = Vision(field, camera)
        self._name = field.name
        self.size_px = (_TOP_WIDTH + self._columns * self._panel_width, height)
        # the parts that never change are drawn once
        self._empty = np.full((height, self.size_px[0], 3), _PAPER, dtype=np.uint8)
        legend = "disc: truth   ring: estimate, with its 95 % ellipse   cross: estimated ball   small ring: track"
        _write(self._empty, legend, (14, 37), _SOFT, 0.38)

    def draw(self, moment: Moment) -> UInt8Array:
        """Return the picture (H, W, 3) of a moment, with W and H of `size_px`."""
        canvas = self._empty.copy()
        canvas[self._head_height :, :_TOP_WIDTH] = self._top.draw(moment.state, moment.robots)
        self._write_reasons(canvas, moment)
        self._write_head(canvas, moment.state)
        for index, (truth, robot) in enumerate(zip(moment.state.robots, moment.robots, strict=True)):
            # with two columns, each side has its own
            row, column = divmod(index, self._columns)
            if self._columns == 2:
                column, row = divmod(index, len(moment.robots) // 2)
            left, top = _TOP_WIDTH + column * self._panel_width, row * self._panel_height
            panel = canvas[top : top + self._panel_height, left : left + self._panel_width]
            self._draw_panel(panel, truth, robot)
        return canvas

    def _draw_panel(self, panel: UInt8Array, truth: RobotState, robot: RobotMoment) -> None:
        frame, view = robot.senses.frame, robot.status.view
        picture = None
        if frame is not None:
            picture = np.asarray(cv2.GaussianBlur(frame, (0, 0), _SMOOTHING_PX), dtype=np.uint8)
            if view is not None and view.t_s == robot.senses.frame_t_s:
                draw_layers(view.views[0], picture, self._vision)
        if picture is not None:
            size = (self._panel_width, self._view_height)
            panel[_LINE_HEIGHT:] = cv2.resize(picture, size, interpolation=cv2.INTER_LINEAR)
        else:
            _write(panel, "no frame", (10, _LINE_HEIGHT + 30), _SOFT)
        if view is not None and view.belief is not None and view.belief.free_map is not None:
            _draw_map(panel, view.belief.free_map)
        pose = robot.status.pose
        error = "lost"
        if isinstance(pose, PoseEstimate):
            error_m, error_rad = pose.pose.error_to(truth.pose)
            error = f"{100 * error_m:.1f} cm, {math.degrees(error_rad):.1f} deg off"
        _write(panel, error, (6, self._panel_height - 8), _INK)
        for line, reason in enumerate(reversed(robot.status.reasons), start=1):
            _write(panel, f"{reason.topic}: {reason.choice}", (6, self._panel_height - 8 - 14 * line), _INK, 0.36)
        cv2.circle(panel, (12, 11), 6, SIDE_COLORS[truth.side], -1, cv2.LINE_AA)
        caption = f"stopped: {robot.stopped}" if robot.stopped else robot.status.intent
        _write(panel, f"{truth.number}  {caption}", (24, 16), _INK)

    def _write_reasons(self, canvas: UInt8Array, moment: Moment) -> None:
        """Write the reasons of each planning robot under the field."""
        lines = []
        for truth, robot in zip(moment.state.robots, moment.robots, strict=True):
            texts = [
                reason.text if reason.topic == "gap" else f"{reason.topic}: {reason.text}"
                for reason in robot.status.reasons
            ]
            lines += [(SIDE_COLORS[truth.side], f"{truth.number}  " + "   ".join(texts))] if texts else []
        for up, (color, text) in enumerate(reversed(lines)):
            _write(canvas, text, (14, self.size_px[1] - 8 - 14 * up), color, 0.36)

    def _write_head(self, canvas: UInt8Array, state: WorldState) -> None:
        ours, theirs = state.score
        doing = "kick-off" if state.phase == "kick_off" else state.phase.replace("_", " ")
        _write(canvas, f"{self._name}   {state.t_s:6.1f} s   {ours} : {theirs}   {doing}", (14, 19), _INK, 0.5)


def _draw_map(panel: UInt8Array, free_map: MapPicture) -> None:
    """Draw the map of the floor into the panel's upper right corner: x of the field to the right, y up."""
    picture = _MAP_COLORS[free_map.state.T[::-1]]
    side = panel.shape[0] // 3
    corner = panel[_LINE_HEIGHT : _LINE_HEIGHT + side, -side:]
    corner[:] = cv2.resize(picture, (side, side), interpolation=cv2.INTER_NEAREST)


def _write(canvas: UInt8Array, text: str, place: tuple[int, int], color: Bgr, size: float = 0.42) -> None:
    cv2.putText(canvas, text, place, cv2.FONT_HERSHEY_SIMPLEX, size, color, 1, cv2.LINE_AA)


class FilmFile:
    """A film of limited size, written picture by picture. `problem` says why that is impossible; empty if it is not.

    OpenCV offers neither a bit rate nor a quality for VP8. It requests 4 bits per pixel, about 20 MB per minute, but at
    most 2^30 bits per second. Pictures are therefore first written as a film with a very high frame rate, which leaves
    few bits for each. The encoded pictures are then copied into a film with the real rate.

    Parameters
    ----------
    path : Path
        The file, which exists after `close`. Until then there is a temporary one beside it that ends in ``.ivf``.
    """

    def __init__(self, path: Path, pictures_per_s: float, size_px: tuple[int, int]) -> None:
        self._path, self._encoded = path, path.with_suffix(".ivf")
        self._pictures_per_s, self._size_px = pictures_per_s, size_px
        self._writer = _open_writer(self._encoded, _CLAIMED_PER_S, size_px)
        self.problem = "" if self._writer.isOpened() else f"no {path.name}: this OpenCV cannot write VP8 video"

    def write(self, picture: UInt8Array) -> None:
        """Write a picture (H, W, 3) uint8, BGR.

        Raises
        ------
        FrameError
            If it has another size.
        """
        if (picture.shape[1], picture.shape[0]) != self._size_px:
            # OpenCV would drop it without an error
            raise FrameError(f"a video picture must be {self._size_px}, got {picture.shape[1::-1]}")
        self._writer.write(picture)

    def close(self) -> None:
        """Finish the file.

        Raises
        ------
        FileError
            If it cannot be written.
        """
        self._writer.release()
        if self.problem:
            return
        try:
            self._take_over()
        finally:
            self._encoded.unlink(missing_ok=True)

    def _take_over(self) -> None:
        """Write the encoded pictures at their real rate."""
        source = cv2.VideoCapture(str(self._encoded), cv2.CAP_FFMPEG, [cv2.CAP_PROP_FORMAT, -1])
        with _silence():
            options = [cv2.VIDEOWRITER_PROP_RAW_VIDEO, 1]
            film = cv2.VideoWriter(str(self._path), cv2.CAP_FFMPEG, _VP8, self._pictures_per_s, self._size_px, options)
        try:
            if not (source.isOpened() and film.isOpened()):
                raise FileError(self._path, "cannot be written as a webm film")
            while True:
                is_read, packet = source.read()
                if not is_read:
                    return
                # the lowest bit of a VP8 picture is 0 if it is a key frame
                film.set(cv2.VIDEOWRITER_PROP_KEY_FLAG, float(not np.ravel(packet)[0] & 1))
                film.write(packet)
        finally:
            source.release()
            film.release()


def _open_writer(path: Path, frames_per_s: float, size_px: tuple[int, int]) -> cv2.VideoWriter:
    with _silence():
        return cv2.VideoWriter(str(path), _VP8, frames_per_s, size_px)


@contextmanager
def _silence() -> Iterator[None]:
    """Suppress the line that OpenCV writes to standard error, whatever its log level, when it opens a webm file."""
    kept = os.dup(2)
    with tempfile.TemporaryFile() as nowhere:
        os.dup2(nowhere.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(kept, 2)
            os.close(kept)

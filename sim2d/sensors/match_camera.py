"""Renders the frames of a match: each robot's picture of a world state, in light that drifts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from field_models import COLOR_NAMES, Field
from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera import OmniCamera, PinholeCamera
from robocup_vision.camera.pinhole import camera_rotation
from sim2d.kernels.match_pixels import add_noise
from sim2d.rendering.backdrop import Backdrop
from sim2d.rendering.fast.forward import EyeInField, ForwardFrames
from sim2d.rendering.fast.mirror import MirrorFrames
from sim2d.rendering.scene import Ball, Box, Light, Robot, Room, Scene
from sim2d.rendering.sensor import Sensor, motion_blur
from sim2d.robot_link import CONTROL_PERIOD_S, RobotLimits
from sim2d.sensors.body_sway import UPRIGHT, Sway
from sim2d.world.state import BallState, RobotState, WorldState

MATCH_SENSOR = Sensor(noise_sigma=8.0, blur_px=0.7, vignette=0.25)
MATCH_LIGHT = Light(gradient=0.2, gradient_direction_rad=0.6)
MATCH_ROOM = Room(seed=4, distance_m=1.2)
CARPET_MARGIN_M = 0.5  # width of the carpet beyond the floor polygon of a field without walls
MARKERS_BGR = {1: COLOR_NAMES["yellow"], -1: COLOR_NAMES["blue"]}
# A camera that has turned farther between two frames was carried, and gets no motion blur and shutter effects.
_MAX_TURN_RAD = 0.6


@dataclass(frozen=True, slots=True)
class LightDriftSettings:
    """Settings of `LightDrift`."""

    #: Greatest relative change of the brightness on the field.
    level_ratio: float = 0.1
    #: Period of the brightness.
    level_period_s: float = 40.0
    #: Time in which the direction of the light's gradient over the field turns once.
    turn_period_s: float = 240.0


class LightDrift:
    """Changes a match's light with time; `light` is the light without drift."""

    def __init__(self, settings: LightDriftSettings, light: Light, rng: np.random.Generator) -> None:
        self._settings, self._light = settings, light
        self._phase_rad = float(rng.uniform(0.0, math.tau))

    def at(self, t_s: float) -> Light:
        """Return the light at a time."""
        settings = self._settings
        swing = math.sin(self._phase_rad + math.tau * t_s / settings.level_period_s)
        return replace(
            self._light,
            level=self._light.level * (1 + settings.level_ratio * swing),
            gradient_direction_rad=self._light.gradient_direction_rad + math.tau * t_s / settings.turn_period_s,
        )


class RollingBall:
    """Tracks the rotation of one rolling ball."""

    def __init__(self, radius_m: float) -> None:
        self._radius_m = radius_m
        self._rotation: FloatArray = np.eye(3)
        self._last_m: tuple[float, float] | None = None

    def turn_rad(self, ball: BallState) -> tuple[float, float, float]:
        """Return the ball's rotations about the field's x, y and z axes, in this order, after it has rolled here."""
        if self._last_m is not None:
            self._roll(ball.x_m - self._last_m[0], ball.y_m - self._last_m[1])
        self._last_m = (ball.x_m, ball.y_m)
        r = self._rotation
        pitch = math.asin(max(-1.0, min(1.0, -float(r[2, 0]))))
        return math.atan2(r[2, 1], r[2, 2]), pitch, math.atan2(r[1, 0], r[0, 0])

    def _roll(self, x_m: float, y_m: float) -> None:
        distance_m = math.hypot(x_m, y_m)
        if distance_m == 0.0:
            return
        # the axis of rotation is to the left of the direction of motion (Rodrigues' formula)
        ax, ay, angle = -y_m / distance_m, x_m / distance_m, distance_m / self._radius_m
        c, s = math.cos(angle), math.sin(angle)
        across = np.array([[0.0, 0.0, ay], [0.0, 0.0, -ax], [-ay, ax, 0.0]])
        self._rotation = (np.eye(3) + s * across + (1.0 - c) * across @ across) @ self._rotation


@dataclass(frozen=True, slots=True)
class ShutterSettings:
    """The times of a pinhole camera's exposure, which matter while its head and body turn."""

    #: Exposure of a pixel, which causes motion blur. The light of an indoor hall needs about 10 ms.
    exposure_s: float = 0.010
    #: Rolling shutter: time from the first row to the last, as a cheap sensor takes it out of 33 ms for a frame.
    readout_s: float = 0.020


class MatchCamera:
    """Takes the pictures of all robots of a match, which carry equal cameras.

    Parameters
    ----------
    camera : OmniCamera or PinholeCamera
        Camera of every robot: a mirror camera of known viewpoint height, or a pinhole camera of known tilt on a head.
    shutter : ShutterSettings, optional
        Shutter of pinhole cameras; by default the exposure takes no time.
    backdrop : Backdrop, optional
        Picture on the room's wall, in place of the room's own clutter; for pinhole cameras only.

    Raises
    ------
    ArgumentError
        If the sensor compresses, a tilt is unknown, or a mirror camera is given bystanders or a backdrop.
    """

    def __init__(
        self,
        field: Field,
        camera: OmniCamera | PinholeCamera,
        limits: RobotLimits,
        rng: np.random.Generator,
        *,
        boxes: Sequence[Box] = (),
        sensor: Sensor = MATCH_SENSOR,
        room: Room = MATCH_ROOM,
        backdrop: Backdrop | None = None,
        shutter: ShutterSettings | None = None,
    ) -> None:
        self.field, self.camera, self.limits = field, camera, limits
        self.boxes, self.sensor, self.light, self.room = tuple(boxes), sensor, MATCH_LIGHT, room
        self._rng, self._shutter = rng, shutter
        # by robot: the time of its last frame, and the camera's rotation at that time
        self._last_rotation: dict[int, tuple[float, FloatArray]] = {}
        self._backdrop = backdrop
        self._frames = self._frames_of(camera)
        self._rolling = RollingBall(field.ball_radius_m)
        self._own: dict[int, MirrorFrames | ForwardFrames] = {}
        size = 3 * camera.size_px[0] * camera.size_px[1]
        self._noise_starts = size
        drawn = rng.standard_normal(2 * size, dtype=np.float32) * np.float32(sensor.noise_sigma)
        # bytes are fast to read; noise of more than half the sensor's range is clipped
        self._noise = np.rint(np.clip(drawn, -127.0, 127.0)).astype(np.int8)

    def _frames_of(self, camera: OmniCamera | PinholeCamera) -> MirrorFrames | ForwardFrames:
        """Return the renderer of a camera's frames."""
        scene = self._scene((), None)
        if isinstance(camera, PinholeCamera):
            if camera.tilt_rad is None:
                raise ArgumentError("a match's camera needs a known tilt_rad")
            return ForwardFrames(scene, camera, self.sensor, backdrop=self._backdrop)
        if self._backdrop is not None:
            raise ArgumentError("a mirror camera's match is drawn without a backdrop")
        return MirrorFrames(scene, camera, self.sensor)

    def set_camera(self, index: int, camera: OmniCamera | PinholeCamera) -> None:
        """Replace one robot's camera by another one of the same kind and image size.

        Raises
        ------
        ArgumentError
            If the camera is of another kind or size.
        """
        if type(camera) is not type(self.camera) or camera.size_px != self.camera.size_px:
            raise ArgumentError("a robot's own camera must be of the kind and image size of the match's")
        self._own[index] = self._frames_of(camera)

    def scene(self, state: WorldState, index: int) -> Scene:
        """Return the world around one robot: everything except itself."""
        return self._scene(self._robots(state, index), self._ball(state))

    def _robots(self, state: WorldState, index: int) -> tuple[Robot, ...]:
        radius_m, height_m = self.limits.radius_m, self.limits.height_m
        return tuple(
            Robot(r.pose.x_m, r.pose.y_m, radius_m, height_m, marker_bgr=MARKERS_BGR[r.side])
            for r in state.robots
            if r.index != index
        )

    def _ball(self, state: WorldState) -> Ball | None:
        if state.ball is None:
            return None
        field, here = self.field, (state.ball.x_m, state.ball.y_m)
        color = COLOR_NAMES[field.ball_color]
        # in a mirror's picture a ball is too small to show its patches
        if not field.ball_patches or isinstance(self.camera, OmniCamera):
            return Ball(*here, field.ball_radius_m, color)
        turned = self._rolling.turn_rad(state.ball)
        return Ball(*here, field.ball_radius_m, color, COLOR_NAMES[field.ball_patches], turned)

    def _scene(self, robots: tuple[Robot, ...], ball: Ball | None) -> Scene:
        margin = 0.0 if self.field.is_bounded else CARPET_MARGIN_M
        return Scene(self.field, self.boxes, robots, ball, self.light, self.room, margin)

    def set_light(self, light: Light) -> None:
        """Change the light on the field; the room behind it keeps its light."""
        for frames in (self._frames, *self._own.values()):
            frames.set_light(light)
        self.light = light

    def render(self, state: WorldState, index: int, sway: Sway = UPRIGHT) -> UInt8Array:
        """Take one robot's picture, (H, W, 3) uint8, BGR, read-only.

        Parameters
        ----------
        sway : Sway
            The lean and height of the robot's body; a mirror camera leans, but keeps its height.
        """
        robots, ball, robot = self._robots(state, index), self._ball(state), state.robots[index]
        frames = self._own.get(index, self._frames)
        if isinstance(frames, MirrorFrames):
            light = frames.draw(robots, ball, robot.pose, pitch_rad=sway.pitch_rad, roll_rad=sway.roll_rad)
        else:
            light = self._expose(frames, robots, ball, state.t_s, index, self._eye(frames.camera, robot, sway))
        frame = self._blur(light)
        if self.sensor.noise_sigma:
            # the noise was drawn once; every frame uses it from another random start
            start = int(self._rng.integers(self._noise_starts))
            add_noise(frame.reshape(-1), self._noise[start : start + frame.size])
        frame.flags.writeable = False
        return frame

    def _eye(self, camera: PinholeCamera, robot: RobotState, sway: Sway) -> EyeInField:
        """Return a pinhole camera's pose: the head pans about the camera's vertical axis, the body's lean turns it."""
        x_m, y_m = robot.pose.transform(camera.offset_m).tolist()
        pan_rad, tilt_rad, roll_rad = robot.pan_rad + (camera.pan_rad or 0.0), camera.tilt_rad, camera.roll_rad or 0.0
        height_m = camera.height_m + sway.height_m
        if sway == UPRIGHT:
            return EyeInField(x_m, y_m, height_m, robot.pose.theta_rad + pan_rad, tilt_rad or 0.0, roll_rad)
        ahead_m, left_m = camera.offset_m
        height_m += ahead_m * math.sin(sway.pitch_rad) + left_m * math.sin(sway.roll_rad)
        head = camera_rotation(pan_rad, tilt_rad or 0.0, roll_rad)
        rotation = camera_rotation(robot.pose.theta_rad, sway.pitch_rad, sway.roll_rad) @ head
        angles = (
            math.atan2(rotation[1, 0], rotation[0, 0]),
            math.asin(rotation[2, 0]),
            math.atan2(rotation[2, 1], rotation[2, 2]),
        )
        return EyeInField(x_m, y_m, height_m, *angles)

    def _expose(
        self,
        frames: ForwardFrames,
        robots: tuple[Robot, ...],
        ball: Ball | None,
        t_s: float,
        index: int,
        eye: EyeInField,
    ) -> UInt8Array:
        """Draw a pinhole camera's frame with rolling shutter and motion blur, by its turn since the last frame."""
        shutter = self._shutter
        if shutter is None:
            return frames.draw(robots, ball, eye)
        rotation = camera_rotation(eye.heading_rad, eye.tilt_rad, eye.roll_rad)
        before_s, before = self._last_rotation.get(index, (-math.inf, rotation))
        self._last_rotation[index] = (t_s, rotation)
        turned = rotation_vector(before.T @ rotation)
        if t_s - before_s > 2 * CONTROL_PERIOD_S or float(np.linalg.norm(turned)) > _MAX_TURN_RAD:
            turned = np.zeros(3)
        rate_rps = turned / CONTROL_PERIOD_S
        ahead, left, up = (rate_rps * shutter.readout_s).tolist()
        light = frames.draw(robots, ball, eye._replace(turn_rad=(ahead, left, up)))
        moved = rate_rps * shutter.exposure_s
        focal_u, focal_v = frames.camera.focal_px
        return motion_blur(light, float(moved[2]) * focal_u, float(-moved[1]) * focal_v)

    def _blur(self, frame: UInt8Array) -> UInt8Array:
        sigma = self.sensor.blur_px
        if not sigma:
            return frame.copy()
        beside = sigma * sigma / 2
        if beside > 1 / 3:
            return np.asarray(cv2.GaussianBlur(frame, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE), dtype=np.uint8)
        # a kernel of three pixels with the same variance, which OpenCV computes fastest
        narrow = math.sqrt(-0.5 / math.log(beside / (1 - 2 * beside)))
        blurred = cv2.GaussianBlur(frame, (3, 3), narrow, borderType=cv2.BORDER_REPLICATE)
        return np.asarray(blurred, dtype=np.uint8)


def rotation_vector(rotation: FloatArray) -> FloatArray:
    """Return axis times angle (3,) of a rotation (3, 3) by less than a half turn."""
    skew = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]])
    sine = float(np.linalg.norm(skew)) / 2
    angle = math.atan2(sine, (float(np.trace(rotation)) - 1) / 2)
    return np.asarray(skew / 2 * (angle / sine if sine > 1e-12 else 1.0))

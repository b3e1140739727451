"""ROS messages of views, odometry and commands, with their topics: for recordings, the ROS 2 node and Foxglove.

Coordinate frames are those of REP-105 and REP-120: map -> odom -> base_footprint -> the camera's optical frame. Where
nothing was seen, the array is empty and has the image's stamp; an unknown pose is not sent.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from field_models.errors import PacketError
from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.avoidance.steering import SteeringCommand
from robocup_vision.belief import MapPicture, Track
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.messages.camera_infos import camera_info
from robocup_vision.messages.images import ImageFormat, image_message
from robocup_vision.messages.types import header, make
from robocup_vision.perception.balls.ball import Ball
from robocup_vision.perception.markings.marking import Markings, Post
from robocup_vision.view import View

_STILL = Pose2(0.0, 0.0, 0.0)
# variance of height, roll and pitch, which are zero for a robot on the floor
_FLAT_VARIANCE = 1e-6
# camera axes (x right, y down, z forward) in those of a camera body (x forward, y left, z up)
_OPTICAL_TO_BODY = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
# values of soccer_vision_attribute_msgs/Confidence and of geometry_msgs/Quaternion
_UNKNOWN, _UPRIGHT = (-1.0,), (0.0, 0.0, 0.0, 1.0)
# the shortest time between two maps, which are large and change slowly
_MAP_PERIOD_S = 0.5
# side and team in soccer_vision_attribute_msgs/Goalpost
_LEFT, _RIGHT, _OWN, _OPPONENT = 1, 2, 1, 2

# message types by topic, without the prefix
TOPIC_TYPES = {
    "/camera/image": "sensor_msgs/msg/Image",
    "/camera/image/compressed": "sensor_msgs/msg/CompressedImage",
    "/camera/camera_info": "sensor_msgs/msg/CameraInfo",
    "/odometry": "nav_msgs/msg/Odometry",
    "/vision/pose_with_covariance": "geometry_msgs/msg/PoseWithCovarianceStamped",
    "/pose_with_covariance": "geometry_msgs/msg/PoseWithCovarianceStamped",
    "/scan": "sensor_msgs/msg/LaserScan",
    "/map": "nav_msgs/msg/OccupancyGrid",
    "/balls": "soccer_vision_3d_msgs/msg/BallArray",
    "/obstacles": "soccer_vision_3d_msgs/msg/ObstacleArray",
    "/field_boundary": "soccer_vision_3d_msgs/msg/FieldBoundary",
    "/markings": "soccer_vision_3d_msgs/msg/MarkingArray",
    "/goalposts": "soccer_vision_3d_msgs/msg/GoalpostArray",
    "/balls_in_image": "soccer_vision_2d_msgs/msg/BallArray",
    "/field_boundary_in_image": "soccer_vision_2d_msgs/msg/FieldBoundary",
    "/tracks": "soccer_model_msgs/msg/ObstacleArray",
    "/cmd_vel": "geometry_msgs/msg/TwistStamped",
    "/truth/pose": "geometry_msgs/msg/PoseStamped",
    "/truth/ball": "geometry_msgs/msg/PointStamped",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/tf_static": "tf2_msgs/msg/TFMessage",
}
# a quaternion shorter than this is not a rotation; others are normalised
_MIN_NORM = 1e-3

# the fields of a nested message, as `make` takes them
Fields = tuple[Any, ...]


class Outgoing(NamedTuple):
    """One message to be sent: its topic, the message, and the time in seconds of what it describes."""

    topic: str
    message: Any
    t_s: float


@dataclass(frozen=True, slots=True)
class FrameNames:
    """Names of the coordinate frames (REP-105, REP-120)."""

    map: str = "map"
    odom: str = "odom"
    robot: str = "base_footprint"
    camera: str = "camera_optical_frame"


@dataclass(frozen=True, slots=True)
class TopicSettings:
    """Which messages are sent, and on which topics.

    Parameters
    ----------
    prefix : str
        Precedes every topic's name, such as ``/robot1``, except `/tf` and `/tf_static`.
    frames : FrameNames
        Names of the coordinate frames.
    image_format : {"raw", "png", "jpeg"} or None
        The encoding of frames; None: frames are not sent.
    camera_transform : bool
        Whether the transform from robot to camera is sent.
    markings : bool
        Whether markings and goal posts are sent. Finding them takes longer than everything else in a look.
    """

    prefix: str = ""
    frames: FrameNames = FrameNames()
    image_format: ImageFormat | None = "raw"
    camera_transform: bool = True
    markings: bool = False


class Topics:
    """Makes the messages of one robot; one object per run."""

    def __init__(
        self, field: Field, camera: OmniCamera | PinholeCamera, settings: TopicSettings = TopicSettings()
    ) -> None:
        self._field, self._camera, self._settings = field, camera, settings
        self._names = settings.frames
        self._odom, self._is_own_odom = _STILL, True
        self._odom_s: float | None = None
        self._map_s = -math.inf
        self._static_sent = False

    def of_odometry(self, odometry: Pose2, t_s: float) -> list[Outgoing]:
        """Return a nav_msgs/Odometry: the sum of all motions so far.

        `odometry` is the motion since the last call, in the robot frame of that moment.
        """
        seconds = 0.0 if self._odom_s is None else t_s - self._odom_s
        self._odom, self._odom_s = self._odom.compose(odometry), t_s
        rate = 1.0 / seconds if seconds > 0.0 else 0.0
        velocity = _twist(odometry.x_m * rate, odometry.y_m * rate, odometry.theta_rad * rate)
        unknown, names = np.zeros(36), self._names
        pose = (_pose(self._odom), unknown)
        return [self._out("/odometry", names.odom, t_s, names.robot, pose, (velocity, unknown))]

    def at_odometry(self, odom: Pose2) -> None:
        """Take the robot's pose in the odom frame from another node's odometry; map -> odom is then relative to it."""
        self._odom, self._is_own_odom = odom, False

    def of_frame(self, frame: UInt8Array, t_s: float) -> list[Outgoing]:
        """Return the messages of a frame, (H, W, 3) uint8 BGR, taken at `t_s`, and of its camera."""
        image_format, camera_frame = self._settings.image_format, self._names.camera
        if image_format is None:
            return []
        topic = "/camera/image" if image_format == "raw" else "/camera/image/compressed"
        prefix = self._settings.prefix
        return [
            Outgoing(prefix + topic, image_message(frame, t_s, camera_frame, image_format), t_s),
            Outgoing(prefix + "/camera/camera_info", camera_info(self._camera, t_s, camera_frame), t_s),
        ]

    def of_look(self, view: View, t_s: float) -> Iterator[Outgoing]:
        """Yield the messages of a view of time `t_s`; each message is made when it is needed."""
        field_frame = self._names.map
        if isinstance(view.pose, PoseEstimate):
            yield self._out("/vision/pose_with_covariance", field_frame, t_s, _with_covariance(view.pose))
        believed = view.pose if view.belief is None else view.belief.pose
        if isinstance(believed, PoseEstimate):
            yield self._out("/pose_with_covariance", field_frame, t_s, _with_covariance(believed))
        yield from self._transforms(view, believed if isinstance(believed, PoseEstimate) else None, t_s)
        yield from self._surroundings(view, t_s)
        if view.belief is not None:
            yield self._out("/tracks", field_frame, t_s, [_obstacle(track) for track in view.belief.tracks])
            picture = view.belief.free_map
            # the clock may have been reset
            if picture is not None and not 0.0 <= t_s - self._map_s < _MAP_PERIOD_S:
                self._map_s = t_s
                yield Outgoing(self._settings.prefix + "/map", occupancy_grid(picture, t_s, field_frame), t_s)

    def of_command(self, command: SteeringCommand | tuple[float, float, float], t_s: float) -> list[Outgoing]:
        """Return a command as geometry_msgs/TwistStamped, robot frame; a tuple is (x m/s, y m/s, turn rad/s)."""
        velocity = (*command.velocity_mps.tolist(), 0.0) if isinstance(command, SteeringCommand) else command
        return [self._out("/cmd_vel", self._names.robot, t_s, _twist(*velocity))]

    def of_truth(self, robot: Pose2, t_s: float, ball_m: tuple[float, float] | None = None) -> list[Outgoing]:
        """Return the true pose for ``/truth/pose`` and the true ball for ``/truth/ball``, field frame."""
        out = [self._out("/truth/pose", self._names.map, t_s, _pose(robot))]
        if ball_m is not None:
            out.append(self._out("/truth/ball", self._names.map, t_s, (*ball_m, self._field.ball_radius_m)))
        return out

    def _out(self, topic: str, frame_id: str, t_s: float, *fields: Any) -> Outgoing:
        """Make a topic's message with a header and `fields`, as `make` takes them."""
        message = make(TOPIC_TYPES[topic], header(t_s, frame_id), *fields)
        return Outgoing(self._settings.prefix + topic, message, t_s)

    def _transforms(self, view: View, believed: PoseEstimate | None, t_s: float) -> list[Outgoing]:
        names, moving, fixed = self._names, [], []
        if believed is not None:
            map_to_odom = believed.pose.compose(self._odom.inverse())
            moving.append(_transform(names.map, names.odom, t_s, *_pose(map_to_odom)))
        if self._is_own_odom:
            moving.append(_transform(names.odom, names.robot, t_s, *_pose(self._odom)))
        camera = camera_transform(view.camera, names, t_s) if self._settings.camera_transform else None
        if camera is not None and isinstance(self._camera, PinholeCamera):
            moving.append(camera)
        elif camera is not None and not self._static_sent:
            self._static_sent = True
            fixed.append(camera)
        return [
            Outgoing(topic, make(TOPIC_TYPES[topic], transforms), t_s)
            for topic, transforms in (("/tf_static", fixed), ("/tf", moving))
            if transforms
        ]

    def _surroundings(self, view: View, t_s: float) -> Iterator[Outgoing]:
        robot, camera, ball_radius_m = self._names.robot, self._names.camera, self._field.ball_radius_m
        if len(view.free_space.range_m) > 1:
            yield self._out("/scan", robot, t_s, *_scan(view))
        balls = [((ball.x_m, ball.y_m, ball_radius_m), _UNKNOWN) for ball in view.balls]
        yield self._out("/balls", robot, t_s, balls)
        obstacles = []
        for thing in view.obstacles:
            # its depth is not visible and is set to its width; its height is unknown
            box = (_pose(Pose2(thing.x_m, thing.y_m, thing.bearing_rad)), (thing.width_m, thing.width_m, 0.0))
            obstacles.append((box, _UNKNOWN))
        yield self._out("/obstacles", robot, t_s, obstacles)
        edge = [(x, y, 0.0) for x, y in boundary_m(view).tolist()]
        yield self._out("/field_boundary", robot, t_s, edge, _UNKNOWN)
        yield self._out("/balls_in_image", camera, t_s, [self._ball_in_image(ball, view) for ball in view.balls])
        if self._settings.markings:
            yield from self._markings(view.markings, t_s)
        edge_px = view.boundary_px
        shown = [tuple(place) for place in edge_px[np.isfinite(edge_px).all(axis=1)].tolist()]
        yield self._out("/field_boundary_in_image", camera, t_s, shown, _UNKNOWN)

    def _markings(self, markings: Markings, t_s: float) -> Iterator[Outgoing]:
        circles = [(2 * circle.radius_m, circle.x_m, circle.y_m) for circle in markings.circles]
        circles += [(self._field.marks[0].size_m, mark.x_m, mark.y_m) for mark in markings.penalty_marks]
        ellipses = [(diameter_m, _pose(Pose2(x_m, y_m, 0.0)), _UNKNOWN) for diameter_m, x_m, y_m in circles]
        crossings = []
        for crossing in markings.crossings:
            rays = [(math.cos(arm), math.sin(arm), 0.0) for arm in crossing.arms_rad]
            crossings.append(((crossing.x_m, crossing.y_m, 0.0), len(rays), rays, _UNKNOWN))
        segments = [((*one.start_m, 0.0), (*one.end_m, 0.0), _UNKNOWN) for one in markings.segments]
        yield self._out("/markings", self._names.robot, t_s, ellipses, crossings, segments)
        yield self._out("/goalposts", self._names.robot, t_s, [self._goalpost(post) for post in markings.posts])

    def _goalpost(self, post: Post) -> Fields:
        goal = next(goal for goal in self._field.goals if goal.kind == "posts")
        # the middle of the post
        center = ((post.x_m, post.y_m, goal.height_m / 2), _UPRIGHT)
        side, team = 0, 0
        if post.feature_m is not None:
            x, y = post.feature_m
            # left and right as seen when facing the goal
            side = _LEFT if (y > 0) == (x > 0) else _RIGHT
            team = _OPPONENT if x > 0 else _OWN
        return ((center, (2 * goal.post_radius_m, 2 * goal.post_radius_m, goal.height_m)), (side, team), _UNKNOWN)

    def _ball_in_image(self, ball: Ball, view: View) -> Fields:
        box_px = np.array([ball.u_px, ball.v_px, 0.0, 0.0])
        if _is_placed(view.camera):
            outline = view.camera.point_to_pixel(
                sphere_outline((ball.x_m, ball.y_m, self._field.ball_radius_m), self._field.ball_radius_m, view.camera)
            )
            if np.isfinite(outline).all():
                low, high = outline.min(axis=0), outline.max(axis=0)
                box_px = np.concatenate([(low + high) / 2, high - low])
        u, v, width, height = box_px.tolist()
        return ((((u, v), 0.0), width, height), (ball.u_px, ball.v_px), _UNKNOWN)


def _scan(view: View) -> Fields:
    bearing, ranges = view.free_space.bearing_rad, view.free_space.range_m
    step = float(bearing[-1] - bearing[0]) / (len(bearing) - 1)
    reach = math.inf if view.grid is None else float(view.grid.ring_bounds_m[-1])
    # REP-117: nothing in reach is +inf
    shown = np.where(ranges >= reach - 1e-9, np.inf, ranges).astype(np.float32)
    no_time, nearest_m, no_intensities = 0.0, 0.0, np.empty(0, dtype=np.float32)
    return (float(bearing[0]), float(bearing[-1]), step, no_time, no_time, nearest_m, reach, shown, no_intensities)


def _obstacle(track: Track) -> Fields:
    place, speed = np.zeros((6, 6)), np.zeros((6, 6))
    place[:2, :2], speed[:2, :2] = track.covariance[:2, :2], track.covariance[2:, 2:]
    pose = _pose(Pose2(track.x_m, track.y_m, math.atan2(track.vy_mps, track.vx_mps)))
    return ((pose, place.ravel()), (_twist(track.vx_mps, track.vy_mps, 0.0), speed.ravel()))


def boundary_m(view: View) -> FloatArray:
    """Return the points of the floor boundary that lie on the floor, (N, 2) float64, robot frame, metres."""
    if view.polar is None:
        return np.empty((0, 2))
    floor = view.camera.pixel_to_floor(view.boundary_px)
    return np.asarray(floor[np.isfinite(floor).all(axis=1)])


def occupancy_grid(picture: MapPicture, t_s: float, frame_id: str) -> Any:
    """Return a map as nav_msgs/OccupancyGrid: free 0, occupied 100, undecided -1; its rows run along x."""
    values = np.array([0, 100, -1], dtype=np.int8)
    # the first index of `state` runs along x, that of ROS along y
    data = values[picture.state].T.ravel()
    rows, columns = picture.state.T.shape
    at = header(t_s, frame_id)
    info = (at.stamp, picture.cell_m, columns, rows, ((*picture.corner_m, 0.0), _UPRIGHT))
    return make("nav_msgs/msg/OccupancyGrid", at, info, np.ascontiguousarray(data))


def _is_placed(camera: OmniCamera | PinholeCamera) -> bool:
    """Whether the camera's position and orientation on the robot are known."""
    return camera.known_orientation if isinstance(camera, PinholeCamera) else camera.height_m is not None


def sphere_outline(
    center_m: tuple[float, float, float], radius_m: float, camera: OmniCamera | PinholeCamera
) -> FloatArray:
    """Return points on the circle of a sphere that a camera sees as its outline, (16, 3) float64, robot frame."""
    center = np.array(center_m)
    away = center - camera.viewpoint_m
    distance_m = float(np.linalg.norm(away))
    # inside the sphere there is no outline; the clipped ratio keeps the numbers finite
    ratio = min(radius_m / max(distance_m, 1e-9), 1.0)
    across = np.linalg.svd((away / max(distance_m, 1e-9))[None])[2][1:]
    turn = np.linspace(0.0, 2 * math.pi, 16, endpoint=False)
    circle = np.cos(turn)[:, None] * across[0] + np.sin(turn)[:, None] * across[1]
    return np.asarray(center - ratio * ratio * away + radius_m * math.sqrt(1.0 - ratio * ratio) * circle)


def camera_transform(camera: OmniCamera | PinholeCamera, names: FrameNames, t_s: float) -> Any:
    """Return the transform from the robot to the camera's optical frame; None where the tilt or height is unknown."""
    if not _is_placed(camera):
        return None
    body_to_robot = np.asarray(camera.camera_to_robot)
    # a mirror camera looks straight up; its optical frame's z is the mirror's axis
    optical_to_body = _OPTICAL_TO_BODY if isinstance(camera, PinholeCamera) else np.eye(3)
    turn = _quaternion(body_to_robot @ optical_to_body)
    return _transform(names.robot, names.camera, t_s, tuple(camera.viewpoint_m.tolist()), turn)


def _transform(parent: str, child: str, t_s: float, place_m: Fields, turn: Fields) -> Any:
    return make("geometry_msgs/msg/TransformStamped", header(t_s, parent), child, (place_m, turn))


def pose_message(pose: Pose2) -> Any:
    """Return a pose in the plane as geometry_msgs/Pose."""
    return make("geometry_msgs/msg/Pose", *_pose(pose))


def _pose(pose: Pose2) -> tuple[Fields, Fields]:
    half = pose.theta_rad / 2
    return (pose.x_m, pose.y_m, 0.0), (0.0, 0.0, math.sin(half), math.cos(half))


def _twist(forward: float, left: float, turn: float) -> Fields:
    return (forward, left, 0.0), (0.0, 0.0, turn)


def covariance_6x6(covariance: FloatArray) -> FloatArray:
    """Return a (3, 3) covariance of (x, y, heading) as (36,) float64, row-major, of x, y, z and turns about them."""
    full = np.diag(np.full(6, _FLAT_VARIANCE))
    places = [0, 1, 5]
    full[np.ix_(places, places)] = covariance
    return full.ravel()


def covariance_3x3(covariance: Any) -> FloatArray:
    """Return the (3, 3) float64 covariance of (x, y, heading) from the 36 numbers of a ROS message."""
    places = [0, 1, 5]
    return np.asarray(covariance, dtype=np.float64).reshape(6, 6)[np.ix_(places, places)]


def _with_covariance(estimate: PoseEstimate) -> Fields:
    return _pose(estimate.pose), covariance_6x6(estimate.covariance)


def _quaternion(rotation: FloatArray) -> tuple[float, float, float, float]:
    """Return (x, y, z, w) of a rotation matrix (3, 3), dividing by the largest component, which is never near zero."""
    m = rotation
    trace = [m[0, 0] - m[1, 1] - m[2, 2], m[1, 1] - m[0, 0] - m[2, 2], m[2, 2] - m[0, 0] - m[1, 1], np.trace(m)]
    largest = int(np.argmax(trace))
    root = 2.0 * math.sqrt(max(1.0 + float(trace[largest]), 0.0))
    if largest == 3:
        x, y, z = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
        return float(x / root), float(y / root), float(z / root), root / 4
    i, j, k = largest, (largest + 1) % 3, (largest + 2) % 3
    parts = [0.0, 0.0, 0.0, float((m[k, j] - m[j, k]) / root)]
    parts[i], parts[j], parts[k] = root / 4, float((m[j, i] + m[i, j]) / root), float((m[k, i] + m[i, k]) / root)
    return parts[0], parts[1], parts[2], parts[3]


def place_of(position: Any, orientation: Any) -> tuple[float, float, float | None]:
    """Return x and y, metres, and the direction of the x axis, radians; None if the orientation is not a rotation.

    Raises PacketError if the position is not finite, or position and orientation are all 0, as in an unfilled message.
    """
    x_m, y_m, z_m = float(position.x), float(position.y), float(position.z)
    if not all(map(math.isfinite, (x_m, y_m, z_m))):
        raise PacketError(f"the position is not finite ({x_m:g}, {y_m:g}, {z_m:g})")
    heading_rad = _heading(orientation)
    if heading_rad is None and x_m == y_m == z_m == 0.0:
        raise PacketError("position and orientation are all 0")
    return x_m, y_m, heading_rad


def _heading(orientation: Any) -> float | None:
    """Return the direction, radians, of the x axis turned by a geometry_msgs/Quaternion; None: it is not a rotation."""
    x, y, z, w = (float(getattr(orientation, name)) for name in "xyzw")
    norm = math.hypot(x, y, z, w)
    if not math.isfinite(norm) or norm < _MIN_NORM:
        return None
    return math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def pose_of(message: Any) -> Pose2:
    """Return the pose in the plane of a geometry_msgs/Pose: its position, and the direction of its x axis.

    Raises PacketError if the position is not finite or all 0, or the orientation is not a rotation.
    """
    x_m, y_m, heading_rad = place_of(message.position, message.orientation)
    if heading_rad is None:
        q = message.orientation
        raise PacketError(f"the orientation {q.x:g}, {q.y:g}, {q.z:g}, {q.w:g} is no rotation")
    return Pose2(x_m, y_m, heading_rad)

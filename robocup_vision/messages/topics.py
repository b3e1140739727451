"""What a look and a command tell, as messages on topics: the same for recordings, the ROS 2 node and Foxglove.

Frames as in REP-105 and REP-120: map -> odom -> base_footprint -> the camera's optical frame. What was not seen is an
empty array with the image's stamp; a pose that is not known is not sent.
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
# of height, roll and pitch, which a robot on a floor does not have
_FLAT_VARIANCE = 1e-6
# camera axes (x right, y down, z forward) in those of a camera body (x forward, y left, z up)
_OPTICAL_TO_BODY = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
_UNKNOWN_CONFIDENCE = -1.0
# of soccer_vision_attribute_msgs/Goalpost
_LEFT, _RIGHT, _OWN, _OPPONENT = 1, 2, 1, 2

# topics without their prefix, and the types of their messages
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
# a quaternion shorter than this is no rotation; others are normalised
_MIN_NORM = 1e-3


class Outgoing(NamedTuple):
    """One message on its way: its topic, the message, and when what it tells of happened, seconds."""

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
    """What is sent, and on which topics.

    Parameters
    ----------
    prefix : str
        Before every topic's name, such as ``/robot1``; `/tf` and `/tf_static` stay as they are.
    frames : FrameNames
        Names of the coordinate frames.
    image_format : {"raw", "png", "jpeg"} or None
        How frames are sent; None: they are not.
    camera_transform : bool
        Whether the camera's place on the robot is sent.
    map_period_s : float
        The map is sent no oftener than this: it is large, and changes slowly.
    markings : bool
        Whether markings and goal posts are sent: finding them takes longer than the rest of a look.
    """

    prefix: str = ""
    frames: FrameNames = FrameNames()
    image_format: ImageFormat | None = "raw"
    camera_transform: bool = True
    map_period_s: float = 0.5
    markings: bool = False


class Topics:
    """Makes the messages of one robot; one object a run."""

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
        """Tell the robot's motion since the last call, in its frame then, as nav_msgs/Odometry from the start on."""
        seconds = 0.0 if self._odom_s is None else t_s - self._odom_s
        self._odom, self._odom_s = self._odom.compose(odometry), t_s
        rate = 1.0 / seconds if seconds > 0.0 else 0.0
        unknown = np.zeros(36)
        message = make(
            "nav_msgs/msg/Odometry",
            header(t_s, self._names.odom),
            self._names.robot,
            make("geometry_msgs/msg/PoseWithCovariance", pose_message(self._odom), unknown),
            make(
                "geometry_msgs/msg/TwistWithCovariance",
                _twist(odometry.x_m * rate, odometry.y_m * rate, odometry.theta_rad * rate),
                unknown,
            ),
        )
        return [self._out("/odometry", message, t_s)]

    def at_odometry(self, odom: Pose2) -> None:
        """Note where somebody else's odometry has the robot, odom frame: map -> odom is then relative to that."""
        self._odom, self._is_own_odom = odom, False

    def of_frame(self, frame: UInt8Array, t_s: float) -> list[Outgoing]:
        """Tell a frame (H, W, 3) uint8 BGR, and its camera, with the time it was taken."""
        image_format = self._settings.image_format
        if image_format is None:
            return []
        topic = "/camera/image" if image_format == "raw" else "/camera/image/compressed"
        return [
            self._out(topic, image_message(frame, t_s, self._names.camera, image_format), t_s),
            self._out("/camera/camera_info", camera_info(self._camera, t_s, self._names.camera), t_s),
        ]

    def of_look(self, view: View, t_s: float) -> Iterator[Outgoing]:
        """Tell what a frame shows, with the time it was taken; each message is made when it is asked for."""
        if isinstance(view.pose, PoseEstimate):
            yield self._out("/vision/pose_with_covariance", self._pose(view.pose, t_s), t_s)
        believed = view.pose if view.belief is None else view.belief.pose
        if isinstance(believed, PoseEstimate):
            yield self._out("/pose_with_covariance", self._pose(believed, t_s), t_s)
        yield from self._transforms(view, believed if isinstance(believed, PoseEstimate) else None, t_s)
        yield from self._surroundings(view, t_s)
        if view.belief is not None:
            yield self._out("/tracks", self._tracks(view.belief.tracks, t_s), t_s)
            picture = view.belief.free_map
            # time may begin anew
            if picture is not None and not 0.0 <= t_s - self._map_s < self._settings.map_period_s:
                self._map_s = t_s
                yield self._out("/map", occupancy_grid(picture, t_s, self._names.map), t_s)

    def of_command(self, command: SteeringCommand | tuple[float, float, float], t_s: float) -> list[Outgoing]:
        """Tell a command as geometry_msgs/TwistStamped, robot frame: of `Steering`, or (x, y m/s, radians a second)."""
        if isinstance(command, SteeringCommand):
            forward, left, turn = float(command.velocity_mps[0]), float(command.velocity_mps[1]), 0.0
        else:
            forward, left, turn = command
        message = make("geometry_msgs/msg/TwistStamped", header(t_s, self._names.robot), _twist(forward, left, turn))
        return [self._out("/cmd_vel", message, t_s)]

    def of_truth(self, robot: Pose2, t_s: float, ball_m: tuple[float, float] | None = None) -> list[Outgoing]:
        """Tell the true pose on ``/truth/pose`` and the true ball on ``/truth/ball``, field frame."""
        pose = make("geometry_msgs/msg/PoseStamped", header(t_s, self._names.map), pose_message(robot))
        out = [self._out("/truth/pose", pose, t_s)]
        if ball_m is not None:
            point = _point(*ball_m, self._field.ball_radius_m)
            message = make("geometry_msgs/msg/PointStamped", header(t_s, self._names.map), point)
            out.append(self._out("/truth/ball", message, t_s))
        return out

    def _out(self, topic: str, message: Any, t_s: float) -> Outgoing:
        return Outgoing(self._settings.prefix + topic, message, t_s)

    def _pose(self, estimate: PoseEstimate, t_s: float) -> Any:
        return make(
            "geometry_msgs/msg/PoseWithCovarianceStamped", header(t_s, self._names.map), _with_covariance(estimate)
        )

    def _transforms(self, view: View, believed: PoseEstimate | None, t_s: float) -> list[Outgoing]:
        transforms = []
        if believed is not None:
            map_to_odom = believed.pose.compose(self._odom.inverse())
            transforms.append(_transform(map_to_odom, self._names.map, self._names.odom, t_s))
        if self._is_own_odom:
            transforms.append(_transform(self._odom, self._names.odom, self._names.robot, t_s))
        out = []
        camera = camera_transform(view.camera, self._names, t_s) if self._settings.camera_transform else None
        if camera is not None and self._pans:
            transforms.append(camera)
        elif camera is not None and not self._static_sent:
            self._static_sent = True
            out.append(Outgoing("/tf_static", make("tf2_msgs/msg/TFMessage", [camera]), t_s))
        if transforms:
            out.append(Outgoing("/tf", make("tf2_msgs/msg/TFMessage", transforms), t_s))
        return out

    @property
    def _pans(self) -> bool:
        return isinstance(self._camera, PinholeCamera)

    def _surroundings(self, view: View, t_s: float) -> Iterator[Outgoing]:
        here = header(t_s, self._names.robot)
        if len(view.free_space.range_m) > 1:
            yield self._out("/scan", self._scan(view, t_s), t_s)
        confidence = make("soccer_vision_attribute_msgs/msg/Confidence", _UNKNOWN_CONFIDENCE)
        balls = []
        for ball in view.balls:
            center = _point(ball.x_m, ball.y_m, self._field.ball_radius_m)
            balls.append(make("soccer_vision_3d_msgs/msg/Ball", center, confidence))
        yield self._out("/balls", make("soccer_vision_3d_msgs/msg/BallArray", here, balls), t_s)
        obstacles = []
        for thing in view.obstacles:
            heading = pose_message(Pose2(thing.x_m, thing.y_m, thing.bearing_rad))
            # its depth is not seen: as deep as it is wide, a robot's height unknown
            size = make("geometry_msgs/msg/Vector3", thing.width_m, thing.width_m, 0.0)
            box = make("vision_msgs/msg/BoundingBox3D", heading, size)
            obstacles.append(make("soccer_vision_3d_msgs/msg/Obstacle", box, confidence))
        yield self._out("/obstacles", make("soccer_vision_3d_msgs/msg/ObstacleArray", here, obstacles), t_s)
        points = [_point(x, y, 0.0) for x, y in boundary_m(view).tolist()]
        message = make("soccer_vision_3d_msgs/msg/FieldBoundary", here, points, confidence)
        yield self._out("/field_boundary", message, t_s)
        in_image = header(t_s, self._names.camera)
        message = make(
            "soccer_vision_2d_msgs/msg/BallArray", in_image, [self._ball_in_image(ball, view) for ball in view.balls]
        )
        yield self._out("/balls_in_image", message, t_s)
        if self._settings.markings:
            yield from self._markings(view.markings, t_s)
        edge_px = view.boundary_px
        shown = [make("vision_msgs/msg/Point2D", u, v) for u, v in edge_px[np.isfinite(edge_px).all(axis=1)].tolist()]
        message = make("soccer_vision_2d_msgs/msg/FieldBoundary", in_image, shown, confidence)
        yield self._out("/field_boundary_in_image", message, t_s)

    def _markings(self, markings: Markings, t_s: float) -> Iterator[Outgoing]:
        here = header(t_s, self._names.robot)
        confidence = make("soccer_vision_attribute_msgs/msg/Confidence", _UNKNOWN_CONFIDENCE)
        ellipses = [
            make(
                "soccer_vision_3d_msgs/msg/MarkingEllipse",
                2 * circle.radius_m,
                pose_message(Pose2(circle.x_m, circle.y_m, 0.0)),
                confidence,
            )
            for circle in markings.circles
        ]
        ellipses += [
            make(
                "soccer_vision_3d_msgs/msg/MarkingEllipse",
                self._field.marks[0].size_m,
                pose_message(Pose2(mark.x_m, mark.y_m, 0.0)),
                confidence,
            )
            for mark in markings.penalty_marks
        ]
        crossings = []
        for crossing in markings.crossings:
            rays = [make("geometry_msgs/msg/Vector3", math.cos(arm), math.sin(arm), 0.0) for arm in crossing.arms_rad]
            center = _point(crossing.x_m, crossing.y_m, 0.0)
            message = make("soccer_vision_3d_msgs/msg/MarkingIntersection", center, len(rays), rays, confidence)
            crossings.append(message)
        segments = [
            make(
                "soccer_vision_3d_msgs/msg/MarkingSegment",
                _point(*segment.start_m, 0.0),
                _point(*segment.end_m, 0.0),
                confidence,
            )
            for segment in markings.segments
        ]
        message = make("soccer_vision_3d_msgs/msg/MarkingArray", here, ellipses, crossings, segments)
        yield self._out("/markings", message, t_s)
        posts = [self._goalpost(post, confidence) for post in markings.posts]
        yield self._out("/goalposts", make("soccer_vision_3d_msgs/msg/GoalpostArray", here, posts), t_s)

    def _goalpost(self, post: Post, confidence: Any) -> Any:
        goal = next(goal for goal in self._field.goals if goal.kind == "posts")
        # the middle of the post
        center = make(
            "geometry_msgs/msg/Pose",
            _point(post.x_m, post.y_m, goal.height_m / 2),
            make("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0),
        )
        size = make("geometry_msgs/msg/Vector3", 2 * goal.post_radius_m, 2 * goal.post_radius_m, goal.height_m)
        side, team = 0, 0
        if post.feature_m is not None:
            x, y = post.feature_m
            # as one sees it who faces the goal
            side = _LEFT if (y > 0) == (x > 0) else _RIGHT
            team = _OPPONENT if x > 0 else _OWN
        attributes = make("soccer_vision_attribute_msgs/msg/Goalpost", side, team)
        box = make("vision_msgs/msg/BoundingBox3D", center, size)
        return make("soccer_vision_3d_msgs/msg/Goalpost", box, attributes, confidence)

    def _ball_in_image(self, ball: Ball, view: View) -> Any:
        box_px = np.array([ball.u_px, ball.v_px, 0.0, 0.0])
        if is_placed(view.camera):
            outline = view.camera.point_to_pixel(
                sphere_outline((ball.x_m, ball.y_m, self._field.ball_radius_m), self._field.ball_radius_m, view.camera)
            )
            if np.isfinite(outline).all():
                low, high = outline.min(axis=0), outline.max(axis=0)
                box_px = np.concatenate([(low + high) / 2, high - low])
        u, v, width, height = box_px.tolist()
        box = make("vision_msgs/msg/Pose2D", make("vision_msgs/msg/Point2D", u, v), 0.0)
        return make(
            "soccer_vision_2d_msgs/msg/Ball",
            make("vision_msgs/msg/BoundingBox2D", box, width, height),
            make("vision_msgs/msg/Point2D", ball.u_px, ball.v_px),
            make("soccer_vision_attribute_msgs/msg/Confidence", _UNKNOWN_CONFIDENCE),
        )

    def _scan(self, view: View, t_s: float) -> Any:
        bearing, ranges = view.free_space.bearing_rad, view.free_space.range_m
        step = float(bearing[-1] - bearing[0]) / (len(bearing) - 1)
        reach = math.inf if view.grid is None else float(view.grid.ring_bounds_m[-1])
        # REP-117: nothing in reach is +inf
        shown = np.where(ranges >= reach - 1e-9, np.inf, ranges).astype(np.float32)
        return make(
            "sensor_msgs/msg/LaserScan",
            header(t_s, self._names.robot),
            float(bearing[0]),
            float(bearing[-1]),
            step,
            0.0,
            0.0,
            0.0,
            reach,
            shown,
            np.empty(0, dtype=np.float32),
        )

    def _tracks(self, tracks: tuple[Track, ...], t_s: float) -> Any:
        followed = []
        for track in tracks:
            place, speed = np.zeros((6, 6)), np.zeros((6, 6))
            place[:2, :2], speed[:2, :2] = track.covariance[:2, :2], track.covariance[2:, 2:]
            pose = pose_message(Pose2(track.x_m, track.y_m, math.atan2(track.vy_mps, track.vx_mps)))
            followed.append(
                make(
                    "soccer_model_msgs/msg/Obstacle",
                    make("geometry_msgs/msg/PoseWithCovariance", pose, place.ravel()),
                    make("geometry_msgs/msg/TwistWithCovariance", _twist(track.vx_mps, track.vy_mps), speed.ravel()),
                )
            )
        return make("soccer_model_msgs/msg/ObstacleArray", header(t_s, self._names.map), followed)


def boundary_m(view: View) -> FloatArray:
    """(N, 2) float64: the floor's edge as the frame shows it, robot frame, metres, where there is one."""
    if view.polar is None:
        return np.empty((0, 2))
    floor = view.camera.pixel_to_floor(view.boundary_px)
    return np.asarray(floor[np.isfinite(floor).all(axis=1)])


def occupancy_grid(picture: MapPicture, t_s: float, frame_id: str) -> Any:
    """Return a map as nav_msgs/OccupancyGrid: free 0, occupied 100, undecided -1; its rows run along x."""
    values = np.array([0, 100, -1], dtype=np.int8)
    # ours has its first index along x, ROS's rows are along y
    data = values[picture.state].T.ravel()
    rows, columns = picture.state.T.shape
    origin = make(
        "geometry_msgs/msg/Pose",
        _point(*picture.corner_m, 0.0),
        make("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0),
    )
    at = header(t_s, frame_id)
    info = make("nav_msgs/msg/MapMetaData", at.stamp, picture.cell_m, columns, rows, origin)
    return make("nav_msgs/msg/OccupancyGrid", at, info, np.ascontiguousarray(data))


def is_placed(camera: OmniCamera | PinholeCamera) -> bool:
    """Whether it is known where the camera is on the robot, and how it is turned."""
    return camera.known_orientation if isinstance(camera, PinholeCamera) else camera.height_m is not None


def sphere_outline(
    center_m: tuple[float, float, float], radius_m: float, camera: OmniCamera | PinholeCamera
) -> FloatArray:
    """(16, 3) float64: points on the circle of a sphere that a camera sees as its outline, robot frame."""
    center = np.array(center_m)
    away = center - camera.viewpoint_m
    distance_m = float(np.linalg.norm(away))
    # from inside there is no outline
    ratio = min(radius_m / max(distance_m, 1e-9), 1.0)
    across = np.linalg.svd((away / max(distance_m, 1e-9))[None])[2][1:]
    turn = np.linspace(0.0, 2 * math.pi, 16, endpoint=False)
    circle = np.cos(turn)[:, None] * across[0] + np.sin(turn)[:, None] * across[1]
    return np.asarray(center - ratio * ratio * away + radius_m * math.sqrt(1.0 - ratio * ratio) * circle)


def camera_transform(camera: OmniCamera | PinholeCamera, names: FrameNames, t_s: float) -> Any:
    """Return the transform from the robot to the camera's optical frame; None where the tilt or height is unknown."""
    if not is_placed(camera):
        return None
    x, y, z = camera.viewpoint_m.tolist()
    body_to_robot = np.asarray(camera.camera_to_robot)
    # a mirror camera looks straight up; its optical frame's z is the mirror's axis
    optical_to_body = _OPTICAL_TO_BODY if isinstance(camera, PinholeCamera) else np.eye(3)
    return make(
        "geometry_msgs/msg/TransformStamped",
        header(t_s, names.robot),
        names.camera,
        make(
            "geometry_msgs/msg/Transform",
            make("geometry_msgs/msg/Vector3", x, y, z),
            make("geometry_msgs/msg/Quaternion", *_quaternion(body_to_robot @ optical_to_body)),
        ),
    )


def pose_message(pose: Pose2) -> Any:
    """Return a pose in the plane as geometry_msgs/Pose."""
    half = pose.theta_rad / 2
    turn = make("geometry_msgs/msg/Quaternion", 0.0, 0.0, math.sin(half), math.cos(half))
    return make("geometry_msgs/msg/Pose", _point(pose.x_m, pose.y_m, 0.0), turn)


def covariance_6x6(covariance: FloatArray) -> FloatArray:
    """(36,) float64, row-major (x, y, z, about x, y, z), of a (3, 3) one of (x, y, heading)."""
    full = np.diag(np.full(6, _FLAT_VARIANCE))
    places = [0, 1, 5]
    full[np.ix_(places, places)] = covariance
    return full.ravel()


def covariance_3x3(covariance: Any) -> FloatArray:
    """(3, 3) float64 of (x, y, heading), of ROS' 36 numbers."""
    places = [0, 1, 5]
    return np.asarray(covariance, dtype=np.float64).reshape(6, 6)[np.ix_(places, places)]


def _with_covariance(estimate: PoseEstimate) -> Any:
    return make(
        "geometry_msgs/msg/PoseWithCovariance", pose_message(estimate.pose), covariance_6x6(estimate.covariance)
    )


def _transform(pose: Pose2, parent: str, child: str, t_s: float) -> Any:
    half = pose.theta_rad / 2
    return make(
        "geometry_msgs/msg/TransformStamped",
        header(t_s, parent),
        child,
        make(
            "geometry_msgs/msg/Transform",
            make("geometry_msgs/msg/Vector3", pose.x_m, pose.y_m, 0.0),
            make("geometry_msgs/msg/Quaternion", 0.0, 0.0, math.sin(half), math.cos(half)),
        ),
    )


def _point(x: float, y: float, z: float) -> Any:
    return make("geometry_msgs/msg/Point", x, y, z)


def _twist(forward: float, left: float, turn: float = 0.0) -> Any:
    return make(
        "geometry_msgs/msg/Twist",
        make("geometry_msgs/msg/Vector3", forward, left, 0.0),
        make("geometry_msgs/msg/Vector3", 0.0, 0.0, turn),
    )


def _quaternion(rotation: FloatArray) -> tuple[float, float, float, float]:
    """(x, y, z, w) of a rotation (3, 3), by its largest component, which is never near zero."""
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
    """Return where something is, and the direction of its x axis.

    Returns
    -------
    (float, float, float or None)
        x and y; the heading, None where the orientation is no rotation: not finite, or 0, 0, 0, 0.

    Raises
    ------
    PacketError
        If the position is not finite, or position and orientation are 0 alike: nobody has filled them in.
    """
    x_m, y_m, z_m = float(position.x), float(position.y), float(position.z)
    if not all(map(math.isfinite, (x_m, y_m, z_m))):
        raise PacketError(f"the position is not finite ({x_m:g}, {y_m:g}, {z_m:g})")
    heading_rad = heading_of(orientation)
    if heading_rad is None and x_m == y_m == z_m == 0.0:
        raise PacketError("position and orientation are all 0")
    return x_m, y_m, heading_rad


def heading_of(orientation: Any) -> float | None:
    """Return the direction of the x axis that a geometry_msgs/Quaternion turns; None where it is no rotation."""
    x, y, z, w = (float(getattr(orientation, name)) for name in "xyzw")
    norm = math.hypot(x, y, z, w)
    if not math.isfinite(norm) or norm < _MIN_NORM:
        return None
    return math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def pose_of(message: Any) -> Pose2:
    """Return the pose in the plane of a geometry_msgs/Pose: its place, and its x axis' direction.

    Raises
    ------
    PacketError
        If it is not finite, or its orientation is no rotation.
    """
    x_m, y_m, heading_rad = place_of(message.position, message.orientation)
    if heading_rad is None:
        q = message.orientation
        raise PacketError(f"the orientation {q.x:g}, {q.y:g}, {q.z:g}, {q.w:g} is no rotation")
    return Pose2(x_m, y_m, heading_rad)

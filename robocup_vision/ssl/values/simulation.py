"""Messages of a league simulator's control: placing objects, settings, robot commands and feedback.

A field that is None is omitted from the message, and the simulator keeps its present value.
"""

from __future__ import annotations

import math
from typing import Annotated

from robocup_vision.ssl.protocol.mapping import Message, OpenEnum, Wire, message_value
from robocup_vision.ssl.values.detection import DetectionFrame
from robocup_vision.ssl.values.geometry import Geometry

DEGREES_PER_RAD = math.degrees(1.0)
RPM_PER_RPS = 60 / math.tau
# type URL of a `RobotMotion` in a feedback's `custom`
MOTION_TYPE = "robocup_vision/RobotMotion"


class Team(OpenEnum):
    """The teams."""

    UNKNOWN = 0
    YELLOW = 1
    BLUE = 2


@message_value("simulation.Any")
class AnyMessage(Message):
    """A message of a type that only some programs know: the type's name, and the bytes."""

    type_url: Annotated[str | None, Wire(1)] = None
    value: Annotated[bytes | None, Wire(2)] = None

    @property
    def kind(self) -> str:
        """Name of the message without its package."""
        return (self.type_url or "").rpartition("/")[2].rpartition(".")[2]


@message_value("simulation.RobotId")
class RobotId(Message):
    """A robot's number and team."""

    number: Annotated[int | None, Wire(1, "id")] = None
    team: Annotated[Team | None, Wire(2)] = None


@message_value("simulation.SimulatorError")
class SimulatorError(Message):
    """An error of a simulator: a code for programs, a message for people."""

    code: Annotated[str | None, Wire(1)] = None
    message: Annotated[str | None, Wire(2)] = None


@message_value("simulation.RobotLimits")
class LeagueRobotLimits(Message):
    """Greatest accelerations, decelerations, speed and turning rate of robots."""

    speed_up_mps2: Annotated[float | None, Wire(1, "acc_speedup_absolute_max")] = None
    turn_speed_up_rps2: Annotated[float | None, Wire(2, "acc_speedup_angular_max")] = None
    brake_mps2: Annotated[float | None, Wire(3, "acc_brake_absolute_max")] = None
    turn_brake_rps2: Annotated[float | None, Wire(4, "acc_brake_angular_max")] = None
    speed_mps: Annotated[float | None, Wire(5, "vel_absolute_max")] = None
    turn_rps: Annotated[float | None, Wire(6, "vel_angular_max")] = None


@message_value("simulation.RobotWheelAngles")
class WheelAngles(Message):
    """Directions of a robot's wheels from its centre, counter-clockwise from straight ahead."""

    front_right_rad: Annotated[float, Wire(1, "front_right")]
    back_right_rad: Annotated[float, Wire(2, "back_right")]
    back_left_rad: Annotated[float, Wire(3, "back_left")]
    front_left_rad: Annotated[float, Wire(4, "front_left")]


@message_value("simulation.RobotSpecs")
class RobotSpecs(Message):
    """The specification of one robot."""

    robot: Annotated[RobotId, Wire(1, "id")]
    radius_m: Annotated[float | None, Wire(2, "radius")] = None
    height_m: Annotated[float | None, Wire(3, "height")] = None
    mass_kg: Annotated[float | None, Wire(4, "mass")] = None
    max_kick_mps: Annotated[float | None, Wire(7, "max_linear_kick_speed")] = None
    max_chip_mps: Annotated[float | None, Wire(8, "max_chip_kick_speed")] = None
    center_to_dribbler_m: Annotated[float | None, Wire(9, "center_to_dribbler")] = None
    limits: Annotated[LeagueRobotLimits | None, Wire(10)] = None
    wheel_angles: Annotated[WheelAngles | None, Wire(13)] = None
    custom: Annotated[tuple[AnyMessage, ...], Wire(14)] = ()


@message_value("simulation.RealismConfig")
class RealismConfig(Message):
    """The realism of a simulator (noise, delays, losses), in messages of its own type."""

    custom: Annotated[tuple[AnyMessage, ...], Wire(1)] = ()


@message_value("simulation.RealismConfigErForce")
class ErForceRealism(Message):
    """The realism settings of the ER-Force simulator; losses are fractions, times nanoseconds."""

    ball_std_m: Annotated[float | None, Wire(1, "stddev_ball_p")] = None
    robot_std_m: Annotated[float | None, Wire(2, "stddev_robot_p")] = None
    robot_std_rad: Annotated[float | None, Wire(3, "stddev_robot_phi")] = None
    ball_area_std_px: Annotated[float | None, Wire(4, "stddev_ball_area")] = None
    enable_invisible_ball: Annotated[bool | None, Wire(5)] = None
    ball_visibility_threshold: Annotated[float | None, Wire(6)] = None
    camera_overlap_m: Annotated[float | None, Wire(7, "camera_overlap")] = None
    dribbler_ball_detections: Annotated[float | None, Wire(8)] = None
    camera_position_error_m: Annotated[float | None, Wire(9, "camera_position_error")] = None
    robot_command_loss: Annotated[float | None, Wire(10)] = None
    robot_response_loss: Annotated[float | None, Wire(11)] = None
    missing_ball_detections: Annotated[float | None, Wire(12)] = None
    vision_delay_ns: Annotated[int | None, Wire(13, "vision_delay", kind="int64")] = None
    vision_processing_ns: Annotated[int | None, Wire(14, "vision_processing_time", kind="int64")] = None
    simulate_dribbling: Annotated[bool | None, Wire(15)] = None


@message_value("simulation.RobotSpecErForce")
class ErForceRobotSpec(Message):
    """A robot's data of the ER-Force simulator beyond the league's fields."""

    shoot_radius_m: Annotated[float | None, Wire(1, "shoot_radius")] = None
    dribbler_width_m: Annotated[float | None, Wire(3, "dribbler_width")] = None


@message_value("simulation.SimulatorConfig")
class SimulatorConfig(Message):
    """Settings of a simulator."""

    geometry: Annotated[Geometry | None, Wire(1)] = None
    robot_specs: Annotated[tuple[RobotSpecs, ...], Wire(2)] = ()
    realism: Annotated[RealismConfig | None, Wire(3, "realism_config")] = None
    vision_port: Annotated[int | None, Wire(4)] = None


@message_value("simulation.TeleportBall")
class TeleportBall(Message):
    """A new position and velocity of the ball; `roll`: it rolls at once instead of sliding first."""

    x_m: Annotated[float | None, Wire(1, "x")] = None
    y_m: Annotated[float | None, Wire(2, "y")] = None
    z_m: Annotated[float | None, Wire(3, "z")] = None
    vx_mps: Annotated[float | None, Wire(4, "vx")] = None
    vy_mps: Annotated[float | None, Wire(5, "vy")] = None
    vz_mps: Annotated[float | None, Wire(6, "vz")] = None
    teleport_safely: Annotated[bool | None, Wire(7)] = None
    roll: Annotated[bool | None, Wire(8)] = None
    by_force: Annotated[bool | None, Wire(9)] = None


@message_value("simulation.TeleportRobot")
class TeleportRobot(Message):
    """A new pose and velocity of a robot, and whether it is on the field at all."""

    robot: Annotated[RobotId, Wire(1, "id")]
    x_m: Annotated[float | None, Wire(2, "x")] = None
    y_m: Annotated[float | None, Wire(3, "y")] = None
    orientation_rad: Annotated[float | None, Wire(4, "orientation")] = None
    vx_mps: Annotated[float | None, Wire(5, "v_x")] = None
    vy_mps: Annotated[float | None, Wire(6, "v_y")] = None
    turn_rps: Annotated[float | None, Wire(7, "v_angular")] = None
    present: Annotated[bool | None, Wire(8)] = None
    by_force: Annotated[bool | None, Wire(9)] = None


@message_value("simulation.SimulatorControl")
class SimulatorControl(Message):
    """Placing of ball and robots, and the speed of simulated time (1: real time)."""

    ball: Annotated[TeleportBall | None, Wire(1, "teleport_ball")] = None
    robots: Annotated[tuple[TeleportRobot, ...], Wire(2, "teleport_robot")] = ()
    speed: Annotated[float | None, Wire(3, "simulation_speed")] = None


@message_value("simulation.SimulatorCommand")
class SimulatorCommand(Message):
    """One datagram to a simulator's control port."""

    control: Annotated[SimulatorControl | None, Wire(1)] = None
    config: Annotated[SimulatorConfig | None, Wire(2)] = None


@message_value("simulation.SimulatorResponse")
class SimulatorResponse(Message):
    """A simulator's answer; a command without errors need not be answered."""

    errors: Annotated[tuple[SimulatorError, ...], Wire(1)] = ()


@message_value("simulation.MoveWheelVelocity")
class WheelVelocities(Message):
    """Speeds of the wheels' rims, metres per second."""

    front_right_mps: Annotated[float, Wire(1, "front_right")]
    back_right_mps: Annotated[float, Wire(2, "back_right")]
    back_left_mps: Annotated[float, Wire(3, "back_left")]
    front_left_mps: Annotated[float, Wire(4, "front_left")]


@message_value("simulation.MoveLocalVelocity")
class LocalVelocity(Message):
    """Velocity in the robot frame."""

    forward_mps: Annotated[float, Wire(1, "forward")]
    left_mps: Annotated[float, Wire(2, "left")]
    turn_rps: Annotated[float, Wire(3, "angular")]


@message_value("simulation.MoveGlobalVelocity")
class GlobalVelocity(Message):
    """Velocity in the field frame."""

    x_mps: Annotated[float, Wire(1, "x")]
    y_mps: Annotated[float, Wire(2, "y")]
    turn_rps: Annotated[float, Wire(3, "angular")]


@message_value("simulation.RobotMoveCommand")
class MoveCommand(Message):
    """A robot's commanded velocity, in one of three forms."""

    wheels: Annotated[WheelVelocities | None, Wire(1, "wheel_velocity")] = None
    local: Annotated[LocalVelocity | None, Wire(2, "local_velocity")] = None
    world: Annotated[GlobalVelocity | None, Wire(3, "global_velocity")] = None


@message_value("simulation.RobotCommand")
class RobotCommand(Message):
    """A command to one robot; a `kick_angle_rad` above 0 chips the ball at that angle."""

    number: Annotated[int, Wire(1, "id")]
    move: Annotated[MoveCommand | None, Wire(2, "move_command")] = None
    kick_mps: Annotated[float | None, Wire(3, "kick_speed")] = None
    kick_angle_rad: Annotated[float | None, Wire(4, "kick_angle", DEGREES_PER_RAD)] = None
    dribbler_rps: Annotated[float | None, Wire(5, "dribbler_speed", RPM_PER_RPS)] = None


@message_value("simulation.RobotControl")
class RobotControl(Message):
    """One datagram to a team's robots."""

    commands: Annotated[tuple[RobotCommand, ...], Wire(1, "robot_commands")] = ()


@message_value("simulation.RobotFeedback")
class RobotFeedback(Message):
    """Feedback of one robot."""

    number: Annotated[int, Wire(1, "id")]
    ball_contact: Annotated[bool | None, Wire(2, "dribbler_ball_contact")] = None
    custom: Annotated[AnyMessage | None, Wire(3)] = None


@message_value("simulation.RobotMotion")
class RobotMotion(Message):
    """The velocity of a robot of this project's simulator, robot frame; in the `custom` of its feedback."""

    forward_mps: Annotated[float | None, Wire(1, "forward")] = None
    left_mps: Annotated[float | None, Wire(2, "left")] = None
    turn_rps: Annotated[float | None, Wire(3, "angular")] = None


@message_value("simulation.RobotControlResponse")
class RobotControlResponse(Message):
    """The answer of a team's robots."""

    errors: Annotated[tuple[SimulatorError, ...], Wire(1)] = ()
    feedback: Annotated[tuple[RobotFeedback, ...], Wire(2)] = ()


@message_value("simulation.SimulationSyncRequest")
class SyncRequest(Message):
    """Asks a simulator to advance by `step_s` and to answer with the detections."""

    step_s: Annotated[float | None, Wire(1, "sim_step")] = None
    command: Annotated[SimulatorCommand | None, Wire(2, "simulator_command")] = None
    robot_control: Annotated[RobotControl | None, Wire(3)] = None


@message_value("simulation.SimulationSyncResponse")
class SyncResponse(Message):
    """The detections after the step, and the robots' answer."""

    detections: Annotated[tuple[DetectionFrame, ...], Wire(1, "detection")] = ()
    robots: Annotated[RobotControlResponse | None, Wire(2, "robot_control_response")] = None

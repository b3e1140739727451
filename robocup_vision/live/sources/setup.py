"""Robot and `Vision` of sources that know nothing themselves: by the options of the command."""

from __future__ import annotations

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.camera import OmniCamera, PinholeCamera, load_camera
from robocup_vision.live.handover.moment import RobotSetup
from robocup_vision.live.sources.source import SourceOptions
from robocup_vision.mapping.view_motion import ViewMotion
from robocup_vision.memory import Memory
from robocup_vision.perception.color_table import load_colors
from robocup_vision.vision import Vision


def setup_by_options(name: str, options: SourceOptions) -> RobotSetup:
    """Return a robot's setup.

    Raises
    ------
    ArgumentError
        If no field is named.
    FileError
        If a file is wrong.
    """
    if options.field is None:
        raise ArgumentError(f"{name}: does not say on which field it is, so --field must be given")
    field = load_field(options.field)
    camera = None if options.camera is None else load_camera(options.camera)
    return RobotSetup(name, field, camera, field.robot_radius_m)


def vision_by_options(setup: RobotSetup, options: SourceOptions, *, has_odometry: bool) -> Vision | None:
    """Return what looks at a robot's frames; None without a camera file.

    Raises
    ------
    ArgumentError
        If a memory is wanted and nothing tells how the robot moves.
    """
    if setup.camera is None:
        return None
    memory = memory_for(setup, setup.camera, has_odometry=has_odometry) if options.memory else None
    colors = None if options.colors is None else load_colors(options.colors)
    return Vision(setup.field, setup.camera, colors, method=options.method, memory=memory)


def memory_for(setup: RobotSetup, camera: OmniCamera | PinholeCamera, *, has_odometry: bool) -> Memory:
    """Return a memory of everything that goes by odometry, or where there is none by the motion between views.

    Raises
    ------
    ArgumentError
        If neither tells how the robot moves.
    """
    memory = Memory.of_everything(setup.field)
    if not has_odometry:
        if isinstance(camera, PinholeCamera):
            raise ArgumentError(
                f"{setup.name}: --memory needs odometry (a recording, or a dataset with frames.csv) or a mirror camera"
            )
        memory.ego_motion = ViewMotion()
    return memory

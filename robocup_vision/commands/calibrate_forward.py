"""`robocup-vision calibrate forward`: its options and its handler."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING, Any

from robocup_vision.commands.calibrate_options import add_calibration_options, start_trials
from robocup_vision.commands.options import NEGATIVE_ANGLE, angle

if TYPE_CHECKING:
    from robocup_vision.calibration.forward.calibrate import ForwardCalibration
    from robocup_vision.calibration.forward.starts import KnownOfCamera
    from robocup_vision.camera import PinholeCamera


def add_forward_parser(kinds: Any) -> None:
    """Add `forward` to the kinds of calibration."""
    forward: argparse.ArgumentParser = kinds.add_parser(
        "forward",
        help="a forward camera's lens, height, tilt and roll, pinhole or fisheye",
        description="Calibrate a camera that looks ahead by pictures of lines, goals and walls: focal length, "
        "distortion and centre of its lens, height, tilt and roll where they are the same in all. Ten to thirty "
        "pictures from different places and headings are enough. What is known of the camera makes it quick; "
        "angles are in radians, or in degrees such as -15deg.",
    )
    forward._negative_number_matcher = NEGATIVE_ANGLE
    add_calibration_options(forward, "camera file to write (.toml)")
    add = forward.add_argument
    add("--poses", metavar="CSV", help="roughly where the camera was: image,x_m,y_m,theta_rad")
    add("--model", choices=("pinhole", "fisheye"), help="of the lens, without --start (default: pinhole)")
    add("--view", type=angle, metavar="A", help="its horizontal field of view, to a tenth")
    add("--height", type=float, metavar="M", help="of the lens over the floor, to a tenth")
    add("--tilt", type=angle, metavar="A", help="of the optical axis, to 3 degrees; looking down is negative")
    forward.set_defaults(run=run_calibrate_forward)


def run_calibrate_forward(args: argparse.Namespace) -> int:
    """Calibrate a forward camera, write its file, and print its uncertainty; return the exit status."""
    from field_models import load_field
    from robocup_vision.calibration.forward.calibrate import calibrate_forward
    from robocup_vision.calibration.not_calibrated import NotCalibrated
    from robocup_vision.camera import PinholeCamera, save_camera
    from robocup_vision.files.csv_table import read_poses
    from robocup_vision.files.image_folder import ImageFiles
    from robocup_vision.files.output_folder import require_folder

    field = load_field(args.field)
    start = _start(args)
    require_folder(args.out)
    images = ImageFiles(args.images, start.size_px if isinstance(start, PinholeCamera) else None)
    for note in images.notes:
        print(f"note: {note}")
    poses = None if args.poses is None else read_poses(args.poses, images.names)
    with start_trials(args, images.paths) as trials:
        result = calibrate_forward(
            field, images, start, names=images.names, poses=poses, max_frames=args.frames, trials=trials
        )
    for note in result.notes:
        print(f"note: {note}")
    if isinstance(result, NotCalibrated):
        print(f"robocup-vision calibrate forward: not calibrated: {result.reason}", file=sys.stderr)
        return 2
    save_camera(result.camera, args.out)
    _print_calibration(result, len(images))
    print(f"camera file  {args.out}")
    return 0


def _start(args: argparse.Namespace) -> PinholeCamera | KnownOfCamera:
    from field_models.errors import ArgumentError, FileError
    from robocup_vision.calibration.forward.starts import KnownOfCamera
    from robocup_vision.camera import PinholeCamera, load_camera

    given = {name: value for name in ("model", "view", "height", "tilt") if (value := getattr(args, name)) is not None}
    if args.start is None:
        return KnownOfCamera(args.model or "pinhole", args.view, args.height, args.tilt)
    if given:
        raise ArgumentError(f"--{next(iter(given))} is not asked for with --start: the camera file says it")
    start = load_camera(args.start)
    if not isinstance(start, PinholeCamera):
        raise FileError(args.start, "is a mirror camera, must look ahead", key="model", value="omni")
    return start


def _print_calibration(result: ForwardCalibration, images: int) -> None:
    import math

    camera, std = result.camera, result.std
    print(f"calibrated by {len(result.frames)} of {images} images")
    percent = 100 * std["focal_px"] / camera.focal_px[0]
    print(f"  focal length {camera.focal_px[0]:.1f} +- {std['focal_px']:.1f} px ({percent:.1f} %)")
    (u, v), std_u, std_v = camera.center_px, std["center_u_px"], std["center_v_px"]
    print(f"  center       {u:.1f} +- {std_u:.1f}, {v:.1f} +- {std_v:.1f} px")
    for place, name in enumerate(name for name in ("k1", "k2") if name in std):
        print(f"  {name}           {camera.distortion[place]:+.4f} +- {std[name]:.4f}")
    print(f"  height       {camera.height_m:.3f} +- {std['height_m']:.3f} m")
    for name, value, sign in (("tilt", camera.tilt_rad, " (+ is up)"), ("roll", camera.roll_rad, "")):
        if value is not None and f"{name}_rad" in std:
            print(f"  {name}         {math.degrees(value):.2f} +- {math.degrees(std[f'{name}_rad']):.2f} deg{sign}")
    print(f"  edges in the images are off by {result.residual_px:.2f} px (root mean square)")
    if result.line_width_m is not None:
        print(f"  lines are {result.line_width_m:.3f} m wide by the images")
    print(f"  focal length and height are correlated by {result.correlation:+.2f}")

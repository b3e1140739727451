"""`robocup-vision calibrate pinhole`: its options, and what it does with them."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from robocup_vision.commands.calibrate_options import add_calibration_options, start_trials


def add_pinhole_parser(kinds: Any) -> None:
    """Add `pinhole` to the kinds of calibration."""
    pinhole: argparse.ArgumentParser = kinds.add_parser(
        "pinhole",
        help="a forward camera's focal length, height and tilt",
        description="Calibrate a pinhole camera by pictures of lines, goals and walls: focal length, height, and tilt "
        "where it is the same in all. Some ten pictures from different places are enough.",
    )
    add_calibration_options(pinhole, "camera file to write (.toml)")
    pinhole.add_argument("--poses", metavar="CSV", help="roughly where the camera was: image,x_m,y_m,theta_rad")
    pinhole.set_defaults(run=run_calibrate_pinhole)


def run_calibrate_pinhole(args: argparse.Namespace) -> int:
    """Calibrate a pinhole camera, write its file, and print its uncertainty; return the exit status.

    Raises
    ------
    RobocupVisionError
        For anything the user can mend.
    """
    import math

    from field_models import load_field
    from field_models.errors import FileError
    from robocup_vision.calibration.not_calibrated import NotCalibrated
    from robocup_vision.calibration.pinhole import calibrate_pinhole
    from robocup_vision.camera import PinholeCamera, load_camera, save_camera
    from robocup_vision.files.image_folder import ImageFiles
    from robocup_vision.files.out_file import require_folder
    from robocup_vision.files.pose_table import read_poses

    field = load_field(args.field)
    start = None if args.start is None else load_camera(args.start)
    if start is not None and not isinstance(start, PinholeCamera):
        raise FileError(args.start, "is a mirror camera, must be a pinhole camera", key="model", value="omni")
    require_folder(args.out)
    images = ImageFiles(args.images, None if start is None else start.size_px)
    for note in images.notes:
        print(f"note: {note}")
    poses = None if args.poses is None else read_poses(args.poses, images.names)
    with start_trials(args, images.paths) as trials:
        result = calibrate_pinhole(
            field, images, start, names=images.names, poses=poses, max_frames=args.frames, trials=trials
        )
    for note in result.notes:
        print(f"note: {note}")
    if isinstance(result, NotCalibrated):
        print(f"robocup-vision calibrate pinhole: not calibrated: {result.reason}", file=sys.stderr)
        return 2
    save_camera(result.camera, args.out)
    camera, std = result.camera, result.std
    lines = sum(frame.with_lines for frame in result.frames)
    print(f"calibrated by {len(result.frames)} of {len(images)} images, {lines} of them with lines")
    percent = 100 * std["focal_px"] / camera.focal_px[0]
    print(f"  focal length {camera.focal_px[0]:.1f} +- {std['focal_px']:.1f} px ({percent:.1f} %)")
    print(f"  height       {camera.height_m:.3f} +- {std['height_m']:.3f} m")
    if camera.tilt_rad is not None:
        print(
            f"  tilt         {math.degrees(camera.tilt_rad):.2f} +- {math.degrees(std['tilt_rad']):.2f} deg (+ is up)"
        )
    print(f"  focal length and height are correlated by {result.correlation:+.2f}")
    print(f"camera file  {args.out}")
    return 0

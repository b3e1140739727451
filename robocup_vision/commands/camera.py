"""`robocup-vision camera`: makes a camera file from a calibration by another program."""

from __future__ import annotations

import argparse
from typing import Any

from robocup_vision.commands.options import NEGATIVE_ANGLE, angle, size

_FORMATS = {
    "ros": "ROS' camera_info, as camera_calibration writes it",
    "opencv": "a calibration that OpenCV's FileStorage has written",
    "kalibr": "Kalibr's camchain",
}


def add_parser(subparsers: Any) -> None:
    """Add the command `camera` to the subparsers of an argparse parser."""
    parser = subparsers.add_parser("camera", help="make a camera file of a calibration by ROS, OpenCV or Kalibr")
    formats = parser.add_subparsers(dest="format", required=True, metavar="FORMAT")
    for name, text in _FORMATS.items():
        one = formats.add_parser(
            f"from-{name}",
            help=text,
            description=f"Make a camera file of {text} (YAML). Of the mounting, which such a file does not know, give"
            " what is known; angles are in radians, or in degrees such as -15deg.",
        )
        one._negative_number_matcher = NEGATIVE_ANGLE
        add = one.add_argument
        add("file", help="the calibration")
        add("--height", type=float, required=True, metavar="M", help="of the lens over the floor, metres")
        add("--tilt", type=angle, metavar="A", help="of the optical axis; looking down is negative; unknown: left out")
        add("--pan", type=angle, metavar="A", help="to the left is positive")
        add("--roll", type=angle, metavar="A", help="about the optical axis")
        add(
            "--offset",
            type=float,
            nargs=2,
            metavar=("X", "Y"),
            help="of the lens, forward and left of the robot's centre",
        )
        add("--size", type=size, metavar="WxH", help="of the images, where the file does not say")
        if name == "kalibr":
            add("--name", metavar="CAM", help="of several cameras in the file this one, such as cam0")
        add("--out", default="camera.toml", metavar="FILE", help="camera file to write (default: camera.toml)")
        one.set_defaults(run=run_camera, format=name)


def run_camera(args: argparse.Namespace) -> int:
    """Write a camera file; return 0."""
    from field_models.errors import ArgumentError
    from robocup_vision.camera import FisheyeCamera, Mounting, PinholeCamera, save_camera
    from robocup_vision.camera.files import check_pinhole
    from robocup_vision.camera.foreign_files import READERS

    named = {"name": args.name} if args.format == "kalibr" else {}
    lens = READERS[args.format](args.file, args.size, **named)
    given = {"pan_rad": args.pan, "tilt_rad": args.tilt, "roll_rad": args.roll, "height_m": args.height}
    try:
        mounting = Mounting(**given)
    except ArgumentError as error:
        raise ArgumentError(str(error).replace("a mounting's", "the camera's")) from None
    make = FisheyeCamera if lens.is_fisheye else PinholeCamera
    camera = make(
        lens.size_px,
        lens.focal_px,
        lens.center_px,
        args.height,
        distortion=lens.distortion,
        offset_m=(0.0, 0.0) if args.offset is None else tuple(args.offset),
    ).held(mounting)
    check_pinhole(args.file, camera)
    save_camera(camera, args.out)
    print(
        f"{args.out}: {lens.size_px[0]}x{lens.size_px[1]}, focal length {lens.focal_px[0]:.1f}, {lens.focal_px[1]:.1f}"
    )
    if args.tilt is None:
        print("its tilt is left open: a camera of known --tilt is located by lines and goals alike")
    return 0

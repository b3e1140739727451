"""`robocup-vision render`: its options and its handler."""

from __future__ import annotations

import argparse
import dataclasses
import math
from typing import Any, Literal

from robocup_vision.commands.options import add_worker_options, count, seed
from sim2d.commands.spelled import spelled

# names only, because parsing options must load neither the renderer nor NumPy, so that --help answers at once
CONDITION_NAMES = ("nominal", "noisy", "warm", "cold", "dark", "crowd", "bad_day", "miscalibrated")
# options that override values of a `Condition` without conversion
_OVERRIDES = {
    "robots": "robots",
    "obstacles": "obstacles",
    "noise": "noise_sigma",
    "blur": "blur_px",
    "vignette": "vignette",
    "light_gradient": "light_gradient",
    "cast": "cast_bgr",
    "gain": "gain",
    "center_offset": "center_offset_px",
    "texture": "texture",
    "shadow": "shadow",
    "highlights": "highlights",
    "jpeg": "jpeg_quality",
    "ball": "ball_rate",
}


def add_parser(subparsers: Any) -> argparse.ArgumentParser:
    """Add the command `render` to the subparsers of an argparse parser; `run_render` runs what it parses."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "render",
        help="write a dataset folder of rendered images of any camera with truth",
        description="Write a dataset folder of rendered images of any camera with truth. "
        "Options after --condition override its values.",
    )
    add = parser.add_argument
    add("--field", required=True, metavar="F", help="built-in field's name, or a field file (.toml)")
    add("--camera", required=True, metavar="C", help="a camera.toml, or sekimori, or sekimori:640x480")
    add("--count", type=count, default=100, metavar="N", help="number of images (default: 100)")
    add("--seed", type=seed, default=0, metavar="S", help="image i depends on S and i alone (default: 0)")
    add("--condition", choices=CONDITION_NAMES, default="nominal", help="what disturbs the images (default: nominal)")
    add("--robots", type=int, metavar="N", help="number of robots that stand on the field (default: none)")
    add("--obstacles", type=int, nargs=2, metavar=("LO", "HI"), help="smallest and greatest number of boxes")
    add("--noise", type=float, metavar="S", help="sensor noise, grey levels")
    add("--blur", type=float, metavar="PX", help="standard deviation of the blur, pixels")
    add("--vignette", type=float, metavar="V", help="fraction of light lost in the corners")
    add("--light-gradient", type=float, metavar="G", help="relative gain of light over half the field's length")
    add("--cast", type=float, nargs=3, metavar=("B", "G", "R"), help="colour cast as channel gains")
    add("--gain", type=float, metavar="G", help="overall gain")
    add("--tilt", type=float, nargs=2, metavar=("X", "Y"), help="true tilt minus the camera's, degrees")
    add("--center-offset", type=float, nargs=2, metavar=("DU", "DV"), help="true centre minus the camera's, pixels")
    add("--texture", type=float, metavar="A", help="carpet texture, relative amplitude")
    add("--shadow", action="store_true", default=None, help="a hard bluish shadow")
    add("--highlights", type=int, nargs="?", const=3, metavar="N", help="lamp reflections (without a number: 3)")
    add("--spin", type=float, metavar="DEG", help="turn during the exposure, degrees")
    add("--jpeg", type=int, metavar="Q", help="compress with halved chroma at quality 1 to 100")
    add("--ball", type=float, metavar="RATE", help="fraction of images with a ball, 0 to 1")
    add("--symmetry", choices=("none", "point"), help="how errors count (default: point)")
    add_worker_options(parser)
    add("out", metavar="OUT", help="folder to write; must be absent or empty")
    parser.set_defaults(run=run_render)
    return parser


def run_render(args: argparse.Namespace) -> int:
    """Render a dataset and print its folder; return the exit status."""
    from contextlib import closing
    from functools import partial

    from field_models import load_field
    from field_models.errors import FileError
    from robocup_vision.camera import PinholeCamera
    from robocup_vision.commands.options import chosen_workers
    from robocup_vision.progress import progress
    from robocup_vision.workers import in_order, run_pieces
    from sim2d.match.setups import setup_for
    from sim2d.rendering.cameras import camera_by_name
    from sim2d.rendering.dataset import DrawPictures, write_dataset
    from sim2d.rendering.random_scenes import CONDITIONS, sample

    given: dict[str, Any] = {}
    for option, name in _OVERRIDES.items():
        value = getattr(args, option)
        if value is not None:
            given[name] = tuple(value) if isinstance(value, list) else value
    if args.spin is not None:
        given["spin_rad"] = math.radians(args.spin)
    if args.tilt is not None:
        given["tilt_rad"] = tuple(map(math.radians, args.tilt))
    field, camera = load_field(args.field), camera_by_name(args.camera)
    if args.robots and not field.is_half:
        given["robot_height_m"] = setup_for(field).robot.limits.height_m
    condition = dataclasses.replace(CONDITIONS[args.condition], **given)

    if isinstance(camera, PinholeCamera) and not camera.known_orientation:
        raise FileError(args.camera, "is needed to render: where does the camera look?", key="tilt_rad")
    if camera.height_m is None:
        raise FileError(args.camera, "is needed to render what stands on the floor", key="viewpoint_height_m")
    symmetry: Literal["none", "point"] = args.symmetry or "point"
    start = DrawPictures(partial(sample, field, camera, condition, args.seed, args.count))
    with closing(in_order(run_pieces(start, range(args.count), chosen_workers(args)))) as drawn:
        count = write_dataset(
            args.out,
            args.field,
            camera,
            progress(drawn, args.count, "render"),
            symmetry=symmetry,
            command=spelled("render", args),
        )
    print(f"{count} images of {field.name} in {args.out}")
    return 0

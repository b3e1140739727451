"""`robocup-vision calibrate`: its options and its handler."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robocup_vision.commands.calibrate_colors import add_colors_parser
from robocup_vision.commands.calibrate_forward import add_forward_parser
from robocup_vision.commands.calibrate_options import add_calibration_options, start_trials

if TYPE_CHECKING:
    from field_models.field import Field
    from robocup_vision.calibration.omni.calibrate import OmniCalibration
    from robocup_vision.files.image_folder import ImageFiles

# largest number of overlay pictures
_MAX_PICTURES = 8
# points with a smaller residual count as agreeing, pixels
_AGREES_PX = 3.0


def add_parser(subparsers: Any) -> None:
    """Add the command `calibrate` to the subparsers of an argparse parser; every kind sets its own `run`."""
    parser = subparsers.add_parser(
        "calibrate",
        help="make camera and colour files from images of the field",
        description="Make camera and colour files from images of the field, taken anywhere on it.",
    )
    kinds = parser.add_subparsers(dest="kind", required=True, metavar="KIND")
    _add_omni_parser(kinds)
    add_colors_parser(kinds)
    add_forward_parser(kinds)


def _add_omni_parser(kinds: Any) -> None:
    omni: argparse.ArgumentParser = kinds.add_parser(
        "omni",
        help="a mirror camera's centre, tilt and curve",
        description="Calibrate a mirror camera: its centre, tilt and curve, from frames of the field with the robot "
        "anywhere on it. Some ten frames from different places and headings are enough, one may be.",
    )
    add_calibration_options(omni, "camera file to write (.toml); overlays go beside it")
    omni.add_argument("--mask", metavar="PNG", help="image whose non-zero pixels are never looked at")
    omni.set_defaults(run=run_calibrate_omni)


def run_calibrate_omni(args: argparse.Namespace) -> int:
    """Calibrate a mirror camera, write its file and overlays, and print its uncertainty; return the exit status."""
    from field_models import load_field
    from field_models.errors import FileError
    from robocup_vision.calibration.not_calibrated import NotCalibrated
    from robocup_vision.calibration.omni.calibrate import calibrate_omni
    from robocup_vision.camera import OmniCamera, load_camera, save_camera
    from robocup_vision.files.image_folder import ImageFiles
    from robocup_vision.files.images import read_mask
    from robocup_vision.files.output_folder import require_folder

    field = load_field(args.field)
    start = None if args.start is None else load_camera(args.start)
    if start is not None and not isinstance(start, OmniCamera):
        raise FileError(args.start, "is a pinhole camera, must be a mirror camera", key="model", value="pinhole")
    require_folder(args.out)
    images = ImageFiles(args.images, None if start is None else start.size_px)
    for note in images.notes:
        print(f"note: {note}")
    mask = None if args.mask is None else read_mask(args.mask)
    with start_trials(args, images.paths) as trials:
        result = calibrate_omni(field, images, start, mask, names=images.names, max_frames=args.frames, trials=trials)
    if isinstance(result, NotCalibrated):
        for note in result.notes:
            print(f"note: {note}")
        print(f"robocup-vision calibrate omni: not calibrated: {result.reason}", file=sys.stderr)
        return 2
    save_camera(result.camera, args.out)
    pictures = _write_overlays(result, field, images, Path(args.out))
    _print_calibration(result, len(images))
    print(f"camera file  {args.out}")
    print(f"overlays     {pictures}")
    return 0


def _write_overlays(result: OmniCalibration, field: Field, images: ImageFiles, out: Path) -> Path:
    from robocup_vision.files.images import write_png
    from robocup_vision.files.output_folder import telling_write_errors
    from robocup_vision.overlay import draw
    from robocup_vision.progress import progress
    from robocup_vision.vision import Vision

    folder = out.parent / f"{out.stem}_overlays"
    with telling_write_errors(folder):
        folder.mkdir(exist_ok=True)
    vision = Vision(field, result.camera)
    spread = result.frames[:: -(-len(result.frames) // _MAX_PICTURES)]
    for frame in progress(spread, len(spread), "overlays"):
        image = images[frame.index]
        vision.forget()
        write_png(folder / f"{Path(frame.name).stem}.png", draw(vision.look(image), image, vision))
    return folder


def _print_calibration(result: OmniCalibration, images: int) -> None:
    import math

    import numpy as np

    from robocup_vision.camera import Hyperboloid, Tangent

    camera, std = result.camera, result.std
    print(f"calibrated by {len(result.frames)} of {images} images")
    u, v = camera.center_px
    tilt = [math.degrees(angle) for angle in camera.tilt_rad]
    print(f"  center       {u:.2f} +- {std['center_u_px']:.2f}, {v:.2f} +- {std['center_v_px']:.2f} px")
    print(
        f"  tilt         {tilt[0]:.2f} +- {math.degrees(std['tilt_x_rad']):.2f}, "
        f"{tilt[1]:.2f} +- {math.degrees(std['tilt_y_rad']):.2f} deg about x (forward), y (left)"
    )
    curve = camera.floor_range
    if isinstance(curve, Hyperboloid):
        text = f"A {curve.A_px_per_m:.5g} px/m, B {curve.B_per_m:.5g} 1/m, C {curve.C_px2:.5g} px2"
    elif isinstance(curve, Tangent):
        text = f"a {curve.a_m:.5g} m, b {curve.b_per_px:.5g} 1/px"
    else:
        text = "see the camera file"
    print(f"  curve        {result.choices[0].curve}: {text}")
    print(
        f"               +- {100 * std['scale']:.2f} % near the robot, +- {100 * std['horizon']:.2f} % at the horizon"
    )
    for label, residuals in (
        ("floor's edge", [frame.boundary_residual_px for frame in result.frames]),
        ("white lines", [frame.line_residual_px for frame in result.frames]),
    ):
        size = np.abs(np.concatenate(residuals))
        if not len(size):
            continue
        good = size[size < _AGREES_PX]
        if not len(good):
            print(f"  {label:<12} {len(size)} points, none agrees")
            continue
        print(
            f"  {label:<12} {len(size)} points, {100 * len(good) / len(size):.0f} % agree: median "
            f"{np.median(good):.2f} px, 90 % within {np.percentile(good, 90):.2f} px"
        )
    print("  held-out points, by kind of curve:")
    for choice in result.choices:
        level = "tilted" if choice.tilted else "level"
        print(f"    {choice.curve:<12} {level:<7} median {choice.held_out_px:.2f} px, loss {choice.held_out_cost:.4f}")
    for note in result.notes:
        print(f"note: {note}")

"""`robocup-vision calibrate colors`: its options and its handler."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from robocup_vision.files.image_folder import ImageFiles
    from robocup_vision.perception.color_table import Colors

# frames in the preview, one below the other
_MAX_PICTURES = 6
_PREVIEW_WIDTH = 480
# BGR of the classes in the preview; pixels without a class are only darkened
_CLASS_BGR = ((0, 0, 0), (60, 170, 60), (255, 255, 255), (0, 120, 255), (0, 230, 230), (230, 90, 30))


def add_colors_parser(kinds: Any) -> None:
    """Add `colors` to the kinds of calibration."""
    colors: argparse.ArgumentParser = kinds.add_parser(
        "colors",
        help="the colours of floor, lines, ball and goals",
        description="Learn the colours of floor, lines, ball and goals from images of the field, without a click. "
        "A preview picture is written beside the colour file. Without such a file the colours are learnt while "
        "running, and follow the light; with one they stay.",
    )
    add = colors.add_argument
    add("images", nargs="+", metavar="IMAGES", help="image files, or folders of images")
    add("--field", default="ssl_2001", metavar="F", help="built-in field's name, or a field file (default: ssl_2001)")
    add("--out", required=True, metavar="COLORS", help="colour file to write (.toml)")
    add("--camera", metavar="C", help="camera file: locates the floor and, with the poses, the goals")
    add("--poses", metavar="CSV", help="the robot's poses: image,x_m,y_m,theta_rad (needs --camera)")
    add("--mask", metavar="PNG", help="image whose non-zero pixels are never looked at")
    colors.set_defaults(run=run_calibrate_colors)


def run_calibrate_colors(args: argparse.Namespace) -> int:
    """Learn colours, write their file and a preview, and print what was found; return the exit status."""
    from functools import partial

    from field_models import load_field
    from field_models.errors import ArgumentError, FrameError
    from robocup_vision.calibration.colors import calibrate_colors
    from robocup_vision.calibration.not_calibrated import NotCalibrated
    from robocup_vision.camera import load_camera
    from robocup_vision.files.csv_table import read_poses
    from robocup_vision.files.image_folder import ImageFiles
    from robocup_vision.files.images import read_mask
    from robocup_vision.files.output_folder import require_folder
    from robocup_vision.perception.color_table import save_colors
    from robocup_vision.progress import progress

    if args.poses is not None and args.camera is None:
        raise ArgumentError("--poses needs --camera")
    field = load_field(args.field)
    camera = None if args.camera is None else load_camera(args.camera)
    out = Path(args.out)
    require_folder(args.out)
    images = ImageFiles(args.images, None if camera is None else camera.size_px)
    for note in images.notes:
        print(f"note: {note}")
    mask = None if args.mask is None else read_mask(args.mask)
    width, height = images.size_px
    if mask is not None and mask.shape != (height, width):
        raise FrameError(f"{Path(args.mask).name}: must be as large as the images ({width}x{height})")
    poses = None if args.poses is None else read_poses(args.poses, images.names)
    reads = ((name, partial(images.__getitem__, i)) for i, name in enumerate(images.names))
    result = calibrate_colors(field, progress(reads, len(images), "colors"), camera, poses, mask)
    for note in result.notes:
        print(f"note: {note}")
    if isinstance(result, NotCalibrated):
        print(f"robocup-vision calibrate colors: not calibrated: {result.reason}", file=sys.stderr)
        return 2
    save_colors(result.colors, out)
    preview = out.with_name(f"{out.stem}_preview.png")
    _write_preview(result.colors, images, preview)
    floor, line = result.colors.floor, result.colors.line
    print(f"colours by {result.frames} of {len(images)} images")
    print(
        f"  floor             R/G {floor.lit.red_ratio:.2f}, B/G {floor.lit.blue_ratio:.2f}, brightness "
        f"{floor.level:.0f}, noise {floor.noise:.1f} counts"
    )
    print(f"  line              R/G {line.red_ratio:.2f}, B/G {line.blue_ratio:.2f}")
    for name, count in result.pixels.items():
        paint = getattr(result.colors, name)
        source = f"{count} pixels" if count else "not found: as the field file names it, under this light"
        print(f"  {name:<17} R/G {paint.red_ratio:.2f}, B/G {paint.blue_ratio:.2f}  ({source})")
    print(f"colour file  {args.out}")
    print(f"preview      {preview}")
    return 0


def _write_preview(colors: Colors, images: ImageFiles, path: Path) -> None:
    import cv2
    import numpy as np

    from field_models.errors import FrameError
    from robocup_vision.files.images import write_png
    from robocup_vision.perception.color_table import build_color_table

    table = build_color_table(colors)
    rows = []
    for index in range(0, len(images), -(-len(images) // _MAX_PICTURES)):
        try:
            frame = images[index]
        except FrameError:
            continue
        classes = table.segment(np.asarray(cv2.blur(frame, (3, 3)), dtype=np.uint8))
        painted = np.where((classes == 0)[..., None], frame // 3, np.array(_CLASS_BGR, dtype=np.uint8)[classes])
        both = np.hstack([frame, painted.astype(np.uint8)])
        scale = 2 * _PREVIEW_WIDTH / both.shape[1]
        rows.append(cv2.resize(both, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA if scale < 1 else 0))
    write_png(path, np.vstack(rows))

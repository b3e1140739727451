"""`robocup-vision map build|show|locate`: its options and its handler."""

from __future__ import annotations

import argparse
import math
from typing import Any


def add_parser(subparsers: Any) -> None:
    """Add the command `map` to the subparsers of an argparse parser; `run_map` runs what it parses."""
    parser = subparsers.add_parser(
        "map",
        help="landmark maps: build one from three cameras, show it, locate images on it",
        description="Landmark maps of what hangs on the walls: built from a run with three cameras, used with one.",
    )
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    build = actions.add_parser("build", help="build a map from a run of three cameras")
    build.add_argument("run_folder", metavar="RUN", help="folder with run.toml, right/, left/ and top/")
    build.add_argument("--out", metavar="MAP", default="map.npz", help="map to write (default: map.npz)")
    build.add_argument("--no-drift-correction", action="store_true", help="as the paper: track only")
    show = actions.add_parser("show", help="print what a map holds, and draw it")
    show.add_argument("map_file", metavar="MAP", help="map (.npz)")
    show.add_argument("--picture", metavar="PNG", help="draw it from above, with error ellipses")
    locate = actions.add_parser("locate", help="locate images on a map, each the next one's prior")
    locate.add_argument("map_file", metavar="MAP", help="map (.npz)")
    locate.add_argument("images", metavar="IMAGE", nargs="+", help="images of one camera")
    locate.add_argument("--camera", metavar="C", required=True, help="camera file (pinhole, known tilt_rad)")
    locate.add_argument("--at-most", metavar="N", type=int, default=60, help="landmarks looked for (default: 60)")
    locate.add_argument("--limit-ms", metavar="T", type=float, help="as many landmarks as fit into T ms, without SIFT")
    locate.add_argument("--picture", metavar="PNG", help="draw the map with where the images were taken")
    parser.set_defaults(run=run_map)


def run_map(args: argparse.Namespace) -> int:
    """Build, show or locate; return the exit status."""
    status: int = {"build": _build, "show": _show, "locate": _locate}[args.action](args)
    return status


def _build(args: argparse.Namespace) -> int:
    from robocup_vision.landmarks.landmark_map import save_map
    from robocup_vision.landmarks.mapping.run_files import load_run
    from robocup_vision.landmarks.mapping.stereo_mapper import StereoMapper
    from robocup_vision.progress import progress

    run = load_run(args.run_folder)
    mapper = StereoMapper(run.rig, run.start, bound_drift=not args.no_drift_correction)
    lost, closed = [], 0
    for name, images in progress(run.read(), len(run.names), "map build"):
        step = mapper.add(images[0], images[1], images[2], odometry=run.odometry.get(name))
        closed += step.closes_loop
        if not step.pose:
            lost.append(name)
    landmarks = mapper.finish()
    save_map(landmarks, args.out)
    print(f"{len(landmarks)} landmarks from {len(mapper.poses)} of {len(run.names)} moments in {args.out}")
    print(f"the run came back to known places {closed} times")
    if lost:
        print(f"note: {len(lost)} moments were left out, the first: {lost[0]}")
    return 0


def _show(args: argparse.Namespace) -> int:
    import numpy as np

    from robocup_vision.landmarks.landmark_map import load_map

    landmarks = load_map(args.map_file)
    std = np.sqrt(np.linalg.eigvalsh(landmarks.covariances)[:, -1])
    low, high = landmarks.positions_m.min(axis=0), landmarks.positions_m.max(axis=0)
    drift = np.sqrt(np.diagonal(landmarks.trajectory_cov, axis1=1, axis2=2)).max(axis=0)
    print(args.map_file)
    for label, value in (
        ("landmarks", f"{len(landmarks)}, {len(landmarks.view_landmark)} views"),
        ("x, y, z", ", ".join(f"{a:.2f} to {b:.2f}" for a, b in zip(low, high, strict=True)) + " m"),
        ("their error, median", f"{1e3 * float(np.median(std)):.1f} mm along the longest axis"),
        ("seen where expected", f"{100 * landmarks.seen.sum() / (landmarks.seen + landmarks.missed).sum():.0f} %"),
        ("moments of the run", f"{len(landmarks.trajectory)}"),
        ("drift, at most", f"{1e3 * drift[0]:.1f} mm, {1e3 * drift[1]:.1f} mm, {math.degrees(drift[2]):.3f} deg"),
    ):
        print(f"  {label:<20} {value}")
    if args.picture is not None:
        from robocup_vision.landmarks.picture import draw_map

        draw_map(landmarks, args.picture)
        print(f"  {'picture':<20} {args.picture}")
    return 0


def _locate(args: argparse.Namespace) -> int:
    from pathlib import Path

    from field_models.errors import ArgumentError
    from robocup_vision.camera import PinholeCamera, load_camera
    from robocup_vision.estimates import NotLocated
    from robocup_vision.files.images import read_image
    from robocup_vision.landmarks.landmark_map import load_map
    from robocup_vision.landmarks.selection import Selection
    from robocup_vision.landmarks.vision import LandmarkVision

    if args.limit_ms is not None and not args.limit_ms > 0:
        raise ArgumentError(f"--limit-ms must be positive, got {args.limit_ms}")
    landmarks, camera = load_map(args.map_file), load_camera(args.camera)
    if not isinstance(camera, PinholeCamera):
        raise ArgumentError(f"{args.camera}: a landmark map needs a pinhole camera")
    limit_s = None if args.limit_ms is None else args.limit_ms / 1e3
    vision = LandmarkVision(landmarks, camera, selection=Selection(at_most=args.at_most), limit_s=limit_s)
    located = []
    for path in args.images:
        view = vision.look(read_image(path, camera.size_px))
        name = Path(path).name
        if isinstance(view.pose, NotLocated):
            print(f"{name}  not located: {view.pose.reason}")
            continue
        pose, std = view.pose.pose, view.pose.std
        located.append(pose)
        print(
            f"{name}  {pose.x_m:+.4f} m, {pose.y_m:+.4f} m, {math.degrees(pose.theta_rad):+.2f} deg"
            f"  (+- {1e3 * std[0]:.1f} mm, {1e3 * std[1]:.1f} mm, {math.degrees(std[2]):.2f} deg)"
        )
    print(f"{len(located)}/{len(args.images)} located")
    if args.picture is not None:
        from robocup_vision.landmarks.picture import draw_map

        draw_map(landmarks, args.picture, located)
        print(f"picture: {args.picture}")
    return 0

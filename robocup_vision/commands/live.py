"""`robocup-vision live`: its options and its handler."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

_DESCRIPTION = """\
Show in a browser what a robot sees: the image with layers, the field from above, times and reasons; pause, step, go
back 30 s, record, save a frame as a dataset. The page is on this machine alone, at http://127.0.0.1:PORT/.

SOURCE is a camera (index or device), a stream's address, a video, a folder of images, a dataset, a recording (.mcap), a
folder of recordings, a simulated match (sim:FIELD[,players=N][,seed=S][,robots=0+1][,ours=NAME][,theirs=NAME]), or an
image topic of ROS 2 (ros:TOPIC[,odometry=TOPIC]; with rclpy, as installed with ROS or from wheels).
Several are shown side by side. Without --camera a camera, video or folder can be calibrated in the page."""


def add_parser(subparsers: Any) -> None:
    """Add the command `live` to the subparsers of an argparse parser."""
    parser = subparsers.add_parser(
        "live",
        help="show in a browser what a robot sees, as it sees it",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("sources", nargs="+", metavar="SOURCE", help="what is shown: see above")
    add("--field", metavar="F", help="built-in field or field file (needed where the source does not say)")
    add("--camera", metavar="C", help="camera file")
    add("--colors", metavar="K", help="colour file (default: learnt from the frames)")
    add("--method", metavar="M", help="field, floor, edges, goal; published ones: hull, angles (default: by camera)")
    add("--memory", action="store_true", help="join the frames: pose filter, tracks and map")
    add("--record", metavar="FILE", help="record to this file (.mcap) from the first frame on")
    add("--force", action="store_true", help="with --record: replace the file where there is one")
    add("--from", dest="from_s", type=float, metavar="T", help="go to this time, seconds, and stand still there")
    add("--out", default="out/live", metavar="DIR", help="folder for what the page saves (default: out/live)")
    add("--port", type=int, default=8090, metavar="P", help="port of the page (default: 8090; 0: any free one)")
    add(
        "--host",
        default="127.0.0.1",
        metavar="IP",
        help="address to listen on (default: 127.0.0.1)",
    )
    add("--foxglove", metavar="PORT", type=int, help="serve the first robot's topics to Foxglove (extra foxglove)")
    add("--seconds", type=float, metavar="T", help="end after this time (default: when interrupted)")
    parser.set_defaults(run=run_live)


def run_live(args: argparse.Namespace) -> int:
    """Serve the page until interrupted; return the exit status."""
    import math
    import time

    from field_models.errors import ArgumentError
    from robocup_vision.files.output_folder import refuse_existing
    from robocup_vision.foxglove.server import FoxgloveServer
    from robocup_vision.live.handover.controls import Controls
    from robocup_vision.live.handover.moment import Moment
    from robocup_vision.live.handover.page_settings import require_packages
    from robocup_vision.live.live_page import LivePage
    from robocup_vision.live.live_run import LiveRun
    from robocup_vision.live.sources.opening import open_source
    from robocup_vision.live.sources.source import Source, SourceFrame, SourceOptions

    require_packages()
    for option, value in (("--from", args.from_s), ("--seconds", args.seconds)):
        if value is not None and not (math.isfinite(value) and value >= 0):
            raise ArgumentError(f"{option} must be 0 or more, got {value!r}")
    if args.record is not None:
        refuse_existing(args.record, force=args.force)
    options = SourceOptions(args.field, args.camera, args.colors, args.method, args.memory)
    texts, folder = _sources(args.sources)
    out, sources, pages = Path(args.out), list[Source](), list[LivePage]()

    def make_page(controls: Controls) -> LivePage:
        pages.append(LivePage(controls, out, port=args.port, host=args.host))
        return pages[0]

    foxglove: FoxgloveServer | None = None
    first = ""

    def show(frame: SourceFrame, moment: Moment) -> None:
        if foxglove is not None and moment.view is not None and frame.robot == first:
            foxglove.show(frame.frame, moment.view, frame.t_s, frame.odometry)

    try:
        sources.extend(open_source(text, options) for text in texts)
        if args.foxglove is not None:
            setup = sources[0].setups[0]
            if setup.camera is None:
                raise ArgumentError("--foxglove needs a camera file (--camera)")
            first, foxglove = setup.name, FoxgloveServer(setup.field, setup.camera, args.foxglove)
            print(f"Foxglove: ws://{foxglove.host}:{foxglove.port}", flush=True)
        run = LiveRun(make_page, sources, options, out, folder=folder, also_watch=show)
    except BaseException:
        for source in sources:
            source.close()
        for page in pages:
            page.close()
        if foxglove is not None:
            foxglove.close()
        raise
    try:
        if args.record is not None:
            run.record_to(Path(args.record))
        if pages[0].is_public:
            run.say(f"everybody who can reach {args.host} can watch and use the controls")
        print(f"live at {pages[0].address} (Ctrl-C ends it)", flush=True)
        run.start(seek_s=args.from_s)
        end_s = math.inf if args.seconds is None else time.monotonic() + args.seconds
        while pages[0].is_alive and time.monotonic() < end_s:
            time.sleep(min(0.5, max(0.0, end_s - time.monotonic())))
    finally:
        run.close()
        if foxglove is not None:
            foxglove.close()
    return 0


def _sources(given: Sequence[str]) -> tuple[list[str], Path | None]:
    """Return the sources to open, and the folder whose recordings the page may open instead."""
    from robocup_vision.live.sources.opening import RECORDING_SUFFIX, recordings_in

    path = Path(given[0])
    if len(given) == 1 and path.is_dir() and not (path / "dataset.toml").exists():
        names = recordings_in(path)
        if names:
            return [str(path / names[0])], path
    if len(given) == 1 and path.is_file() and path.suffix.lower() == RECORDING_SUFFIX:
        return [str(path)], path.parent
    return list(given), None

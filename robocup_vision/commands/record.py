"""`robocup-vision record`: its options and its handler."""

from __future__ import annotations

import argparse
from typing import Any


def add_parser(subparsers: Any) -> None:
    """Add the command `record`."""
    parser = subparsers.add_parser(
        "record",
        help="look at the frames of a camera, stream, video or folder, and record all",
        description="Look at frames as they come and write a recording: frames, what they show, and all that a replay "
        "needs. Ctrl-C ends it. Needs the extra ros.",
    )
    add = parser.add_argument
    add("source", help="camera (index or device), stream's address, video, folder of images, dataset, or recording")
    add("file", help="the recording (.mcap)")
    add("--field", metavar="F", help="built-in field or field file (needed where the source does not say)")
    add("--camera", metavar="C", help="camera file (needed where the source does not say)")
    add("--colors", metavar="K", help="colour file (default: learnt from the frames)")
    add("--method", metavar="M", help="how the pose is found (default: by camera)")
    add("--memory", action="store_true", help="join the frames: pose over time, tracks, map")
    add("--seconds", metavar="T", type=float, help="end after so long (default: when the frames end)")
    add("--image-format", choices=("raw", "png", "jpeg"), default="raw", help="raw and png lose nothing (default: raw)")
    add("--compression", choices=("lz4", "zstd", "none"), default="lz4", help="of the file's chunks (default: lz4)")
    add("--force", action="store_true", help="replace the file where there is one")
    add("--markings", action="store_true", help="keep line segments, crossings, circles and goal posts, too")
    add("--foxglove", metavar="PORT", type=int, help="serve the topics to Foxglove, too (extra foxglove)")
    parser.set_defaults(run=run_record)


def run_record(options: argparse.Namespace) -> int:
    """Record; return 0, or 2 after one line on standard error if frames could not be used."""
    import os
    import sys
    from contextlib import ExitStack, closing

    from field_models.errors import ArgumentError
    from robocup_vision.files.output_folder import refuse_existing
    from robocup_vision.foxglove.server import FoxgloveServer
    from robocup_vision.live.sources.opening import open_source
    from robocup_vision.live.sources.source import SourceFrame, SourceOptions
    from robocup_vision.live.sources.source_recording import record_source
    from robocup_vision.recording.call_writer import RecorderSettings
    from robocup_vision.view import View

    refuse_existing(options.file, force=options.force)
    if os.path.realpath(options.file) == os.path.realpath(options.source):
        raise ArgumentError(f"{options.file} is the source itself, a recording needs another name")
    wanted = SourceOptions(options.field, options.camera, options.colors, options.method, options.memory)
    settings = RecorderSettings(options.image_format, options.compression, markings=options.markings)
    with ExitStack() as stack:
        source = stack.enter_context(closing(open_source(options.source, wanted)))
        server: FoxgloveServer | None = None
        setup = source.setups[0]
        if options.foxglove is not None and setup.camera is not None:
            server = stack.enter_context(FoxgloveServer(setup.field, setup.camera, options.foxglove))
            print(f"Foxglove: ws://{server.host}:{server.port}", flush=True)

        def show(now: SourceFrame, view: View) -> None:
            if server is not None:
                server.show(now.frame, view, now.t_s, now.odometry)

        summary = record_source(source, options.file, settings, options.seconds, show=show)
    print(f"{options.file}: {summary.frames} frames, {summary.located} of them located")
    if not summary.unusable:
        return 0
    problem = f"{summary.unusable} frames could not be used, the first: {summary.first_problem}"
    print(f"robocup-vision record: {problem}", file=sys.stderr)
    return 2

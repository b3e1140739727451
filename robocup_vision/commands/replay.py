"""`robocup-vision replay`: its options and its handler."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any


def add_parser(subparsers: Any) -> None:
    """Add the command `replay`."""
    parser = subparsers.add_parser(
        "replay",
        help="run a recording again, as it was or with other settings, and compare",
        description="Make the calls of a recording again. As it was: tell whether every one gives the same in every "
        "bit. With other settings: tell by how much poses, balls and commands differ. Writes replay.csv, replay.json "
        "and replay.html.",
    )
    add = parser.add_argument
    add("recording", help="a recording (.mcap)")
    add("--from", dest="from_s", metavar="T", type=float, help="report from this time on, seconds")
    add("--to", dest="to_s", metavar="T", type=float, help="end at this time, seconds")
    add("--field", metavar="F", help="another field: built-in field or field file")
    add("--camera", metavar="C", help="another camera file")
    add("--colors", metavar="K", help="another colour file")
    add("--method", metavar="M", help="another method")
    add("--memory", action=argparse.BooleanOptionalAction, help="with a memory, or without one")
    add("--out", metavar="DIR", help="folder for the files (default: out/NAME)")
    parser.set_defaults(run=run_replay)


def run_replay(options: argparse.Namespace) -> int:
    """Replay a recording; return 0, or 1 if it ran as recorded and something differs."""
    from field_models.catalog import load_field
    from robocup_vision.camera.files import load_camera
    from robocup_vision.evaluation.result_files import prepare_folder
    from robocup_vision.perception.color_table import load_colors
    from robocup_vision.recording.loops import Changes
    from robocup_vision.recording.recording import Recording
    from robocup_vision.recording.replay import Differences, replay
    from robocup_vision.recording.replay_files import OUTPUT_NAMES, summary_lines, write_files

    recording = Recording(options.recording)
    changes = Changes(
        None if options.field is None else load_field(options.field),
        None if options.camera is None else load_camera(options.camera),
        None if options.colors is None else load_colors(options.colors),
        options.method,
        options.memory,
    )
    out = Path(options.out) if options.out is not None else Path("out") / recording.path.stem
    prepare_folder(out, OUTPUT_NAMES)
    differences, calls = Differences(), []
    for call in replay(recording, changes, options.from_s, options.to_s):
        differences.add(call)
        calls.append(call)
    notes = write_files(out, recording.path.name, calls, differences)
    print(recording.path.name)
    for label, text in summary_lines(differences):
        print(f"  {label:<32} {text}")
    print(f"  {'report':<32} {out}")
    if not recording.is_whole:
        notes.append("the file was cut off: it is replayed up to its last whole chunk")
    if recording.dropped:
        notes.append(f"the recorder left out {recording.dropped} calls: the replay cannot be the same")
    if recording.run.caveat:
        notes.append(recording.run.caveat)
    for note in notes:
        print(f"note: {note}")
    is_exact = not (changes.any or recording.dropped or recording.run.caveat)
    if is_exact and not differences.is_same:
        print("robocup-vision replay: the replay differs from what ran", file=sys.stderr)
        return 1
    return 0

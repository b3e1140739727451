"""Plays one match from beginning to end, and writes match.json, match.webm and report.html."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.camera import Rig
from robocup_vision.files.output_folder import refuse_foreign_files, written_at_once
from robocup_vision.files.text_files import write_json, write_text
from robocup_vision.progress import progress
from sim2d.match.disturbances import Disturbances
from sim2d.match.match import Match, periods
from sim2d.match.recorded import MatchRecorders
from sim2d.match.setups import Camera, MatchSetup, RobotKind, setup_for
from sim2d.players.built_in import BuiltInPlayer
from sim2d.players.catalog import player_name
from sim2d.report import html as match_report
from sim2d.report.match_figures import MatchFigures, match_json
from sim2d.report.story import MatchStory
from sim2d.report.video import MatchVideo
from sim2d.robot_link import CONTROL_PERIOD_S, PlayerFactory
from sim2d.sensors.faults import Fault
from sim2d.world.referee import RefereeFactory

OUTPUT_NAMES = ("match.json", "match.webm", "report.html", "robot_*.mcap")


@dataclass(frozen=True, slots=True)
class MatchPlan:
    """The description of a match to play; can be pickled.

    Parameters
    ----------
    field : str
        Name of a built-in field, or a field file.
    seconds : float
        Length of the match.
    seed : int
        The same plan gives the same match.json, byte for byte.
    ours, theirs : PlayerFactory
        As in `Match`; `sim2d.players.catalog.BuiltInTeam` makes built-in players with options and settings.
    camera : OmniCamera, PinholeCamera, Rig or str, optional
        Camera or rig of every robot, or its name (`sim2d.match.setups.CAMERAS`) or file; default: the field's league's.
    robot : RobotKind or str, optional
        Kind of all robots, or its name (`sim2d.match.setups.ROBOTS`); by default that of the field's league.
    players, faults, disturbances
        As in `Arena`.
    referee : RefereeFactory, optional
        As in `Arena`; one that listens to a game controller cannot be pickled.
    """

    field: str = "ssl_2001"
    players: int | None = None
    seconds: float = 60.0
    seed: int = 0
    ours: PlayerFactory = BuiltInPlayer
    theirs: PlayerFactory = BuiltInPlayer
    camera: Camera | Rig | str | None = None
    robot: RobotKind | str | None = None
    faults: tuple[Fault, ...] = ()
    referee: RefereeFactory | None = None
    disturbances: Disturbances | None = None

    @property
    def setup(self) -> MatchSetup:
        """Robots, camera and players per side.

        Raises
        ------
        ArgumentError, FileError
            If they cannot play on the field.
        """
        return setup_for(load_field(self.field), players=self.players, camera=self.camera, robot=self.robot)

    def begin(self) -> Match:
        """Set up the match.

        Raises
        ------
        ArgumentError, FileError
            If the plan cannot be played.
        """
        if not 0 < self.seconds < float("inf"):
            raise ArgumentError(f"seconds must be positive, got {self.seconds!r}")
        setup = self.setup
        return Match(
            load_field(self.field),
            setup.players,
            self.seed,
            ours=self.ours,
            theirs=self.theirs,
            camera=setup.camera if setup.rig is None else setup.rig,
            robot=setup.robot,
            faults=self.faults,
            referee=self.referee,
            disturbances=self.disturbances,
        )


@dataclass(frozen=True, slots=True)
class MatchSummary:
    """The result of a match: figures, folder of its files, video and report (None: not written), notes, recordings."""

    figures: MatchFigures
    out: Path
    video: Path | None
    report: Path | None
    notes: tuple[str, ...]
    recordings: tuple[Path, ...] = ()


def run_match(
    plan: MatchPlan, out: str | Path, *, realtime: bool = False, record: bool = False, force: bool = False
) -> MatchSummary:
    """Play a match and write its files; a match that fails or is interrupted does not change the folder.

    Parameters
    ----------
    plan : MatchPlan
        The match.
    out : str or Path
        Folder for match.json, match.webm and report.html; made if missing. Files of an earlier match are replaced, its
        recordings deleted.
    realtime : bool
        Play in real time; by default as fast as possible.
    record : bool
        Write a recording of each robot, robot_0.mcap and so on; needs the extra `ros`.
    force : bool
        Also write to a folder that holds other files, which are kept.

    Raises
    ------
    ArgumentError, FileError
        If the plan cannot be played, the files cannot be written, or the folder holds others and `force` is not set.
    """
    out = Path(out)
    if not force:
        refuse_foreign_files(out, OUTPUT_NAMES)
    match = plan.begin()
    with written_at_once(out, OUTPUT_NAMES) as work:
        summary = _play(plan, match, work, realtime=realtime, record=record)
    video, report = (None if path is None else out / path.name for path in (summary.video, summary.report))
    recordings = tuple(out / path.name for path in summary.recordings)
    return replace(summary, out=out, video=video, report=report, recordings=recordings)


def _play(plan: MatchPlan, match: Match, out: Path, *, realtime: bool, record: bool) -> MatchSummary:
    arena = match.arena
    robots = arena.state.robots
    video = MatchVideo(out / "match.webm", arena.field, arena.camera, len(robots), arena.limits.radius_m)
    story = MatchStory(len(robots))
    recorders = MatchRecorders(out, match, (player_name(plan.ours), player_name(plan.theirs))) if record else None
    started_s = time.monotonic()
    behind_s = 0.0
    try:
        for done, moment in enumerate(progress(match.play(plan.seconds), periods(plan.seconds), "match"), start=1):
            video.add(moment)
            story.add(moment)
            if recorders is not None:
                recorders.add(moment)
            if realtime:
                early_s = done * CONTROL_PERIOD_S - (time.monotonic() - started_s)
                behind_s = max(behind_s, -early_s)
                time.sleep(max(early_s, 0.0))
    finally:
        video.close()
        if recorders is not None:
            recorders.close()
    figures = match.figures
    notes = [note for note in (video.problem,) if note]
    if behind_s > 1.0:
        notes.append(f"this machine could not keep up with the clock: it fell {behind_s:.1f} s behind")
    missing = match_report.missing_packages()
    report = None if missing else out / "report.html"
    if missing:
        notes.append(f"no report.html: {' and '.join(missing)} not installed (pip install 'robocup-vision[report]')")
    ours, theirs = player_name(plan.ours), player_name(plan.theirs)
    values = match_json(arena.field.name, arena.players, plan.seed, figures, ours, theirs, arena.disturbances.names)
    write_json(out / "match.json", values)
    video_path = None if video.problem else out / "match.webm"
    if report is not None:
        recorded = () if recorders is None else tuple(path.name for path in recorders.paths)
        text = match_report.render_report(
            arena.field, plan.seed, figures, story, video_path, notes, recorded, video.poster
        )
        write_text(report, text)
    recordings = () if recorders is None else recorders.paths
    return MatchSummary(figures, out, video_path, report, tuple(notes), recordings)

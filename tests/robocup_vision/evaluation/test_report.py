"""The report of an evaluation: its page, its plots, its links to moments and its overlays."""

import math
import re
from itertools import pairwise
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models import field_names, load_field
from robocup_vision.estimates import PoseEstimate
from robocup_vision.evaluation import report
from robocup_vision.evaluation.dataset import Truth, load_dataset
from robocup_vision.evaluation.moment_links import LIVE_PORT, moment_link
from robocup_vision.evaluation.overlays import SPREAD_COUNT, WORST_COUNT, WorstSoFar, spread_indices
from robocup_vision.evaluation.plots import draw_plots
from robocup_vision.evaluation.scoring import Row, figures, pose_error
from robocup_vision.geometry import Pose2

PNG = re.compile(r"^data:image/png;base64,[A-Za-z0-9+/]+=*$")


def located(image: str, truth: Truth | None, offset_m: float = 0.01) -> Row:
    estimate = PoseEstimate(Pose2(0.5 + offset_m, 0.2, 0.1), np.eye(3) * 1e-4, 0.9, 0.5)
    return Row(image, estimate, truth, truth and pose_error(estimate, truth, symmetric=True), 0.004)


TRUTH = Truth(0.5, 0.2, 0.1)
ROWS = [
    located("a.png", TRUTH),
    located("far.png", TRUTH, 0.3),
    located("position_only.png", Truth(0.5, 0.2, None)),
    located("nobody_knows.png", None),
    Row("dark.png", truth=TRUTH, time_s=0.002, reason="<script>alert(1)</script> too dark"),
    Row("torn & lost.png", reason="is a truncated PNG", failed=True, unreadable=True),
]


def test_the_page_stands_alone_is_escaped_and_shows_each_image(folder: Path) -> None:
    spread = {0: b"spread", 1: b"both"}
    worst = [(1, b"both"), (4, b"worst")]
    page = report.render_report(load_dataset(folder), ROWS, figures(ROWS), ["a <note>"], spread, worst)
    sources = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert len(sources) == 3 + 3
    assert all(source.startswith("data:image/") for source in sources)
    # nor are there moments of a recording to link to
    assert "http" not in page
    assert "recording=" not in page
    assert page.count("<script") == page.count("<script>\n  const") == 1
    assert "&lt;script&gt;alert(1)&lt;/script&gt; too dark" in page
    assert "a &lt;note&gt;" in page
    assert "torn &amp; lost.png" in page
    everything = page[page.index("<details") :]
    assert len(re.findall(r"<tr class=", everything)) == len(ROWS)
    first_worst = page[page.index("Worst images") :]
    names = re.findall(r"<tr class=\"[a-z-]+\"[^>]*><td>([^<]+)</td>", first_worst)[:3]
    assert names == ["torn &amp; lost.png", "dark.png", "far.png"]
    for text in ("ssl_2001", "64 × 56 px", "errors modulo a half turn", "4/6", "16.7 %", "300.0 mm"):
        assert text in page


@pytest.mark.usefixtures("without_plots")
def test_reasons_that_differ_by_numbers_alone_are_counted_as_one(folder: Path) -> None:
    reasons = ("only 3 of 40 places agree", "only 12 of 38 places agree", "too dark: brightness 1.5")
    rows = [Row(f"{number}.png", time_s=0.002, reason=reason) for number, reason in enumerate(reasons)]
    page = report.render_report(load_dataset(folder), rows, figures(rows), [], {}, [])
    counted = page[: page.index("<details")]
    assert re.search(r"only … of … places agree</td>\s*<td[^>]*>2<", counted)
    assert re.search(r"too dark: brightness …</td>\s*<td[^>]*>1<", counted)


@pytest.mark.usefixtures("without_plots")
def test_of_very_many_images_the_worst_are_listed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(report, "_MAX_LISTED", 2)
    page = report.render_report(load_dataset(folder), ROWS, figures(ROWS), [], {}, [])
    everything = page[page.index("<details") :]
    assert f"The worst 2 of {len(ROWS)} images; results.csv has all" in everything
    assert re.findall(r"<tr class=\"([a-z-]+)\"[^>]*><td>([^<]+)</td>", everything) == [
        ("not-located", "dark.png"), ("unreadable", "torn &amp; lost.png")
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("rows", "count"),
    [
        (ROWS, 3),
        pytest.param([row for row in ROWS if row.truth is None], 2, marks=pytest.mark.slow),
        ([ROWS[4]], 1),
        pytest.param([located("exact.png", TRUTH, 0.0)], 3, marks=pytest.mark.slow),
    ],
)
def test_whatever_there_is_gets_drawn(rows: list[Row], count: int) -> None:
    """The slow cases alone find a plot that no truth, or an error of zero, breaks."""
    plots = draw_plots(load_field("ssl_2001"), rows)
    assert len(plots) == count
    assert all(PNG.match(source) and caption for source, caption in plots)


@pytest.mark.parametrize(
    "name",
    [one if one in ("ssl_2001", "spl_2020") else pytest.param(one, marks=pytest.mark.slow) for one in field_names()],
)
def test_every_field_has_a_map(name: str) -> None:
    """The slow cases alone find a field whose map cannot be drawn."""
    ((source, _),) = draw_plots(load_field(name), [ROWS[4]])
    assert PNG.match(source)


def test_missing_figures_are_dashes() -> None:
    assert (report.percent(None), report.millimetres(None), report.degrees(None)) == ("–", "–", "–")
    assert (report.percent(0.5), report.millimetres(0.0123), report.degrees(math.pi)) == (
        "50.0 %",
        "12.3 mm",
        "180.00°",
    )


@given(st.text(min_size=1), st.floats(0.0, 1e6))
def test_a_link_says_what_was_asked(name, t_s):
    address = urlsplit(moment_link(name, t_s))
    told = parse_qs(address.query, keep_blank_values=True)
    assert told["recording"] == [name]
    assert float(told["t"][0]) == pytest.approx(t_s, abs=1e-3)
    assert address.netloc == f"127.0.0.1:{LIVE_PORT}"


def test_a_time_before_the_beginning_is_the_beginning():
    assert moment_link("a.mcap", -3.0).endswith("t=0.000")


@given(count=st.integers(1, 500))
def test_spread_reaches_from_first_to_last(count: int) -> None:
    indices = sorted(spread_indices(count))
    assert indices[0] == 0
    assert indices[-1] == count - 1
    assert len(indices) == min(count, SPREAD_COUNT)
    gaps = [b - a for a, b in pairwise(indices)]
    assert not gaps or max(gaps) - min(gaps) <= 1


@given(values=st.lists(st.integers(0, 6), max_size=60), workers=st.integers(1, 4))
def test_the_worst_of_all_are_kept(values: list[int], workers: int) -> None:
    expected = sorted(range(len(values)), key=lambda i: (-values[i], i))[:WORST_COUNT]
    everything, each = WorstSoFar(), [WorstSoFar() for _ in range(workers)]
    for index, value in enumerate(values):
        severity = (1.0, float(value))
        mine = each[index * 7 % workers]
        if not mine.admits(index, severity):
            continue
        mine.add(index, severity, b"")
        if everything.admits(index, severity):
            everything.add(index, severity, bytes([index]))
    assert everything.pictures == [(index, bytes([index])) for index in expected]

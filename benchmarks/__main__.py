"""Runs all benchmarks one after another, prints a line each, and compares their figures with the last ones.

``--check`` compares with ``benchmarks/figures/quick`` (with --quick) or ``benchmarks/figures``, by the tolerances in
harness/compare.py, and leaves with status 1 if a figure got worse. ``--jobs 2`` runs two programs side by side: most
use one core. ``--update`` makes the new figures the last ones.
``--render`` runs nothing: it renders the tables of the pages from the files of figures.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

from benchmarks.harness.compare import Comparison, compare
from benchmarks.harness.figures import FOLDER, QUICK_FOLDER, FigureError, read_figures, write_figures
from benchmarks.harness.markdown import render_page
from benchmarks.harness.programs import ROOT, program_names, run_program

PAPERS = ("sekimori", "yako", "ogawa", "miura")
PROGRAM_PAGES = tuple(f"docs/benchmarks/{name}.md" for name in program_names())
PAGES = ("README.md", "docs/benchmarks/short.md", *PROGRAM_PAGES, *(f"docs/papers/{name}.md" for name in PAPERS))
Run = Callable[[str, Sequence[str]], "tuple[int, str]"]


def _run(name: str, arguments: Sequence[str]) -> tuple[int, str]:
    done = run_program(name, arguments)
    return done.returncode, (done.stderr or done.stdout).strip().splitlines()[-1] if done.returncode else ""


def check_program(
    name: str, folder: Path, options: Sequence[str], *, check: bool, update: bool, run: Run
) -> tuple[bool, list[str]]:
    """Run one program.

    Parameters
    ----------
    name : str
        FOLDER/NAME.
    folder : Path
        Where the last figures are.
    options : sequence of str
        For the program.
    check, update : bool
        Whether to compare with the last figures, and whether to replace them.
    run : callable
        Runs a program: exit status, and the last line of what went wrong.

    Returns
    -------
    ok : bool
        It ran, and nothing got worse.
    lines : list of str
        A line on the program, and one on each figure that got worse.
    """
    last = folder / f"{name}.json"
    with tempfile.TemporaryDirectory() as temporary:
        path = Path(temporary) / "figures.json"
        began = time.perf_counter()
        status, message = run(name, [*options, "--json", str(path)])
        line = f"{name:<34} {time.perf_counter() - began:6.1f} s  "
        if status:
            return False, [f"{line}exit status {status}: {message}"]
        try:
            now = read_figures(path)
            found = compare(read_figures(last), now) if check else Comparison(0, ())
        except FigureError as error:
            return False, [f"{line}{error}"]
    if update:
        write_figures(now, last)
    text = f"{len(found.worse)} WORSE" if found.worse else "ok"
    counted = f", {found.compared} figures compared" if check else ""
    return not found.worse, [f"{line}{text}{counted}", *(f"    {worse}" for worse in found.worse)]


def render_pages(pages: Sequence[str] = PAGES, root: Path = ROOT, folder: Path = FOLDER) -> list[str]:
    """Render the figures of pages; return those that changed.

    Raises
    ------
    FigureError
        A page asks for figures that are not there; it names the page.
    """
    changed = []
    for page in pages:
        path = root / page
        text = path.read_text(encoding="utf-8")
        try:
            rendered = render_page(text, folder)
        except FigureError as error:
            raise FigureError(f"{page}: {error}") from None
        if rendered != text:
            path.write_text(rendered, encoding="utf-8")
            changed.append(page)
    return changed


def main(argv: Sequence[str] | None = None, run: Run = _run) -> int:
    """Run what is asked for; return the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="each program in its quick size")
    parser.add_argument("--check", action="store_true", help="exit status 1 if a figure got worse")
    parser.add_argument("--update", action="store_true", help="replace the last figures")
    parser.add_argument("--render", action="store_true", help="render the tables of the pages, and run nothing")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="programs side by side; default: 1")
    parser.add_argument("programs", nargs="*", metavar="FOLDER/NAME", help="those to run; all unless given")
    arguments = parser.parse_args(argv)
    if arguments.render:
        try:
            changed = render_pages()
        except FigureError as error:
            print(error, file=sys.stderr)
            return 2
        print(f"rendered: {', '.join(changed) or 'nothing has changed'}")
        return 0
    names = program_names()
    unknown = [name for name in arguments.programs if name not in names]
    if unknown:
        parser.error(f"no program {unknown[0]!r}; there are {', '.join(names)}")
    folder, options = (QUICK_FOLDER, ["--quick"]) if arguments.quick else (FOLDER, [])
    began = time.perf_counter()
    check, update = arguments.check, arguments.update
    good = []
    with ThreadPoolExecutor(arguments.jobs) as pool:
        one = partial(check_program, folder=folder, options=options, check=check, update=update, run=run)
        for is_good, lines in pool.map(one, arguments.programs or names):
            good.append(is_good)
            print("\n".join(lines), flush=True)
    print(f"{sum(good)} of {len(good)} programs ok, {time.perf_counter() - began:.0f} s")
    return 0 if all(good) else 1


if __name__ == "__main__":
    raise SystemExit(main())

"""The pages' programs run, their commands exist and their links lead somewhere, so that they stay true."""

import re
import shlex
import shutil
import subprocess
import sys

import pytest
from pages import PAGES, ROOT, blocks, name_of, text_of

from robocup_vision import cli

PROGRAMS = [(name_of(page), program) for page in PAGES for program in blocks(page, "python")]
# in folders of their own, none knows the names of another: one process, as most of a program's time is its start
RUN = """
import os, sys
FOLDERS, KNOWN = os.getcwd(), None
KNOWN = set(globals()) | {"number", "program", "page"}
for number, program in enumerate(sys.argv[1:]):
    os.chdir(f"{FOLDERS}/{number}")
    page = open("page").read()
    exec(compile(program, f"program of {page}", "exec"))
    print("\\0", end="", flush=True)
    for name in set(globals()) - KNOWN:
        del globals()[name]
"""
COMMANDS = sorted(
    {
        line
        for page in PAGES
        for block in blocks(page, "console")
        for line in block.splitlines()
        if line.startswith("robocup-vision")
    }.union(re.findall(r"`(robocup-vision [^`]* --[^`]*)`", text_of(PAGES[0])))
)
LINKS = [
    (name_of(page), target)
    for page in PAGES
    for target in re.findall(r"\]\(([^)\s]+)\)", text_of(page))
    if not target.startswith("https://")
]


def test_the_readme_is_short_and_has_a_program_for_each_use():
    assert [page for page, _ in PROGRAMS].count("README.md") >= 3
    text = re.sub(r"^<!-- figures: .*?^<!-- end of figures -->$", "", text_of(PAGES[0]), flags=re.M | re.S)
    assert len(text.splitlines()) <= 120


@pytest.mark.slow
def test_programs_run(tmp_path):
    """Only this finds a program of a page that the library no longer runs."""
    for number, (page, _) in enumerate(PROGRAMS):
        shutil.copytree(ROOT / "images", tmp_path / str(number) / "images")  # what a program writes goes there, too
        (tmp_path / str(number) / "page").write_text(page)
    programs = [program for _, program in PROGRAMS]
    run = subprocess.run([sys.executable, "-c", RUN, *programs], cwd=tmp_path, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    printed = run.stdout.split("\0")
    assert len(printed) == len(PROGRAMS) + 1
    assert all(printed[:-1])


@pytest.fixture(scope="module")
def parser():
    return cli.command_parser()


@pytest.mark.parametrize("command", COMMANDS)
def test_commands_are_understood(command, parser):
    name, *arguments = shlex.split(command)
    assert name == "robocup-vision"
    assert parser.parse_args(arguments).run


@pytest.mark.parametrize(("page", "target"), LINKS)
def test_links_lead_to_files_and_headings(page, target):
    path, _, heading = target.partition("#")
    linked = (ROOT / page).parent / path if path else ROOT / page
    assert linked.exists()
    if heading:
        text = text_of(linked)
        headings = [re.sub(r"[^\w\- ]", "", line.lstrip("# ")).lower() for line in re.findall(r"^#+ .*$", text, re.M)]
        assert f"({heading})=" in text or heading in [one.replace(" ", "-") for one in headings]

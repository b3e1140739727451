"""The pages' programs run, their commands exist and their links lead somewhere, so that they stay true."""

import re
import shlex
import shutil
import subprocess
import sys

import pytest
from pages import DOCS, PAGES, ROOT, blocks, name_of, text_of

from robocup_vision import cli

PROGRAMS = [
    pytest.param(program, id=f"{name_of(page)}:{number}")
    for page in PAGES
    if page.is_relative_to(DOCS)
    for number, program in enumerate(blocks(page, "python"))
]
COMMANDS = sorted(
    {
        line
        for page in PAGES
        for block in blocks(page, "console")
        for line in block.splitlines()
        if line.startswith("robocup-vision")
    }
)
LINKS = [
    (name_of(page), target)
    for page in PAGES
    for target in re.findall(r"\]\(([^)\s]+)\)", text_of(page))
    if not target.startswith("https://")
]


@pytest.mark.slow
@pytest.mark.parametrize("program", PROGRAMS)
def test_programs_run(program, tmp_path):
    shutil.copytree(ROOT / "images", tmp_path / "images")  # what a program writes goes there, too
    run = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert run.stdout


@pytest.mark.parametrize("command", COMMANDS)
def test_commands_are_understood(command):
    name, *arguments = shlex.split(command)
    assert name == "robocup-vision"
    assert cli._parser().parse_args(arguments).run


@pytest.mark.parametrize(("page", "target"), LINKS)
def test_links_lead_to_files_and_headings(page, target):
    path, _, heading = target.partition("#")
    linked = (ROOT / page).parent / path if path else ROOT / page
    assert linked.exists()
    if heading:
        text = text_of(linked)
        headings = [re.sub(r"[^\w\- ]", "", line.lstrip("# ")).lower() for line in re.findall(r"^#+ .*$", text, re.M)]
        assert f"({heading})=" in text or heading in [one.replace(" ", "-") for one in headings]

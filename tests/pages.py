"""Finds the programs, commands, example files, key tables and links of a page, for the tests of README and docs/."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", *sorted(DOCS.rglob("*.md"))]


def name_of(page):
    return page.relative_to(ROOT).as_posix()


def text_of(page):
    return page.read_text(encoding="utf-8")


def blocks(page, language):
    """Return the contents of a page's fenced blocks of one language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", text_of(page), flags=re.MULTILINE | re.DOTALL)


def example_files(page):
    """Return the example files of a page by name; each stands below a comment with its name."""
    found = re.findall(r"^<!-- file: (.+?) -->\n```\w+\n(.*?)^```$", text_of(page), flags=re.MULTILINE | re.DOTALL)
    return dict(found)


def key_tables(page):
    """Return the keys in the first column of each marked table of a page, by the name in its mark."""
    tables = {}
    for name, table in re.findall(r"^<!-- keys: (.+?) -->\n\n((?:\|.*\n)+)", text_of(page), flags=re.MULTILINE):
        rows = table.splitlines()[2:]
        tables[name] = [key for row in rows for key in re.findall(r"`([^`]+)`", row.split("|")[1])]
    return tables

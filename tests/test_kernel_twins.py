"""Every public kernel is held against plain code: this test lists them all, and fails for one without."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = ("robocup_vision/kernels", "sim2d/kernels")


def kernels() -> list[tuple[str, str]]:
    """Return (module, name) of every public compiled function."""
    found = []
    for room in ROOMS:
        for path in sorted((ROOT / room).rglob("*.py")):
            for node in ast.parse(path.read_text(encoding="utf-8")).body:
                is_compiled = isinstance(node, ast.FunctionDef) and any(
                    ast.unparse(decorator).startswith("compiled") for decorator in node.decorator_list
                )
                if is_compiled and not node.name.startswith("_"):
                    found.append((str(path.relative_to(ROOT).with_suffix("")), node.name))
    return found


def called(path: Path) -> set[str]:
    """Names of the functions that a test module calls, imports or hands on."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Attribute):
            names.add(node.attr)
        elif isinstance(node, ast.Name):
            names.add(node.id)
    return names


TESTED = {room: set().union(*(called(path) for path in (ROOT / "tests" / room).rglob("test_*.py"))) for room in ROOMS}


def test_there_are_kernels():
    assert len(kernels()) > 100


@pytest.mark.parametrize(("module", "name"), kernels())
def test_a_kernel_is_held_against_plain_code(module, name):
    room = next(room for room in ROOMS if module.startswith(room))
    assert name in TESTED[room], f"tests/{room} compare no plain twin with {module}.{name}"

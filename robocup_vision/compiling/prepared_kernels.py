"""Compiles, or loads from the disk's cache, all loops that an object's calls can reach, so that no call waits for it.

numba compiles a loop when it is first called with arguments of some types. `signatures.json` beside the kernels lists
those types for each kind of object, loops that take long to compile first; ``python tests/kernel_workloads.py`` writes
it.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Iterator
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from typing import Any

from robocup_vision.compiling.listed_loop import prepare_kernel, quick_compiling
from robocup_vision.compiling.second_process import Entry, second_process
from robocup_vision.compiling.waiting import note_ready

SIGNATURES = Path(__file__).parents[1] / "kernels" / "signatures.json"


@cache
def prepare(group: str) -> None:
    """Compile or load the loops of one kind of object; a group that is not listed has none.

    Parameters
    ----------
    group : str
        Name in `groups`, such as ``mirror_field`` or ``steering``.
    """
    entries = _listed().get(group, [])
    # the shortest first, as one that is not in the cache says that a second process is of use; that takes the longest
    waiting = deque(entries)
    with quick_compiling(), ExitStack() as beside:
        is_alone = True
        for entry in _from_the_end(waiting):
            note_ready(len(entries) - len(waiting) - 1, len(entries))
            if prepare_kernel(*entry) and is_alone:
                beside.enter_context(second_process(waiting))
                is_alone = False
    with quick_compiling():
        for kernel, arguments in entries:
            prepare_kernel(kernel, arguments)
    note_ready(len(entries), len(entries))


def _from_the_end(waiting: deque[Entry]) -> Iterator[Entry]:
    while True:
        try:
            yield waiting.pop()
        except IndexError:  # the second process may take the last one
            return


def groups() -> dict[str, list[tuple[str, list[Any]]]]:
    """Return for each kind of object the loops that its calls reach: module and name, and types of the arguments."""
    return dict(_listed())


def modules() -> dict[str, list[tuple[str, list[Any]]]]:
    """Return what `groups` lists, each entry once, by the module that it stands in; the longest modules first."""
    unique = {(kernel, json.dumps(arguments)) for entries in _listed().values() for kernel, arguments in entries}
    found: dict[str, list[tuple[str, list[Any]]]] = {}
    for kernel, arguments in sorted(unique):
        found.setdefault(kernel.rpartition(".")[0], []).append((kernel, json.loads(arguments)))
    return dict(sorted(found.items(), key=lambda item: -_length(item[0])))


def _length(module: str) -> int:
    return SIGNATURES.parent.joinpath(*module.split(".")).with_suffix(".py").stat().st_size


def prepare_module(module: str) -> None:
    """Compile or load the loops of one module, as `modules` lists them."""
    with quick_compiling():
        for kernel, arguments in modules()[module]:
            prepare_kernel(kernel, arguments)


@cache
def _listed() -> dict[str, list[tuple[str, list[Any]]]]:
    listed = json.loads(SIGNATURES.read_text(encoding="utf-8"))
    return {group: [(kernel, arguments) for kernel, arguments in entries] for group, entries in listed.items()}

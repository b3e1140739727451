"""What can be reached from an object by attributes, containers, closures, methods and array bases."""

import types

import numpy as np

# code and classes lead to all modules that are loaded, whoever holds them
_CODE = (type, types.ModuleType, types.BuiltinFunctionType, types.CodeType)
_PLAIN = (str, bytes, int, float, complex, bool, type(None))


def reachable(roots):
    """Return all that is found, in the order of the walk."""
    found, seen, waiting = [], set(), list(roots)
    while waiting:
        thing = waiting.pop()
        if isinstance(thing, (*_PLAIN, *_CODE)) or id(thing) in seen:
            continue
        seen.add(id(thing))
        found.append(thing)
        waiting += _parts(thing)
    return found


def _parts(thing):
    if isinstance(thing, dict):
        return [*thing.keys(), *thing.values()]
    if isinstance(thing, np.ndarray):
        return [thing.base, *(thing.ravel().tolist() if thing.dtype == object else [])]
    if isinstance(thing, types.FunctionType):
        cells = [cell.cell_contents for cell in thing.__closure__ or ()]
        return [*cells, *(thing.__defaults__ or ()), thing.__kwdefaults__, thing.__dict__]
    if isinstance(thing, types.MethodType):
        return [thing.__self__, thing.__func__]
    if isinstance(thing, types.GeneratorType):
        return list(thing.gi_frame.f_locals.values()) if thing.gi_frame else []
    parts = [vars(thing)] if hasattr(thing, "__dict__") else []
    for base in type(thing).__mro__:
        slots = base.__dict__.get("__slots__", ())
        parts += [getattr(thing, name, None) for name in ((slots,) if isinstance(slots, str) else slots)]
    if isinstance(thing, (list, tuple, set, frozenset)) or type(thing).__name__ == "deque":
        parts += list(thing)
    elif type(thing).__name__.endswith("iterator"):
        parts += list(thing.__reduce__())[1:]
    return parts

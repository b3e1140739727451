"""Mutations of files, arguments and frames for the fuzz tests; they depend on a generator alone, so runs repeat."""

import re

import numpy as np

from robocup_vision.geometry import Pose2

NUMBERS = (
    "0", "-1", "1", "-0.0", "1e-320", "1e308", "-1e308", "nan", "inf", "-inf", "9223372036854775807",
    "9223372036854775808", "-1e-9", "0.5", "1e6", "3.14159265358979", "true", '""', "[]", "{}", "[[[]]]", "'x'", "1e5",
    "0x7f", "1979-05-27", "256", "100000",
)  # fmt: skip
WORDS = (
    "",
    "omni",
    "pinhole",
    "..",
    "/",
    "a" * 300,
    "\x00",
    "é",
    "\ud7ff",
    "format",
    "=",
    ",",
    "\n",
    "#",
    '"',
    "[x]\n",
)


def mutate_text(text: str, rng: np.random.Generator) -> bytes:
    """Change one to four places of a text file: numbers, lines, words, single bytes."""
    for _ in range(rng.integers(1, 5)):
        kind = rng.integers(8)
        lines = text.split("\n")
        line = int(rng.integers(len(lines)))
        if kind <= 2:
            found = list(re.finditer(r"-?\d+\.?\d*(?:e-?\d+)?", text))
            if found:
                one = found[int(rng.integers(len(found)))]
                text = text[: one.start()] + str(rng.choice(NUMBERS)) + text[one.end() :]
        elif kind == 3:
            text = "\n".join(lines[:line] + lines[line + 1 :])
        elif kind == 4:
            text = "\n".join([*lines[: line + 1], *lines[line:]])
        elif kind == 5:
            place = int(rng.integers(len(text) + 1))
            text = text[:place] + str(rng.choice(WORDS)) + text[place:]
        elif kind == 6:
            start, end = sorted(rng.integers(0, len(text) + 1, 2).tolist())
            text = text[:start] + text[min(end, start + 20) :]
        else:
            other = int(rng.integers(len(lines)))
            lines[line], lines[other] = lines[other], lines[line]
            text = "\n".join(lines)
    raw = bytearray(text.encode("utf-8", "surrogatepass"))
    if raw and rng.random() < 0.1:
        raw[int(rng.integers(len(raw)))] = int(rng.integers(256))
    return bytes(raw)


def mutate_frame(frame: np.ndarray, rng: np.random.Generator) -> object:
    """Return a frame changed in its pixels, or in its type, size, layout or number of dimensions."""
    height, width, _ = frame.shape
    kind = int(rng.integers(16))
    if kind == 0:
        return frame.astype(rng.choice(["float32", "float64", "int16", "uint16", "bool", "int8"]))
    if kind == 1:
        rows, columns = int(rng.integers(0, 2 * height)), int(rng.integers(0, 2 * width))
        return np.resize(frame, (rows, columns, 3)) if rows * columns else np.empty((rows, columns, 3), np.uint8)
    if kind == 2:
        wrong = (
            None,
            b"",
            "frame",
            3,
            frame.tolist()[:2],
            frame[..., 0],
            frame[None],
            frame[..., :2],
            np.array(frame[0, 0]),
        )
        return wrong[int(rng.integers(len(wrong)))]
    if kind == 3:
        views = (frame[::-1], frame[:, ::-1], frame[..., ::-1], np.asfortranarray(frame), np.repeat(frame, 2, 0)[::2])
        return views[int(rng.integers(len(views)))]
    changed = frame.copy()
    if kind == 4:
        changed.flags.writeable = False
    elif kind == 5:
        changed[:] = rng.integers(0, 256, 3)
    elif kind == 6:
        rate = rng.random()
        changed[rng.random((height, width)) < rate] = rng.integers(0, 256, 3)
    elif kind == 7:
        changed = np.clip(changed + rng.normal(0, rng.uniform(0, 150), changed.shape), 0, 255).astype(np.uint8)
    elif kind == 8:
        top, left = int(rng.integers(height)), int(rng.integers(width))
        changed[top:, left:] = rng.integers(0, 256, 3)
    elif kind == 9:
        changed = np.roll(changed, rng.integers(0, (height, width)).tolist(), axis=(0, 1))
    elif kind == 10:
        changed = (changed * rng.uniform(0, 4, 3)).clip(0, 255).astype(np.uint8)
    elif kind == 11:
        changed = np.ascontiguousarray(changed[rng.permutation(height)])
    elif kind == 12:
        changed = 255 - changed
    elif kind == 13:
        changed[int(rng.integers(height)) :] = 0
    elif kind == 14:
        changed = np.where(rng.random(changed.shape) < 0.5, np.uint8(0), np.uint8(255))
    else:
        # bytes of a driver that are no array's own
        changed = np.frombuffer(changed.tobytes(), dtype=np.uint8).reshape(changed.shape)
    return changed


def strange_number(rng: np.random.Generator) -> object:
    """Return a number as wrong programs hand them over, mostly a right one."""
    strange = (
        float("nan"), float("inf"), -float("inf"), 1e308, -1e300, 1e-320, "1", None, [], True, 2**70, np.float32(1.0),
        np.int64(3), np.array(2.0), np.array([1.0, 2.0]), 1j,
    )  # fmt: skip
    return strange[int(rng.integers(len(strange)))] if rng.random() < 0.4 else float(rng.normal(0, 3))


def strange_pose(rng: np.random.Generator) -> object:
    """Return a pose as wrong programs hand them over, mostly a right one."""
    if rng.random() < 0.2:
        wrong = (None, (1.0, 2.0, 3.0), "pose", 0, np.zeros(3), np.eye(3))
        return wrong[int(rng.integers(len(wrong)))]
    if rng.random() < 0.3:
        return Pose2(*(strange_number(rng) for _ in range(3)))
    return Pose2(*rng.normal(0.0, rng.choice([0.01, 1.0, 1e3, 1e12]), 3).tolist())

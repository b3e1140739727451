"""Writes a chain of convolutions as an ONNX file, with the few protocol buffer messages that this needs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

# ONNX: version of the file format, set of operators, codes of the types float (tensors) and ints (attributes)
_IR_VERSION, _OPSET, _FLOAT, _INTS = 8, 13, 1, 7
_VARINT, _BYTES = 0, 2


class Convolution(NamedTuple):
    """One convolution; between two convolutions negative values are set to 0 (ReLU)."""

    #: (C, B, K, L) float64: kernels from B input channels to C output channels.
    weight: npt.NDArray[np.float64]
    #: (C,) float64: bias of each output channel.
    bias: npt.NDArray[np.float64]
    #: Stride along rows and columns.
    stride: int


def write_onnx(path: str | Path, layers: Sequence[Convolution]) -> None:
    """Write a network for one picture, (1, B, H, W) float32 of any height and width, without padding."""
    nodes, tensors = b"", b""
    name = "image"
    for number, layer in enumerate(layers):
        last = number == len(layers) - 1
        made = "answer" if last else f"c{number}"
        kernel = list(layer.weight.shape[2:])
        attributes = (("kernel_shape", kernel), ("strides", [layer.stride] * 2), ("pads", [0] * 4))
        nodes += _node("Conv", [name, f"w{number}", f"b{number}"], made, attributes)
        if not last:
            nodes += _node("Relu", [made], f"r{number}", ())
        name = f"r{number}"
        tensors += _tensor(f"w{number}", layer.weight) + _tensor(f"b{number}", layer.bias)
    graph = nodes + _text(2, "chain") + tensors
    graph += _value(11, "image", [1, layers[0].weight.shape[1], "height", "width"])
    graph += _value(12, "answer", [1, layers[-1].weight.shape[0], "rows", "columns"])
    model = _number(1, _IR_VERSION) + _text(2, "robocup-vision") + _block(7, graph) + _block(8, _number(2, _OPSET))
    Path(path).write_bytes(model)


def _varint(value: int) -> bytes:
    parts = []
    while value > 127:
        parts.append(value & 127 | 128)
        value >>= 7
    return bytes((*parts, value))


def _number(field: int, value: int) -> bytes:
    return _varint(field << 3 | _VARINT) + _varint(value)


def _block(field: int, content: bytes) -> bytes:
    return _varint(field << 3 | _BYTES) + _varint(len(content)) + content


def _text(field: int, text: str) -> bytes:
    return _block(field, text.encode())


def _node(kind: str, inputs: Sequence[str], output: str, attributes: Sequence[tuple[str, list[int]]]) -> bytes:
    content = b"".join(_text(1, name) for name in inputs) + _text(2, output) + _text(3, output) + _text(4, kind)
    for name, values in attributes:
        numbers = b"".join(_number(8, value) for value in values)
        content += _block(5, _text(1, name) + numbers + _number(20, _INTS))
    return _block(1, content)


def _tensor(name: str, values: npt.NDArray[np.float64]) -> bytes:
    shape = b"".join(_number(1, side) for side in values.shape)
    raw = np.ascontiguousarray(values, dtype="<f4").tobytes()
    return _block(5, shape + _number(2, _FLOAT) + _text(8, name) + _block(9, raw))


def _value(field: int, name: str, shape: Sequence[Any]) -> bytes:
    sides = b"".join(_block(1, _text(2, side) if isinstance(side, str) else _number(1, side)) for side in shape)
    return _block(field, _text(1, name) + _block(2, _block(1, _number(1, _FLOAT) + _block(2, sides))))

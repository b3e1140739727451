"""Chains of convolutions: made, trained and written as ONNX files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import torch

from sim2d.training.onnx_file import Convolution, write_onnx

# what pictures are shifted and scaled by before the first convolution takes that over
_INPUT_MEAN, _INPUT_STD = 110.0, 60.0
_RATE, _DECAY = 3e-3, 1e-3
_TELL_EACH = 250


def normal(pixels: torch.Tensor) -> torch.Tensor:
    """Return pictures, 0 to 255, as a chain takes them while it is trained."""
    return (pixels - _INPUT_MEAN) / _INPUT_STD


def chain(layers: Sequence[tuple[int, int | tuple[int, int], int]], answers: int) -> torch.nn.Sequential:
    """Make a chain of convolutions, given as channels, kernel and stride of each; a 1 x 1 to the answers follows."""
    parts: list[torch.nn.Module] = []
    before = 3
    for channels, kernel, stride in layers:
        parts += [torch.nn.Conv2d(before, channels, kernel, stride), torch.nn.ReLU()]
        before = channels
    parts.append(torch.nn.Conv2d(before, answers, 1))
    return torch.nn.Sequential(*parts)


def learn(
    parameters: Sequence[torch.nn.Parameter],
    loss_of: Callable[[int], torch.Tensor],
    steps: int,
    tell: Callable[[str], None],
) -> None:
    """Change parameters so that a loss becomes small.

    Parameters
    ----------
    loss_of : callable
        Gets a step's number and returns the loss of one batch.
    steps : int
        How many batches are learnt from.
    tell : callable
        Gets a line now and then.
    """
    optimizer = torch.optim.AdamW(parameters, lr=_RATE, weight_decay=_DECAY)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, _RATE, total_steps=steps, pct_start=0.1)
    losses = []
    for step in range(steps):
        loss = loss_of(step)
        optimizer.zero_grad()
        torch.autograd.backward(loss)
        optimizer.step()
        schedule.step()
        losses.append(float(loss.detach()))
        if (step + 1) % _TELL_EACH == 0:
            tell(f"step {step + 1} of {steps}: loss {np.mean(losses[-_TELL_EACH:]):.4f}")


def write_chain(path: Path, network: torch.nn.Sequential) -> None:
    """Write a chain as an ONNX file that takes pictures as they are, 0 to 255."""
    layers: list[Convolution] = []
    for part in network:
        if isinstance(part, torch.nn.Conv2d):
            weight, bias = (part.get_parameter(name).detach().double().numpy() for name in ("weight", "bias"))
            if not layers:
                bias = bias - weight.sum(axis=(1, 2, 3)) * _INPUT_MEAN / _INPUT_STD
                weight = weight / _INPUT_STD
            layers.append(Convolution(weight, bias, part.stride[0]))
    write_onnx(path, layers)

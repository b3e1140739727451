"""Makes chains of convolutions, trains them on pictures under varied light, and writes them as ONNX files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional

from sim2d.training.onnx_file import Convolution, write_onnx

# normalisation of pictures in training; in files it is part of the first convolution
_INPUT_MEAN, _INPUT_STD = 110.0, 60.0
_RATE, _DECAY = 3e-3, 1e-3
_TELL_EACH = 250


def normal(pixels: torch.Tensor) -> torch.Tensor:
    """Normalise pictures, 0 to 255, for a chain in training."""
    return (pixels - _INPUT_MEAN) / _INPUT_STD


def chain(layers: Sequence[tuple[int, int | tuple[int, int], int]], answers: int) -> torch.nn.Sequential:
    """Make a chain of convolutions from the channels, kernel and stride of each, with a final 1 x 1 to the outputs."""
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
    """Optimise parameters to minimise a loss.

    Parameters
    ----------
    loss_of : callable
        Takes the number of a step and returns the loss of one batch.
    steps : int
        Number of steps, each with one batch.
    tell : callable
        Called periodically with a line of progress.
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
    """Write a chain as an ONNX file for pictures without normalisation, 0 to 255."""
    layers: list[Convolution] = []
    for part in network:
        if isinstance(part, torch.nn.Conv2d):
            weight, bias = (part.get_parameter(name).detach().double().numpy() for name in ("weight", "bias"))
            if not layers:
                bias = bias - weight.sum(axis=(1, 2, 3)) * _INPUT_MEAN / _INPUT_STD
                weight = weight / _INPUT_STD
            layers.append(Convolution(weight, bias, part.stride[0]))
    write_onnx(path, layers)


def uniform(count: int, low: float, high: float) -> torch.Tensor:
    """Draw uniform random numbers (count,) between two bounds."""
    return low + (high - low) * torch.rand(count)


def relit(pixels: torch.Tensor) -> torch.Tensor:
    """Randomly shift the hues of pictures (N, 3, H, W) by up to 14 degrees; vary saturation, cast, light and noise."""
    count = len(pixels)
    hue, saturation = uniform(count, -0.245, 0.245), uniform(count, 0.65, 1.25)
    # rotation about the grey axis, scaled across it
    axis = torch.full((3, 3), 1.0 / 3.0)
    cross = torch.tensor([[0.0, -1.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 1.0, 0.0]]) / 3**0.5
    c, s = (saturation * torch.cos(hue))[:, None, None], (saturation * torch.sin(hue))[:, None, None]
    mixed = axis + c * (torch.eye(3) - axis) + s * cross
    cast = torch.where(torch.rand(count, 1, 1) < 0.2, 0.2, 0.06)
    gain = torch.exp(0.12 * torch.randn(count, 1, 1) + cast * torch.randn(count, 3, 1))
    lit = torch.einsum("nij,njhw->nihw", gain * mixed, pixels).clamp(0, 255)
    gamma = torch.exp(0.15 * torch.randn(count, 1, 1, 1))
    lit = 255 * (lit / 255 + 1e-4) ** gamma
    return (lit + uniform(count, 0.0, 5.0)[:, None, None, None] * torch.randn_like(lit)).clamp(0, 255)


def blurred(pixels: torch.Tensor) -> torch.Tensor:
    """Blur a random part of the pictures (N, 3, H, W) as by a lens or by motion."""
    count = len(pixels)
    kernels = torch.zeros(count, 5, 5)
    kernels[:, 2, 2] = 1.0
    at = torch.arange(5.0) - 2
    square = at[:, None] ** 2 + at[None] ** 2
    kind = torch.rand(count)
    soft = torch.exp(-square / (2 * uniform(count, 0.3, 1.1)[:, None, None] ** 2))
    kernels = torch.where((kind < 0.4)[:, None, None], soft, kernels)
    turn = uniform(count, -0.5, 0.5)[:, None, None]
    across = at[:, None] * torch.cos(turn) - at[None] * torch.sin(turn)
    along = torch.exp(-(across**2) / 0.5) * (at[None].abs() <= uniform(count, 0.5, 2.5)[:, None, None])
    kernels = torch.where((kind > 0.88)[:, None, None], along, kernels)
    kernels = (kernels / kernels.sum(dim=(1, 2), keepdim=True)).repeat_interleave(3, dim=0)[:, None]
    padded = functional.pad(pixels.reshape(1, 3 * count, *pixels.shape[2:]), (2, 2, 2, 2), mode="replicate")
    return functional.conv2d(padded, kernels, groups=3 * count).reshape(pixels.shape)

"""Pictures in another light, and less sharp, for networks to learn from."""

from __future__ import annotations

import torch
from torch.nn import functional


def uniform(count: int, low: float, high: float) -> torch.Tensor:
    """Draw numbers (count,) between two bounds."""
    return low + (high - low) * torch.rand(count)


def relit(pixels: torch.Tensor) -> torch.Tensor:
    """Turn hues of pictures (N, 3, H, W) by 14 degrees at most; change saturation, cast, brightness and noise."""
    count = len(pixels)
    hue, saturation = uniform(count, -0.245, 0.245), uniform(count, 0.65, 1.25)
    # a turn about the grey axis, shrunk across it
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
    """Blur some of pictures (N, 3, H, W) by a lens or by motion."""
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

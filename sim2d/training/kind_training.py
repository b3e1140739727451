"""Trains the kind classifier on photographs (extra `train`)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional

from robocup_vision.perception.kinds.network import FOOT_PX, SEEN_PX
from sim2d.training.chains import blurred, chain, learn, normal, relit, uniform, write_chain
from sim2d.training.kind_crops import OTHER, RIM_PX, KindCrops

# channels, kernels and strides of the convolutions; a 1 x 1 to the outputs follows
LAYERS = ((10, 4, 2), (14, 3, 1), (20, 3, 2), (24, 3, 1), (20, 3, 2), (16, (3, 2), 1))
# size of a batch, and its fractions of robots, people and other places
_BATCH, _PARTS = 96, (0.3, 0.3, 0.4)
_SMOOTHING = 0.02
# largest random shifts of the feet aside and upright, pixels, and largest random scaling, as a logarithm
_ASIDE_PX, _UPRIGHT_PX, _SCALE_SPREAD = 4.0, 2.0, 0.2


def train(
    path: str | Path,
    crops: KindCrops,
    *,
    seed: int,
    steps: int,
    tell: Callable[[str], None] = print,
) -> None:
    """Train the classifier and write it.

    Parameters
    ----------
    crops : KindCrops
        Training data, with crops of every kind.
    steps : int
        Number of steps, each with one batch.
    tell : callable
        Called periodically with a line of progress.
    """
    rng = np.random.default_rng(seed)
    torch.manual_seed(seed)
    network = chain(LAYERS, OTHER + 1)
    images = torch.from_numpy(crops.images)
    of_kind = [np.flatnonzero(crops.kinds == kind) for kind in range(OTHER + 1)]
    counts = [round(part * _BATCH) for part in _PARTS]
    kinds = torch.repeat_interleave(torch.arange(OTHER + 1), torch.tensor(counts))

    def loss_of(_: int) -> torch.Tensor:
        chosen = np.concatenate([rng.choice(which, count) for which, count in zip(of_kind, counts, strict=True)])
        answers = network(_varied(images[torch.from_numpy(chosen)])).reshape(len(kinds), -1)
        return functional.cross_entropy(answers, kinds, label_smoothing=_SMOOTHING)

    learn(list(network.parameters()), loss_of, steps, tell)
    write_chain(Path(path), network)


def _varied(images: torch.Tensor) -> torch.Tensor:
    """Randomly shift, scale and mirror crops about their feet, and vary their light and sharpness."""
    count, height, width = images.shape[:3]
    pixels = images.permute(0, 3, 1, 2).float()
    scale = torch.exp(uniform(count, -_SCALE_SPREAD, _SCALE_SPREAD))
    flip = torch.where(torch.rand(count) < 0.5, -1.0, 1.0)
    seen_width, seen_height = SEEN_PX
    # coordinates in the crop of the network's input pixels, which are counted from the foot
    across = torch.arange(seen_width) - (seen_width - 1) / 2
    down = torch.arange(seen_height) - (seen_height - 1.0 - FOOT_PX)
    at_u = (width - 1) / 2 + (flip * scale)[:, None] * across + uniform(count, -_ASIDE_PX, _ASIDE_PX)[:, None]
    foot = height - 1.0 - RIM_PX - FOOT_PX
    at_v = foot + scale[:, None] * down + uniform(count, -_UPRIGHT_PX, _UPRIGHT_PX)[:, None]
    grid = torch.stack(
        [
            ((2 * at_u + 1) / width - 1)[:, None, :].expand(-1, seen_height, -1),
            ((2 * at_v + 1) / height - 1)[:, :, None].expand(-1, -1, seen_width),
        ],
        dim=-1,
    )
    seen = functional.grid_sample(pixels, grid, mode="bilinear", padding_mode="zeros", align_corners=False)
    return normal(relit(blurred(seen)))

"""Trains the ball classifier with renderings and photographs (extra `train`)."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch.nn import functional

from robocup_vision.evaluation.dataset import Dataset
from robocup_vision.perception.balls.network import (
    CROP_PX,
    CROP_RADIUS_PX,
    FIRST_PX,
    STRIDE_PX,
    STRIP_RADIUS_PX,
    BallNetwork,
)
from robocup_vision.perception.networks import Shrunk
from sim2d.training.ball_crops import (
    BANK_PX,
    Crops,
    Picture,
    apart,
    cut,
    joined,
    mistaken_crops,
    picture_crops,
    pictures_of,
    rendered_pictures,
    scene_crops,
)
from sim2d.training.ball_scenes import Scene, draw_scene
from sim2d.training.chains import blurred, chain, learn, normal, relit, uniform, write_chain

# channels, kernels and strides of the convolutions; a 1 x 1 to the three answers follows
FIRST_LAYERS = ((8, 3, 2), (16, 3, 2), (24, 3, 1))
SECOND_LAYERS = ((12, 3, 2), (16, 3, 1), (24, 3, 2), (32, 3, 1), (24, 4, 1))
# side of the first network's input, pixels of its strips
_STRIP_PX = 15
# crops per batch, ratio of balls among them, weight of the error of the ball's centre in the loss
_BATCH, _BALLS, _OFFSET_WEIGHT = 160, 0.3, 0.05
# augmentation: greatest shift of balls and of other crops, in radii, and greatest logarithm of the scale
_SHIFT_RADII, _OTHER_SHIFT_RADII, _SCALE_SPREAD = 0.63, 0.3, 0.28
# ratio of crops that are partly covered
_COVERED_RATIO = 0.25
# numbers of negative crops per scene and per picture, and of false positives per picture
_OTHERS, _PICTURE_OTHERS, _MISTAKEN = 12, 150, 60
# fractions of scenes, whole fields and photographs in a batch
_FRACTIONS = (0.33, 0.17, 0.5)
# fractions of the training after which false positives are searched and added (hard negative mining)
_MINE_AT = (0.35, 0.65)
# ratio of balls that the first network may miss; its bias is shifted so that its threshold 0 has this ratio
_MISSED_RATIO = 0.02


class Material(NamedTuple):
    """The training material."""

    scenes: list[Scene]
    fields: list[Picture]
    photographs: list[Picture]


def material(rng: np.random.Generator, scenes: int, fields: int, photographs: Sequence[Dataset]) -> Material:
    """Draw scenes and pictures of whole fields, and read photographs."""
    return Material(
        [draw_scene(rng) for _ in range(scenes)],
        rendered_pictures(rng, fields),
        [one for dataset in photographs for one in pictures_of(dataset)],
    )


def train(folder: str | Path, known: Material, *, seed: int, steps: int, tell: Callable[[str], None] = print) -> None:
    """Train the classifier and write its two networks as places.onnx and ball.onnx.

    Parameters
    ----------
    steps : int
        Number of batches.
    tell : callable
        Called with a line of progress from time to time.
    """
    rng = np.random.default_rng(seed)
    torch.manual_seed(seed)
    crops = [scene_crops(rng, known.scenes, _OTHERS), picture_crops(rng, known.fields, _PICTURE_OTHERS)]
    if known.photographs:
        crops.append(picture_crops(rng, known.photographs, _PICTURE_OTHERS))
    banks = [_Bank(one) for one in crops]
    counts = [round(fraction * _BATCH / sum(_FRACTIONS[: len(banks)])) for fraction in _FRACTIONS[: len(banks)]]
    tell("; ".join(f"{int(one.is_ball.sum())} balls, {int((~one.is_ball).sum())} others" for one in crops))
    first, second = chain(FIRST_LAYERS, 3), chain(SECOND_LAYERS, 3)
    mine_at = [round(part * steps) for part in _MINE_AT]

    def loss_of(step: int) -> torch.Tensor:
        if step in mine_at:
            banks[0].add(_mistaken_in_scenes(known.scenes, first))
            for bank, pictures in zip(banks[1:], (known.fields, known.photographs), strict=False):
                bank.add(mistaken_crops(pictures, _ball_network(first, second), _MISTAKEN))
        chosen = [bank.choose(rng, count) for bank, count in zip(banks, counts, strict=True)]
        images = torch.cat([bank.images[one] for bank, one in zip(banks, chosen, strict=True)])
        is_ball = torch.cat([bank.is_ball[one] for bank, one in zip(banks, chosen, strict=True)])
        seen, off = _varied(images, is_ball)
        loss, each = _loss(first(_strips(seen)), second(seen), is_ball, off)
        for bank, one, loss_each in zip(banks, chosen, torch.split(each, counts), strict=True):
            bank.losses[one] = 0.5 * bank.losses[one] + 0.5 * loss_each
        return loss

    learn([*first.parameters(), *second.parameters()], loss_of, steps, tell)
    with torch.no_grad():
        first[-1].get_parameter("bias")[0] -= _missed_nats(first, banks)
    _write(Path(folder), first, second)


class _Bank:
    """Crops of one source; half of each choice is from the crops with the greatest losses."""

    def __init__(self, crops: Crops) -> None:
        self.images, self.is_ball = torch.from_numpy(crops.images), torch.from_numpy(crops.is_ball)
        self.losses = torch.ones(len(self.images))

    def add(self, crops: Crops) -> None:
        self.images = torch.cat([self.images, torch.from_numpy(crops.images)])
        self.is_ball = torch.cat([self.is_ball, torch.from_numpy(crops.is_ball)])
        self.losses = torch.cat([self.losses, torch.ones(len(crops.images))])

    def choose(self, rng: np.random.Generator, count: int) -> torch.Tensor:
        balls, others = (torch.nonzero(which)[:, 0] for which in (self.is_ball, ~self.is_ball))
        parts = []
        for which, wanted in ((balls, round(_BALLS * count)), (others, count - round(_BALLS * count))):
            hard = wanted // 2
            plain = torch.from_numpy(rng.integers(0, len(which), wanted - hard))
            order = self.losses[which].topk(max(len(which) // 8, 1)).indices
            parts += [which[plain], which[order[torch.from_numpy(rng.integers(0, len(order), hard))]]]
        return torch.cat(parts)


def _loss(
    first: torch.Tensor, second: torch.Tensor, is_ball: torch.Tensor, off: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """Return the loss (cross entropy of both networks, error of the balls' centres), and each crop's cross entropy."""
    target = is_ball.float()
    ratio = STRIP_RADIUS_PX / CROP_RADIUS_PX
    each = torch.zeros(len(is_ball))
    away = torch.zeros(())
    for answer, scale in ((first, ratio), (second, 1.0)):
        flat = answer.reshape(len(answer), 3)
        each = each + functional.binary_cross_entropy_with_logits(flat[:, 0], target, reduction="none")
        miss = (flat[:, 1:] - scale * off).abs().sum(dim=1) / scale
        away = away + (miss * target).mean()
    return each.mean() + _OFFSET_WEIGHT * away, each.detach()


def _varied(images: torch.Tensor, is_ball: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Augment crops: shift, scale, mirror, cover, blur and relight them; return them and the offsets of the balls."""
    count = len(images)
    pixels = images.permute(0, 3, 1, 2).float()
    scale = torch.exp(uniform(count, -_SCALE_SPREAD, _SCALE_SPREAD))
    flip = torch.where(torch.rand(count) < 0.5, -1.0, 1.0)
    reach = torch.where(is_ball, _SHIFT_RADII, _OTHER_SHIFT_RADII) * CROP_RADIUS_PX
    # uniform in a square whose side is twice the greatest shift
    shift = (2 * torch.rand(count, 2) - 1) * reach[:, None]
    step = 2.0 / BANK_PX
    turned = torch.zeros(count, 2, 3)
    turned[:, 0, 0], turned[:, 1, 1] = flip * scale * CROP_PX / BANK_PX, scale * CROP_PX / BANK_PX
    turned[:, 0, 2], turned[:, 1, 2] = shift[:, 0] * step, shift[:, 1] * step
    grid = functional.affine_grid(turned, [count, 3, CROP_PX, CROP_PX], align_corners=False)
    seen = functional.grid_sample(pixels, grid, mode="bilinear", padding_mode="zeros", align_corners=False)
    off = -shift / scale[:, None]
    off[:, 0] *= flip
    seen = relit(blurred(_covered(seen)))
    return normal(seen), off


def _covered(pixels: torch.Tensor) -> torch.Tensor:
    """Cover some crops on one side of a straight edge, as robots and the rim of a lens do."""
    count, _, side, _ = pixels.shape
    at = torch.arange(side) - (side - 1) / 2
    turn = uniform(count, 0.0, 2 * np.pi)[:, None, None]
    across = at[None, :, None] * torch.sin(turn) + at[None, None, :] * torch.cos(turn)
    free = uniform(count, -0.2, 2.5)[:, None, None] * CROP_RADIUS_PX
    is_covered = (across > free) & (torch.rand(count) < _COVERED_RATIO)[:, None, None]
    shade = uniform(count, 0.0, 45.0)[:, None, None, None] + 6.0 * torch.randn(count, 3, 1, 1)
    return torch.where(is_covered[:, None], shade.clamp(min=0.0), pixels)


def _strips(seen: torch.Tensor) -> torch.Tensor:
    """Return the middle of crops at the scale of the first network's input."""
    side = round(CROP_PX * STRIP_RADIUS_PX / CROP_RADIUS_PX)
    small = functional.interpolate(seen, size=(side, side), mode="bilinear", antialias=True, align_corners=False)
    rim = (side - _STRIP_PX) // 2
    return small[:, :, rim : rim + _STRIP_PX, rim : rim + _STRIP_PX]


def _mistaken_in_scenes(scenes: Sequence[Scene], first: torch.nn.Sequential) -> Crops:
    """Cut out the false positives of each scene in which the first network is most confident."""
    parts = []
    scale = CROP_RADIUS_PX / STRIP_RADIUS_PX
    for scene in scenes:
        shrunk = Shrunk(scene.image)
        size = (round(scene.image.shape[1] / scale), round(scene.image.shape[0] / scale))
        small = torch.from_numpy(shrunk.part(0.0, 0.0, scale, size)).permute(2, 0, 1).float()[None]
        with torch.no_grad():
            answer = first(normal(small))[0].numpy()
        rows, columns = np.unravel_index(np.argsort(-answer[0], axis=None)[:40], answer[0].shape)
        u = scale * (FIRST_PX + STRIDE_PX * columns + answer[1, rows, columns])
        v = scale * (FIRST_PX + STRIDE_PX * rows + answer[2, rows, columns])
        places = np.stack([u, v, np.full(len(u), CROP_RADIUS_PX)], axis=-1)
        balls = np.concatenate([scene.balls, scene.unsure])
        parts.append(cut(shrunk, scene.balls[:0], balls, places[apart(places, balls)][:5]))
    return joined(parts)


def _missed_nats(first: torch.nn.Sequential, banks: Sequence[_Bank]) -> float:
    """Return the quantile `_MISSED_RATIO` of the first network's answers for balls of the last source."""
    last = banks[-1]
    balls = last.images[last.is_ball]
    answers = []
    with torch.no_grad():
        for _ in range(max(2000 // len(balls), 1)):
            seen, _ = _varied(balls, torch.ones(len(balls), dtype=torch.bool))
            answers.append(first(_strips(seen))[:, 0].flatten())
    return float(torch.cat(answers).quantile(_MISSED_RATIO))


def _ball_network(first: torch.nn.Sequential, second: torch.nn.Sequential) -> BallNetwork:
    with tempfile.TemporaryDirectory() as folder:
        _write(Path(folder), first, second)
        return BallNetwork(*((Path(folder) / name).read_bytes() for name in ("places.onnx", "ball.onnx")))


def _write(folder: Path, first: torch.nn.Sequential, second: torch.nn.Sequential) -> None:
    write_chain(folder / "places.onnx", first)
    write_chain(folder / "ball.onnx", second)

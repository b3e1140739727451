"""A dataset whose frames are read in order, from a recording or a bag."""

from __future__ import annotations

import bisect
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from field_models.errors import FileError, FrameError
from robocup_vision.arrays import UInt8Array
from robocup_vision.evaluation.dataset import Dataset, FrameTime, Truth
from robocup_vision.geometry import wrap_angle

# poses farther apart than this do not tell where the robot was between them
MAX_GAP_S = 0.5

Frames = Iterator[UInt8Array | FrameError]
Poses = Sequence[tuple[float, Truth | None]]


def _nothing() -> Frames:
    return iter(())


@dataclass(frozen=True, eq=False)
class StreamDataset(Dataset):
    """A dataset whose frames are read in order, from a recording or a bag."""

    open_frames: Callable[[], Frames] = _nothing  #: returns the frames from the first on

    @property
    def is_video(self) -> bool:
        """Whether the frames can only be read from the beginning."""
        return True

    def read_frames(self) -> Frames:
        """Read all frames; where one cannot be used, yield the error in its place."""
        width, height = self.camera.size_px
        for name, frame in zip(self.image_names, self.open_frames(), strict=False):
            if isinstance(frame, FrameError) or frame.shape == (height, width, 3):
                yield frame
            else:
                got = f"{frame.shape[1]}x{frame.shape[0]}"
                yield FrameError(f"{name}: is {got}, the camera file says {width}x{height}")


def with_frames(
    plain: StreamDataset,
    count: int,
    kept: Sequence[int],
    times: Sequence[FrameTime],
    frames: Callable[[], Frames],
    truth: Poses,
    notes: Sequence[str],
) -> StreamDataset:
    """Return the dataset with those of `count` frames that are kept, and the times of these."""
    if not kept:
        raise FileError(plain.path, "holds no frame")
    names = [f"frame_{index:06d}" for index in kept]
    true_poses = {name: pose_at(truth, time.t_s) for name, time in zip(names, times, strict=True)}
    chosen = frozenset(kept)

    def kept_frames() -> Frames:
        return (frame for index, frame in enumerate(frames()) if index in chosen)

    return replace(
        plain,
        image_names=tuple(names),
        times=dict(zip(names, times, strict=True)),
        truth={name: there for name, there in true_poses.items() if there is not None},
        notes=tuple(notes),
        open_frames=kept_frames,
        left_out=count - len(kept),
    )


def pose_at(poses: Poses, t_s: float) -> Truth | None:
    """Return the pose at a time, between the two that are nearest to it.

    Parameters
    ----------
    poses : sequence of (float, Truth or None)
        By ascending time, seconds; None where nobody knew it.

    Returns
    -------
    Truth or None
        None beyond the first and last one by more than 0.1 ms, between two that are more than 0.5 s apart, and where
        one of the two is None. Without a heading where one of the two has none.
    """
    slack_s = 1e-4
    at = bisect.bisect_left(poses, t_s, key=lambda pose: pose[0])
    near = [poses[index] for index in (at - 1, at) if 0 <= index < len(poses)]
    for near_s, pose in near:
        if abs(near_s - t_s) <= slack_s:
            return pose
    if len(near) < 2 or near[1][0] - near[0][0] > MAX_GAP_S:
        return None
    (a_s, a), (b_s, b) = near
    if a is None or b is None:
        return None
    part = (t_s - a_s) / (b_s - a_s)
    heading_rad = None
    if a.theta_rad is not None and b.theta_rad is not None:
        heading_rad = wrap_angle(a.theta_rad + part * wrap_angle(b.theta_rad - a.theta_rad))
    return Truth(a.x_m + part * (b.x_m - a.x_m), a.y_m + part * (b.y_m - a.y_m), heading_rad)


def order_note(where: str, times_s: Sequence[float], kept: Sequence[int]) -> list[str]:
    """Say which frames are not later than those before."""
    left_out = sorted(set(range(len(times_s))) - set(kept))
    if not left_out:
        return []
    first = times_s[left_out[0]]
    return [
        f"{where}: {len(left_out)} of {len(times_s)} frames are not in the order of time (the first: {first:.3f} s):"
        " left out"
    ]

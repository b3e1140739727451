"""A dataset whose frames are read in order, from a recording or a bag."""

from __future__ import annotations

import bisect
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from field_models.errors import FileError, FrameError
from robocup_vision.arrays import UInt8Array
from robocup_vision.evaluation.dataset import Dataset, FrameTime, Truth
from robocup_vision.geometry import wrap_angle

# longest time between two poses that is interpolated
MAX_GAP_S = 0.5
# a pose within this time is used without interpolation
_SAME_TIME_S = 1e-4

Frames = Iterator[UInt8Array | FrameError]
Poses = Sequence[tuple[float, Truth | None]]


def _nothing() -> Frames:
    return iter(())


@dataclass(frozen=True, eq=False)
class StreamDataset(Dataset):
    """A dataset whose frames are read in order, from a recording or a bag."""

    open_frames: Callable[[], Frames] = _nothing  #: returns an iterator over the frames, from the first on

    @property
    def is_video(self) -> bool:
        """Whether the frames can only be read from the beginning."""
        return True

    def read_frames(self) -> Frames:
        """Read all frames; for one that cannot be used, yield the error instead."""
        width, height = self.camera.size_px
        for name, frame in zip(self.image_names, self.open_frames(), strict=False):
            if isinstance(frame, FrameError) or frame.shape == (height, width, 3):
                yield frame
            else:
                got = f"{frame.shape[1]}x{frame.shape[0]}"
                yield FrameError(f"{name}: is {got}, the camera file says {width}x{height}")


def with_frames(
    dataset: StreamDataset,
    count: int,
    kept: Sequence[int],
    times: Sequence[FrameTime],
    frames: Callable[[], Frames],
    truth: Poses,
    notes: Sequence[str],
) -> StreamDataset:
    """Return a dataset with the frames of a file added; raises FileError if none of them is kept.

    Parameters
    ----------
    count : int
        Number of frames in the file.
    kept : sequence of int
        Ascending indices of the frames that are used.
    times : sequence of FrameTime
        Times of the kept frames.
    frames : callable
        Opens the file and yields all its frames.
    truth : sequence of (float, Truth or None)
        Times and true poses, as for `pose_at`.
    notes : sequence of str
        Notes for the user on the file.
    """
    if not kept:
        raise FileError(dataset.path, "holds no frame")
    names = [f"frame_{index:06d}" for index in kept]
    true_poses = {name: pose_at(truth, time.t_s) for name, time in zip(names, times, strict=True)}
    chosen = frozenset(kept)

    def kept_frames() -> Frames:
        return (frame for index, frame in enumerate(frames()) if index in chosen)

    return replace(
        dataset,
        image_names=tuple(names),
        times=dict(zip(names, times, strict=True)),
        truth={name: there for name, there in true_poses.items() if there is not None},
        notes=tuple(notes),
        open_frames=kept_frames,
        left_out=count - len(kept),
    )


def pose_at(poses: Poses, t_s: float) -> Truth | None:
    """Return the pose at a time, interpolated linearly between the poses before and after it.

    The times ascend; None means that the pose is unknown. The result is None before the first pose, after the last one,
    between two that are more than `MAX_GAP_S` apart, and if either is None. It has no heading if either has none.
    """
    at = bisect.bisect_left(poses, t_s, key=lambda pose: pose[0])
    near = [poses[index] for index in (at - 1, at) if 0 <= index < len(poses)]
    for near_s, pose in near:
        if abs(near_s - t_s) <= _SAME_TIME_S:
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
    """Return a note on the frames that are left out because their times are not in order, if there are any."""
    left_out = sorted(set(range(len(times_s))) - set(kept))
    if not left_out:
        return []
    first = times_s[left_out[0]]
    return [
        f"{where}: {len(left_out)} of {len(times_s)} frames are not in the order of time (the first: {first:.3f} s):"
        " left out"
    ]

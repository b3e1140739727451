"""Maps survive the disk unchanged; damaged, foreign and contradicting files are refused with the reason."""

from dataclasses import fields, replace

import numpy as np
import pytest

from field_models.errors import ArgumentError, FileError
from robocup_vision.landmarks.landmark_map import LandmarkMap, expect, load_map, save_map
from robocup_vision.landmarks.picture import draw_map, ellipses
from sim2d.rendering.hall.runs import HALL_CAMERA


def small_map(count: int = 5) -> LandmarkMap:
    rng = np.random.default_rng(3)
    return LandmarkMap(
        rng.uniform(0.5, 3, (count, 3)),
        np.tile(np.eye(3) * 1e-4, (count, 1, 1)),
        np.ones(count),
        np.arange(count),
        np.arange(count)[::-1].copy(),
        np.arange(count),
        np.arange(count) % 36,
        rng.integers(0, 200, (count, 128)).astype(np.uint8),
        rng.uniform(0.02, 0.1, count),
        rng.uniform(0.02, 0.1, count),
        rng.uniform(0.01, 0.02, count),
        np.zeros((2, 3)),
        np.zeros((2, 3, 3)),
    )


def rewritten(path, **changes):
    with np.load(path) as archive:
        arrays = dict(archive)
    arrays.update(changes)
    np.savez(path, **{k: v for k, v in arrays.items() if v is not None})


def test_a_map_survives_the_disk(tmp_path, short_run):
    for number, landmarks in enumerate((small_map(), short_run.landmarks)):
        path = tmp_path / f"map{number}.npz"
        save_map(landmarks, path)
        loaded = load_map(path)
        for f in fields(LandmarkMap):
            np.testing.assert_array_equal(getattr(loaded, f.name), getattr(landmarks, f.name))


def test_success_is_smoothed():
    landmarks = replace(small_map(2), seen=np.array([1, 8]), missed=np.array([0, 1]))
    assert landmarks.success == pytest.approx([0.5, 8.5 / 11])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": np.int64(2)}, "key 'format': must be 1, got 2"),
        ({"format": None}, "key 'format': is missing"),
        ({"seen": None}, "key 'seen': is missing"),
        ({"seen": np.zeros(5)}, "key 'seen': must be of type int64, got 'float64'"),
        ({"seen": np.full(5, -1)}, "seen and missed must not be negative"),
        ({"positions_m": np.full((5, 3), np.nan)}, "positions_m must be finite"),
        ({"positions_m": np.zeros((4, 3))}, "covariances must have shape"),
        ({"covariances": np.zeros((5, 3, 3))}, "covariances must be positive definite"),
        ({"view_landmark": np.full(5, 9)}, "view_landmark must be within 0 to 4"),
        ({"view_direction": np.full(5, 36)}, "view_direction must be within 0 to 35"),
        ({"view_size_m": np.zeros(5)}, "view_size_m must be positive"),
    ],
)
def test_contradictions_are_named(tmp_path, changes, message):
    path = tmp_path / "map.npz"
    save_map(small_map(), path)
    rewritten(path, **changes)
    with pytest.raises(FileError) as caught:
        load_map(path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)


def test_a_file_cut_off_or_flipped_is_refused(tmp_path):
    path = tmp_path / "map.npz"
    save_map(small_map(60), path)
    data = path.read_bytes()
    for damaged in (data[: len(data) // 2], b"", b"no map at all", data[:900] + bytes([data[900] ^ 255]) + data[901:]):
        path.write_bytes(damaged)
        with pytest.raises(FileError, match=r"(damaged|no landmark map)"):
            load_map(path)
    with pytest.raises(FileError, match="does not exist"):
        load_map(tmp_path / "absent.npz")
    np.save(tmp_path / "array.npy", np.zeros(3))
    with pytest.raises(FileError, match="no landmark map"):
        load_map(tmp_path / "array.npy")
    with pytest.raises(FileError, match="cannot be written"):
        save_map(small_map(), tmp_path / "no" / "folder.npz")


def test_views_from_behind_are_not_expected():
    landmarks = small_map(1)
    landmarks = replace(landmarks, positions_m=np.array([[2.0, 0.0, 0.6]]), view_direction=np.array([1]))
    # looking along +x the landmark is dead ahead, and was seen from within 20 degrees of there
    expected = expect(landmarks, HALL_CAMERA, np.zeros(3))
    assert expected.pixels[0] == pytest.approx([159.5, 119.5])
    assert expected.depth_m == pytest.approx([2.0])
    away = replace(landmarks, view_direction=np.array([5]))
    assert len(expect(away, HALL_CAMERA, np.zeros(3))) == 0
    assert len(expect(landmarks, HALL_CAMERA, np.array([0.0, 0.0, 3.0]))) == 0


def test_drift_is_that_of_the_nearest_moment():
    covariances = np.array([np.zeros((3, 3)), np.eye(3)])
    landmarks = replace(small_map(), trajectory=np.array([[0.0, 0, 0], [2.0, 0, 0]]), trajectory_cov=covariances)
    assert landmarks.drift(np.array([0.4, 0, 0]))[0, 0] == 0
    assert landmarks.drift(np.array([1.4, 0, 0]))[0, 0] == 1


def test_ellipses_have_the_covariance_axes():
    landmarks = replace(small_map(1), covariances=np.diag([4e-4, 1e-4, 1e-4])[None])
    outline = ellipses(landmarks)[0] - landmarks.positions_m[0, :2]
    assert np.abs(outline).max(axis=0) == pytest.approx([0.06, 0.03], rel=1e-6)


def test_the_picture_is_written(tmp_path, short_run):
    pytest.importorskip("matplotlib")
    draw_map(short_run.landmarks, tmp_path / "map.png", short_run.mapper.poses)
    assert (tmp_path / "map.png").stat().st_size > 5000
    with pytest.raises(FileError, match="cannot be written"):
        draw_map(short_run.landmarks, tmp_path / "absent" / "map.png")


def test_shapes_are_checked_when_made():
    with pytest.raises(ArgumentError, match="noise must have shape"):
        replace(small_map(), noise=np.ones(2))

"""Camera files: what is saved comes back, and each thing that can be wrong is refused in one line that names it."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from strategies import PAPER_MIRROR, all_cameras
from wrong_files import problem_of

from field_models import ArgumentError, FileError
from robocup_vision.camera import Hyperboloid, OmniCamera, PinholeCamera, Table, Tangent, load_camera, save_camera

HYPERBOLOID = 'kind = "hyperboloid"\nA_px_per_m = 10120.0\nB_per_m = 20.54\nC_px2 = 229800.0'
TABLE = 'kind = "table"\nradius_px = [26.0, 60.0, 112.0]\nrange_m = [0.1, 0.4, 3.0]'
TANGENT = 'kind = "tangent"\na_m = 0.4\nb_per_px = 0.0125'
GOOD_OMNI = f"""format = 1
model = "omni"
size_px = [256, 220]
center_px = [127.5, 109.5]
usable_radius_px = [26.0, 112.0]
[floor_range]
{HYPERBOLOID}
"""
GOOD_PINHOLE = """format = 1
model = "pinhole"
size_px = [640, 480]
focal_px = [616.0, 616.0]
center_px = [320.0, 240.0]
height_m = 0.46
"""
GOOD_FISHEYE = """format = 1
model = "fisheye"
size_px = [640, 600]
focal_px = [180.0, 180.0]
center_px = [320.0, 300.0]
height_m = 0.5
projection = "equidistant"
usable_radius_px = [0.0, 290.0]
tilt_rad = -0.2
"""

Write = Callable[[str], Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def _write(text: str) -> Path:
        path = tmp_path / "camera.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return _write


def assert_same(one: object, other: object) -> None:
    assert type(one) is type(other)
    for name in [field.name for field in dataclasses.fields(one)]:
        if isinstance(getattr(one, name), Table):
            np.testing.assert_array_equal(getattr(one, name).table_radius_px, getattr(other, name).table_radius_px)
            np.testing.assert_array_equal(getattr(one, name).table_range_m, getattr(other, name).table_range_m)
        else:
            assert vars(one)[name] == vars(other)[name], name


@given(all_cameras())
def test_saved_camera_loads_back_to_the_last_bit(tmp_path_factory: pytest.TempPathFactory, camera: OmniCamera):
    path = tmp_path_factory.mktemp("camera") / "camera.toml"
    save_camera(camera, path)
    assert_same(load_camera(path), camera)


def test_camera_of_numpy_and_integer_numbers_saves_too(tmp_path: Path):
    width, height = np.array([256, 220])
    curve = Tangent(np.float32(0.4), np.float64(0.0125))
    camera = OmniCamera((width, height), (127, 109), (np.float64(26), 112), curve, tilt_rad=(0, 0))
    save_camera(camera, tmp_path / "camera.toml")
    assert_same(load_camera(tmp_path / "camera.toml"), camera)


def test_optional_keys_have_the_documented_defaults(write: Write):
    camera = load_camera(write(GOOD_OMNI))
    assert_same(camera, OmniCamera((256, 220), (127.5, 109.5), (26.0, 112.0), PAPER_MIRROR))
    assert (camera.mirrored, camera.heading_rad, camera.offset_m, camera.tilt_rad) == (False, 0.0, (0, 0), (0, 0))


def test_a_pinhole_camera_s_optional_keys_have_the_documented_defaults(write: Write):
    camera = load_camera(write(GOOD_PINHOLE))
    assert isinstance(camera, PinholeCamera)
    assert camera.distortion == ()
    assert camera.offset_m == (0.0, 0.0)
    assert (camera.pan_rad, camera.tilt_rad, camera.roll_rad, camera.roll_std_rad) == (None,) * 4
    assert (camera.height_std_m, camera.focal_std_px) == (0.01, 0.0)


def test_table_may_end_exactly_with_the_usable_radii_and_before_them(write: Write):
    # in between, a rounding error decides whether a pixel on the rim is in the table
    for outer in (112.0, 118.0):
        text = GOOD_OMNI.replace(HYPERBOLOID, TABLE).replace("112.0]\n[floor", f"{outer}]\n[floor")
        camera = load_camera(write(text))
        assert np.isnan(camera.pixel_to_floor(camera.polar_to_pixel(0.0, 115.0))).all()


def test_usable_radius_may_pass_the_horizon(write: Write):
    camera = load_camera(write(GOOD_OMNI.replace("[26.0, 112.0]", "[26.0, 125.0]")))
    assert np.isnan(camera.pixel_to_floor(camera.polar_to_pixel(0.0, 120.0))).all()


BAD_OMNI = [
    ("format = 1", "format = 2", "key 'format': is not a value that this version reads: must be 1, got 2"),
    ("format = 1\n", "", "key 'format': is missing"),
    ('model = "omni"\n', "", "key 'model': is missing"),
    ('"omni"', '"zoom"', "key 'model': must be"),
    ('"omni"', "7", "key 'model': must be"),
    ("size_px = [256, 220]\n", "", "key 'size_px': is missing"),
    ("[256, 220]", "[256]", "key 'size_px': expected `array` of length 2, got 1"),
    ("[256, 220]", "[256, 0]", "key 'size_px[1]': must be at least 1, got 0"),
    ("[256, 220]", "[256.5, 220]", "key 'size_px[0]': expected `int`, got `float`, got 256.5"),
    ("format = 1", "format = 1\nfocal = 3", "key 'focal': is unknown, got 3"),
    ("format = 1", 'format = 1\nmirrored = "no"', "key 'mirrored': expected `bool`, got `str`, got 'no'"),
    ("format = 1", "format = 1\nheading_rad = nan", "key 'heading_rad': must be a finite number, got nan"),
    ("127.5", "-inf", "key 'center_px[0]': must be a finite number, got -inf"),
    ("127.5", "256.5", "key 'center_px': lies outside the 256x220 image, got [256.5, 109.5]"),
    ("109.5", "-1", "key 'center_px': lies outside the 256x220 image, got [127.5, -1.0]"),
    ("[26.0, 112.0]", "[112.0, 26.0]", "key 'usable_radius_px': must be inner < outer, got [112.0, 26.0]"),
    ("[26.0, 112.0]", "[26.0, 26.0]", "key 'usable_radius_px': must be inner < outer, got [26.0, 26.0]"),
    ("[26.0, 112.0]", "[0.0, 26.0]", "key 'usable_radius_px[0]': must be above 0.0, got 0.0"),
    ("[26.0, 112.0]", "[114.0, 118.0]", "key 'usable_radius_px': shows no floor at its inner end, got [114.0, 118.0]"),
    (
        "format = 1",
        "format = 1\ntilt_rad = [0.0, 0.5]",
        "key 'tilt_rad': must be small (at most 0.3 rad), got [0.0, 0.5]",
    ),
    ("20.54", "-20.54", "key 'floor_range.B_per_m': must be above 0.0, got -20.54"),
    ("B_per_m = 20.54\n", "", "key 'floor_range.B_per_m': is missing"),
    ("B_per_m = 20.54", "B_per_m = 20.54\nD = 1", "key 'floor_range.D': is unknown, got 1"),
    ('"hyperboloid"', '"sphere"', "key 'floor_range.kind': "),
    ('kind = "hyperboloid"\n', "", "key 'floor_range.kind': is missing"),
    ("A_px_per_m = 10120.0", "A_px_per_m = 1e308", "key 'floor_range': shows no floor between usable_radius_px"),
    ("A_px_per_m = 10120.0", "A_px_per_m = 9000.0", "key 'usable_radius_px': shows no floor at its inner end"),
    ("[floor_range]\n" + HYPERBOLOID, "", "key 'floor_range': is missing"),
    (
        "[floor_range]\n" + HYPERBOLOID,
        "tilt_rad = [0.0, 0.01]\n[floor_range]\n" + TANGENT,
        "key 'viewpoint_height_m': is needed when tilt_rad is not zero",
    ),
    (
        "[floor_range]\n" + HYPERBOLOID,
        "viewpoint_height_m = 0\n[floor_range]\n" + TANGENT,
        "key 'viewpoint_height_m': must be above 0.0, got 0",
    ),
    (
        HYPERBOLOID,
        TABLE.replace("60.0", "20.0"),
        "key 'floor_range.radius_px[1]': must be strictly increasing, got 20.0",
    ),
    (HYPERBOLOID, TABLE.replace("3.0", "0.4"), "key 'floor_range.range_m[2]': must be strictly increasing, got 0.4"),
    (
        HYPERBOLOID,
        TABLE.replace("0.4, ", ""),
        "key 'floor_range.range_m': must have as many entries as radius_px (3), got 2",
    ),
    (HYPERBOLOID, TABLE.replace("26.0, 60.0, ", ""), "key 'floor_range.radius_px': expected `array` of length >= 2"),
    (HYPERBOLOID, TABLE.replace("0.1", "0"), "key 'floor_range.range_m[0]': must be above 0.0, got 0"),
    (HYPERBOLOID, TABLE.replace("26.0", "30.0"), "key 'usable_radius_px': shows no floor at its inner end"),
    (HYPERBOLOID, TABLE.replace("0.1", "1e-320"), "key 'floor_range': is no length at the usable radius of 26 px"),
    (HYPERBOLOID, TANGENT.replace("0.0125", "1e-320"), "key 'floor_range': is no length at the usable radius of 26 px"),
]


LENS_SHOWS_NOTHING = "this lens shows nothing at pixel (0.0, 0.0)"
BAD_PINHOLE = [
    ('"pinhole"', '"zoom"', "key 'model': must be 'omni', 'pinhole' or 'fisheye', got 'zoom'"),
    ("format = 1", "format = 2", "key 'format': is not a value that this version reads: must be 1, got 2"),
    ("focal_px = [616.0, 616.0]\n", "", "key 'focal_px': is missing"),
    ("[616.0, 616.0]", "[616.0, 0.0]", "key 'focal_px[1]': must be above 0.0, got 0.0"),
    ("[616.0, 616.0]", "616.0", "key 'focal_px': expected `array`, got `float`, got 616.0"),
    ("0.46", "-0.46", "key 'height_m': must be above 0.0, got -0.46"),
    ("0.46", "nan", "key 'height_m': must be a finite number, got nan"),
    ("0.46", "0.46\nfloor_range = 1", "key 'floor_range': is unknown, got 1"),
    ("320.0", "640.5", "key 'center_px': lies outside the 640x480 image, got [640.5, 240.0]"),
    ("0.46", "0.46\ntilt_rad = -16.7", "key 'tilt_rad': must lie between -pi/2 and pi/2, got -16.7; -16.7 degrees are"),
    (
        "0.46",
        "460",
        "key 'height_m': must be in metres, at most 3, got 460.0; in millimetres it is 0.46 m, in centimetres 4.6 m",
    ),
    (
        "0.46",
        "0.46\noffset_m = [60, 0]",
        "key 'offset_m': must be in metres, at most 3, got [60.0, 0.0]; in millimetres",
    ),
    ("0.46", "0.46\nheight_std_m = -1", "key 'height_std_m': must be at least 0.0, got -1"),
    ("0.46", "0.46\ndistortion = [0.1]", "key 'distortion': must have 0, 4, 5 or 8 coefficients, got [0.1]"),
    (
        "0.46",
        "0.46\ndistortion = [-2.0, 0.0, 0.0, 0.0]",
        f"key 'distortion': folds back within the picture: {LENS_SHOWS_NOTHING}",
    ),
    *(
        ("0.46", f"0.46\ndistortion = {lens}", f"key 'distortion': folds back within the picture: {LENS_SHOWS_NOTHING}")
        for lens in ([1e308, 0.0, 0.0, 0.0], [0.0, 0.0, 1e308, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0, 1e160, 0.0, 0.0])
    ),
    ("[616.0, 616.0]", "[616.0, 1e-320]", "key 'focal_px': shows nothing at pixel (0.0, 0.0), got [616.0, 1e-320]"),
]
BAD_FISHEYE = [
    (
        '"equidistant"',
        '"kannala_brandt"\ndistortion = [-1e300, 0, 0, 0]',
        "distortion (-1e+300, 0.0, 0.0, 0.0) makes the",
    ),
    ('"equidistant"', '"fish"', "key 'projection'"),
    ("height_m = 0.5", "height_m = 0.5\ndistortion = [0.1]", "distortion must have 0 coefficients"),
    ("[0.0, 290.0]", "[290.0, 200.0]", "usable_radius_px must be 0 <= inner < outer"),
    ("[0.0, 290.0]", "[0.0, 900.0]", "key 'usable_radius_px': reaches beyond what the projection shows"),
    ("tilt_rad = -0.2", "tilt_rad = -20.0", "key 'tilt_rad': must lie between -pi/2 and pi/2"),
]
GOOD = {GOOD_OMNI: BAD_OMNI, GOOD_PINHOLE: BAD_PINHOLE, GOOD_FISHEYE: BAD_FISHEYE}
BAD = [(good, *row) for good, rows in GOOD.items() for row in rows]


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize(("good", "old", "new", "message"), BAD, ids=[f"{n}" for n in range(len(BAD))])
def test_bad_file_is_refused_in_one_line_naming_file_key_and_value(
    tmp_path: Path, good: str, old: str, new: str, message: str
):
    assert message in problem_of(load_camera, tmp_path / "camera.toml", good, old, new)


def test_curve_that_does_not_come_back_names_the_worst_pixel(write: Write, monkeypatch: pytest.MonkeyPatch):
    right = Hyperboloid.radius_px
    monkeypatch.setattr(Hyperboloid, "radius_px", lambda self, q: right(self, q) + np.where(np.asarray(q) > 5, 0.5, 0))
    with pytest.raises(FileError, match=r"key 'floor_range': pixel \(\d+\.\d, \d+\.\d\) maps .* back 0\.5 px away"):
        load_camera(write(GOOD_OMNI))


def test_lens_that_does_not_come_back_names_the_worst_pixel(write: Write, monkeypatch: pytest.MonkeyPatch):
    right = PinholeCamera.camera_ray_to_pixel
    monkeypatch.setattr(
        PinholeCamera, "camera_ray_to_pixel", lambda self, rays: right(self, rays) + np.array([0.5, 0.0])
    )
    with pytest.raises(FileError, match=r"pixel \(\d+\.\d, \d+\.\d\) maps to a ray and back 0\.5 px away"):
        load_camera(write(GOOD_PINHOLE))


def test_curve_that_turns_back_is_refused(write: Write, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(Hyperboloid, "inverse_range_per_m", lambda self, radius: 2 + np.sin(np.asarray(radius) / 9))
    with pytest.raises(FileError, match="key 'floor_range': is not strictly increasing over usable_radius_px"):
        load_camera(write(GOOD_OMNI))


def test_saving_where_no_folder_is_names_the_file(tmp_path: Path):
    camera = OmniCamera((256, 220), (127.5, 109.5), (26.0, 112.0), PAPER_MIRROR)
    with pytest.raises(FileError, match=r"absent.camera\.toml: cannot be written"):
        save_camera(camera, tmp_path / "absent" / "camera.toml")


def test_saving_a_curve_the_format_lacks_is_refused(tmp_path: Path):
    class Unknown:
        implied_height_m = None

    camera = OmniCamera((256, 220), (127.5, 109.5), (26.0, 112.0), Unknown())  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="type Unknown"):
        save_camera(camera, tmp_path / "camera.toml")
    assert not (tmp_path / "camera.toml").exists()

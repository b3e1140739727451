"""A folder of images (or a video) with its field, camera, truth and odometry, checked before any frame is read.

Frames are read from the disk one at a time, when they are used: a dataset may be larger than memory.

The key `pose_of` of dataset.toml states whose poses truth.csv and results.csv hold: "robot" (default), or "camera", the
camera's foot on the floor and the heading of its optical axis. The two are equal where the camera file has neither
pan_rad nor offset_m. frames.csv holds the robot's motion in either case.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeVar

import numpy as np
import numpy.typing as npt

from field_models.catalog import load_field
from field_models.errors import ArgumentError, FileError, FrameError
from field_models.field import Field
from field_models.near_names import did_you_mean
from field_models.toml_file import StrictStruct, load_toml
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera import Mounting, OmniCamera, PinholeCamera
from robocup_vision.camera.pinhole import MOUNTING_NAMES
from robocup_vision.camera.rig import Rig, load_camera_or_rig
from robocup_vision.evaluation import boxes as box_file
from robocup_vision.evaluation.boxes import Box
from robocup_vision.evaluation.rig_images import (
    MOTION,
    RigImages,
    decode_rig,
    find_rig_images,
    motion_of,
    read_rig_times,
    rig_contents,
    rig_mask_paths,
)
from robocup_vision.files.csv_table import CsvRow, read_csv
from robocup_vision.files.image_folder import no_pictures, picture_folder, pictures_in
from robocup_vision.files.images import IMAGE_SUFFIXES, orientation_note, other_pictures, read_image, read_mask
from robocup_vision.files.video import VideoInfo, read_video, video_info
from robocup_vision.geometry import Pose2

if TYPE_CHECKING:
    from robocup_vision.landmarks.landmark_map import LandmarkMap
    from robocup_vision.perception.color_table import Colors

Word = TypeVar("Word", bound=str)
Symmetry = Literal["none", "point"]
SYMMETRIES: tuple[Symmetry, ...] = ("none", "point")
PoseOf = Literal["robot", "camera"]
POSES_OF: tuple[PoseOf, ...] = ("robot", "camera")


class _DatasetFile(StrictStruct):
    format: Literal[1]
    field: str
    camera: str
    images: str
    colors: str | None = None
    method: str | None = None
    frames: str | None = None
    truth: str | None = None
    mask: str | None = None
    map: str | None = None
    symmetry: str = "none"
    pose_of: str = "robot"


@dataclass(frozen=True, slots=True)
class Truth:
    """True pose of the robot, or with `pose_of = "camera"` of the camera; `theta_rad` is None where not measured."""

    x_m: float
    y_m: float
    theta_rad: float | None


@dataclass(frozen=True, slots=True)
class FrameTime:
    """The time of a frame, seconds, and the robot's motion since the frame before, in the robot frame at that time.

    `mounting` is how neck and body held the camera; None: as the camera file says. `camera_times_s`, for a rig, are the
    times of the cameras' frames, None where a camera gave no frame; `t_s` is the latest of them.
    """

    t_s: float
    odometry: Pose2 | None
    mounting: Mounting | None = None
    camera_times_s: tuple[float | None, ...] | None = None


@dataclass(frozen=True, eq=False)
class Dataset:
    """What `load_dataset` found. Can be pickled, so that worker processes read their own frames."""

    name: str  #: the name of the folder or video
    path: Path  #: the folder that holds the images, or the video file
    image_names: tuple[str, ...]  #: in the order of evaluation: file names, or ``frame_000000`` and so on for a video
    #: the arguments of `robocup_vision.Vision`; `colors` is None if they are learnt from the images
    field: Field
    camera: OmniCamera | PinholeCamera
    colors: Colors | None
    method: str  #: method of localisation
    times: Mapping[str, FrameTime] | None  #: by image, from frames.csv or the video; with times it is a sequence
    truth: Mapping[str, Truth]  #: true poses by image; may cover only a part of the images, or none
    mask: npt.NDArray[np.uint8] | None  #: (H, W) uint8: non-zero pixels are never used
    symmetry: Symmetry  #: "point": errors count modulo a half turn about the field's centre
    #: subject of the poses in `truth` and the results: robot or camera (its foot on the floor and the heading of its
    #: optical axis). Odometry in `times` is always the robot's.
    pose_of: PoseOf = "robot"
    notes: tuple[str, ...] = ()  #: lines the user should see, such as that a video ends early
    landmarks: LandmarkMap | None = None  #: the map of method "landmarks"
    left_out: int = 0  #: number of frames or image-like files that are not used; the notes say why
    #: boxes by image, from boxes.csv; an image that is not a key has no boxes. None: there is no such file.
    boxes: Mapping[str, tuple[Box, ...]] | None = None
    #: several cameras on one body, `camera` being the first; a name stands for images of that name of all cameras
    rig: Rig | None = None
    rig_masks: tuple[npt.NDArray[np.uint8] | None, ...] = ()  #: one for each camera of a rig, in place of `mask`

    @property
    def is_video(self) -> bool:
        """Whether the frames come from a video, which can only be read from its beginning."""
        return self.path.is_file()

    def truth_of(self, index: int) -> Truth | None:
        """Return the true pose of an image, None if it is unknown."""
        return self.truth.get(self.image_names[index])

    def boxes_of(self, index: int) -> tuple[Box, ...]:
        """Return the boxes that are marked in an image."""
        return () if self.boxes is None else self.boxes.get(self.image_names[index], ())

    def read_frame(self, index: int) -> UInt8Array:
        """Read one frame, (H, W, 3) uint8 BGR, of a folder of images.

        Raises
        ------
        FrameError
            If the image is missing, damaged, truncated, not 8-bit colour or not as large as the camera's images.
        """
        if self.is_video:
            raise ArgumentError(f"{self.path}: frames of a video are read in order, by read_frames")
        if self.rig is not None:
            raise ArgumentError(f"{self.path}: the images of a rig are read together, by read_rig_frames")
        return read_image(self.path / self.image_names[index], self.camera.size_px)

    def read_rig_frames(self, name: str) -> RigImages:
        """Read the frames of a rig's look, one for each camera; raises as `read_frame` does."""
        assert self.rig is not None
        return decode_rig(rig_contents(self.path, self.rig, name), self.rig, name)

    def read_frames(self) -> Iterator[UInt8Array | FrameError]:
        """Yield all frames, (H, W, 3) uint8 BGR; in place of a frame that cannot be used, yield the error."""
        if self.is_video:
            yield from read_video(self.path, len(self.image_names), self.camera.size_px)
            return
        for index in range(len(self.image_names)):
            try:
                yield self.read_frame(index)
            except FrameError as error:
                yield error


def load_dataset(
    path: str | Path,
    *,
    field: str | Path | None = None,
    camera: str | Path | None = None,
    colors: str | Path | None = None,
    method: str | None = None,
    landmark_map: str | Path | None = None,
    takes_rig: bool = False,
) -> Dataset:
    """Load and check a dataset, without reading its frames.

    Parameters
    ----------
    path : str or Path
        A folder with a ``dataset.toml`` (or that file), a plain folder of images, or a video file. The latter two need
        `field` and `camera`.
    field : str or Path, optional
        Name of a built-in field or path of a field file. This and the following override ``dataset.toml``.
    camera, colors : str or Path, optional
        Paths of camera and colour file.
    method : str, optional
        Method of localisation: a name in `robocup_vision.localization.methods.METHODS`.
    landmark_map : str or Path, optional
        Path of the map that method "landmarks" uses; without `method` it selects that method.
    takes_rig : bool
        Whether the camera may be a rig file.

    Raises
    ------
    FileError
        If a file is missing or wrong, there are no images, a table names an image that does not exist, or keys
        contradict each other.
    ArgumentError
        If an argument is unknown, or `field` or `camera` is needed.
    """
    if not isinstance(path, str | Path):
        raise ArgumentError(f"the path of a dataset must be a str or Path, got {type(path).__name__} {path!r}")
    path = Path(path)
    if not path.exists():
        raise FileError(path, "does not exist")
    if method is not None and method not in (names := _method_names()):
        hint = did_you_mean(method, names)
        raise ArgumentError(f"method must be one of {', '.join(names)}, got {method!r}{hint}")
    description_path = path / "dataset.toml" if path.is_dir() else path
    if description_path.suffix == ".toml" and description_path.is_file():
        description = load_toml(description_path, _DatasetFile)
        folder = description_path.parent
        source = folder / description.images
    else:
        for name, value in (("field", field), ("camera", camera)):
            if value is None:
                raise ArgumentError(f"{path}: has no dataset.toml, so --{name} must be given")
        description_path, folder, source = path, path, picture_folder(path)
        description = _DatasetFile(format=1, field="", camera="", images="")

    loaded_field = load_field(field if field is not None else _field_source(folder, description.field))
    camera_path = camera if camera is not None else folder / description.camera
    loaded = load_camera_or_rig(camera_path)
    colors_path = colors if colors is not None else _beside(folder, description.colors)
    mask_path, frames_path = _beside(folder, description.mask), _beside(folder, description.frames)
    boxes_path = folder / box_file.NAME
    has_boxes = boxes_path.is_file()
    rig = mask = landmarks = None
    rig_masks: tuple[UInt8Array | None, ...] = ()
    loaded_camera: OmniCamera | PinholeCamera
    if isinstance(loaded, Rig):
        rig, loaded_camera = loaded, loaded.cameras[0]
        if not takes_rig:
            raise FileError(camera_path, "names several cameras, a rig: this command takes one camera")
        if method == "landmarks" or landmark_map is not None or description.method == "landmarks":
            raise FileError(camera_path, "names several cameras, a rig: method 'landmarks' takes one camera")
        image_names, times = _rig_images(description_path, source, description, rig, frames_path)
        rig_masks = _rig_masks(description_path, mask_path, rig)
        chosen = _method(description_path, method or description.method, loaded_field, loaded_camera)
        no_boxes = "with a rig it does not say which camera's boxes they are"
        notes: tuple[str, ...] = ()
    else:
        loaded_camera = loaded
        image_names, video, notes = _find_images(description_path, source, mask_path)
        times = _times(frames_path, image_names)
        if times is None and video is not None and video.has_times:
            times = {name: FrameTime(t_s, None) for name, t_s in zip(image_names, video.times_s, strict=True)}
        map_path = Path(landmark_map) if landmark_map is not None else _beside(folder, description.map)
        wanted = method or ("landmarks" if landmark_map is not None else description.method)
        chosen = _method(description_path, wanted, loaded_field, loaded_camera)
        _check_mountings(frames_path, times, loaded_camera, chosen)
        mask = _mask(mask_path, loaded_camera.size_px)
        landmarks = _landmarks(description_path, map_path, loaded_camera) if chosen == "landmarks" else None
        no_boxes = "" if landmarks is None else "method 'landmarks' tells neither balls nor obstacles"
    if has_boxes and no_boxes:
        notes += (f"{box_file.NAME} is not scored: {no_boxes}",)
        has_boxes = False
    return Dataset(
        name=folder.resolve().name if folder.is_dir() else folder.stem,
        path=source,
        image_names=image_names,
        field=loaded_field,
        camera=loaded_camera,
        colors=_colors(colors_path),
        method=chosen,
        times=times,
        truth=_truth(_beside(folder, description.truth), image_names),
        mask=mask,
        symmetry=_one_of(description_path, "symmetry", description.symmetry, SYMMETRIES),
        pose_of=_one_of(description_path, "pose_of", description.pose_of, POSES_OF),
        notes=notes,
        landmarks=landmarks,
        left_out=len(other_pictures(source)) if source.is_dir() and rig is None else 0,
        boxes=box_file.load_boxes(boxes_path, image_names, loaded_camera.size_px) if has_boxes else None,
        rig=rig,
        rig_masks=rig_masks,
    )


def _rig_images(
    path: Path, source: Path, description: _DatasetFile, rig: Rig, frames_path: Path | None
) -> tuple[tuple[str, ...], dict[str, FrameTime] | None]:
    """Return the image names that a rig's cameras have in common, and the times of their frames."""
    if description.pose_of != "robot":
        raise FileError(path, "must be robot with a rig, whose cameras are several", key="pose_of")
    if not source.is_dir():
        raise FileError(
            path, "must be a folder with a folder of images for each camera", key="images", value=source.name
        )
    names = find_rig_images(path, source, rig)
    if frames_path is None:
        return names, None
    times = {
        name: FrameTime(max(one for one in each if one is not None), odometry, camera_times_s=each)
        for name, (each, odometry) in read_rig_times(frames_path, source, rig, names).items()
    }
    return names, times


def _rig_masks(path: Path, folder: Path | None, rig: Rig) -> tuple[UInt8Array | None, ...]:
    return tuple(
        _mask(one, camera.size_px) for one, camera in zip(rig_mask_paths(path, folder, rig), rig.cameras, strict=True)
    )


def _beside(folder: Path, name: str | None) -> Path | None:
    return None if name is None else folder / name


def _field_source(folder: Path, name: str) -> str | Path:
    return folder / name if name.endswith(".toml") else name


def _colors(path: str | Path | None) -> Colors | None:
    if path is None:
        return None
    from robocup_vision.perception.color_table import load_colors

    return load_colors(path)


def _one_of(path: Path, key: str, value: str, known: tuple[Word, ...]) -> Word:
    for word in known:
        if word == value:
            return word
    raise FileError(path, f"must be one of {', '.join(known)}", key=key, value=value)


def _method_names() -> tuple[str, ...]:
    # imported where used: it loads all localisers
    from robocup_vision.localization.methods import method_names

    return method_names()


def _method(path: Path, method: str | None, field: Field, camera: OmniCamera | PinholeCamera) -> str:
    if method is None:
        # imported where used: it loads all localisers
        from robocup_vision.localization.methods import choose_method

        return choose_method(camera).name
    chosen = _one_of(path, "method", method, _method_names())
    if chosen in ("floor", "hull") and not field.is_bounded:
        problem = f"needs a floor that ends at walls or boards, that of field '{field.name}' does not"
        raise FileError(path, problem, key="method", value=chosen)
    return chosen


def _landmarks(path: Path, map_path: Path | None, camera: OmniCamera | PinholeCamera) -> LandmarkMap:
    if not isinstance(camera, PinholeCamera) or not camera.known_orientation:
        raise FileError(path, "needs a pinhole camera of known tilt_rad", key="method", value="landmarks")
    if map_path is None:
        raise FileError(path, "is needed by method 'landmarks' (or --map)", key="map")
    from robocup_vision.landmarks.landmark_map import load_map

    return load_map(map_path)


def _find_images(
    path: Path, source: Path, mask_path: Path | None
) -> tuple[tuple[str, ...], VideoInfo | None, tuple[str, ...]]:
    key = "images" if path.suffix == ".toml" else None
    value: object = source.name if key else ...
    if not source.exists():
        raise FileError(path, "does not exist", key=key, value=value)
    if source.is_dir():
        mask = None if mask_path is None else mask_path.resolve()
        names = [picture.name for picture in pictures_in(source) if picture.resolve() != mask]
        if not names:
            raise FileError(path, no_pictures(source), key=key, value=value)
        return tuple(names), None, (*_left_out_note(source), *orientation_note(source, names))
    if source.suffix.lower() in IMAGE_SUFFIXES:
        raise FileError(path, "is a single image, must be a folder of images or a video", key=key, value=value)
    video = video_info(source)
    count, announced = len(video.times_s), video.announced
    if count == 0:
        raise FileError(path, "is neither a folder of images nor a video that can be read", key=key, value=value)
    note = f"{source.name}: {count} frames can be decoded, its header announces {announced}: is it cut off?"
    # a header's count may differ by a frame, or by rounding of duration times rate
    notes: tuple[str, ...] = (note,) if announced - count > 1 + announced // 50 else ()
    if video.turn_deg:
        turn = f"its header says to turn the frames by {video.turn_deg} degrees"
        notes += (f"{source.name}: {turn}, which is not done: they are taken as stored",)
    if not video.has_times:
        notes += (f"{source.name}: tells no times, so its frames are looked at one by one",)
    return tuple(f"frame_{index:06d}" for index in range(count)), video, notes


def _left_out_note(source: Path) -> list[str]:
    others = other_pictures(source)
    return [f"{len(others)} pictures of kinds that are not read are left out, the first: {others[0]}"] if others else []


def _truth(path: Path | None, image_names: tuple[str, ...]) -> dict[str, Truth]:
    if path is None:
        return {}
    rows = read_csv(path, ("image", "x_m", "y_m", "theta_rad"), ignore_others=True)
    known = frozenset(image_names)
    truth = {}
    for row in rows:
        image = row.entries["image"]
        if image not in known:
            raise FileError(path, f"line {row.line}: names an image that is not there", value=image)
        truth[image] = Truth(row.number("x_m"), row.number("y_m"), row.number_or_none("theta_rad"))
    return truth


def _times(path: Path | None, image_names: tuple[str, ...]) -> dict[str, FrameTime] | None:
    if path is None:
        return None
    rows = {row.entries["image"]: row for row in read_csv(path, ("image", "t_s"), MOTION, single=MOUNTING_NAMES)}
    for image in rows.keys() - set(image_names):
        raise FileError(path, f"line {rows[image].line}: names an image that is not there", value=image)
    times: dict[str, FrameTime] = {}
    before_s = -math.inf
    for image in image_names:
        if image not in rows:
            raise FileError(path, "must name every image, does not name", value=image)
        row = rows[image]
        times[image] = FrameTime(row.number("t_s"), motion_of(row), _mounting(path, row))
        if times[image].t_s <= before_s:
            problem = f"line {row.line}: t_s must be later than in the image before ({before_s})"
            raise FileError(path, problem, value=times[image].t_s)
        before_s = times[image].t_s
    return times


def _mounting(path: Path, row: CsvRow) -> Mounting | None:
    given = {name: row.number(name) for name in MOUNTING_NAMES if row.entries.get(name)}
    try:
        return Mounting(**given) if given else None
    except ArgumentError as error:
        raise FileError(path, f"line {row.line}: {error}") from None


def _check_mountings(
    path: Path | None, times: Mapping[str, FrameTime] | None, camera: OmniCamera | PinholeCamera, method: str
) -> None:
    """Refuse mountings that the camera or the method would ignore."""
    from robocup_vision.localization.methods import choose_method

    given = {name for time in (times or {}).values() if time.mounting is not None for name in time.mounting.known}
    if path is None or not given:
        return
    if not isinstance(camera, PinholeCamera) or method == "landmarks":
        whose = "a mirror camera" if not isinstance(camera, PinholeCamera) else "method 'landmarks'"
        raise FileError(path, f"tells how a head holds the camera, which {whose} does not take", value=min(given))
    others = sorted(given - {"pan_rad", "pan_std_rad"})
    if others and (not camera.known_orientation or not choose_method(camera, method).by_edges):
        problem = f"is for method 'edges' and a camera file with tilt_rad; the method is '{method}'"
        raise FileError(path, problem, key=others[0])


def _mask(path: Path | None, size_px: tuple[int, int]) -> UInt8Array | None:
    if path is None:
        return None
    try:
        mask = read_mask(path)
    except FrameError as error:
        raise FileError(path, str(error).removeprefix(f"{path.name}: ")) from None
    height, width = mask.shape
    if (width, height) != tuple(size_px):
        problem = f"mask must be as large as the camera's images ({size_px[0]}x{size_px[1]})"
        raise FileError(path, problem, value=f"{width}x{height}")
    if not mask.any():
        raise FileError(path, "mask has no non-zero pixel, so it hides nothing")
    if mask.all():
        raise FileError(path, "mask hides every pixel")
    mask.flags.writeable = False
    return mask

"""Vision, the one object a robot embeds: a camera frame in; pose, free floor, obstacles and the ball out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Literal, Protocol, cast

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.arguments import (
    as_angle,
    as_camera,
    as_count,
    as_field,
    as_number,
    as_pose,
    as_prior,
    as_time,
    require_kind,
)
from robocup_vision.arrays import Frame, UInt8Array
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import Mounting, PinholeCamera
from robocup_vision.camera.rig import Rig, as_rig
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.filter.settings import PoseFilterSettings
from robocup_vision.localization.methods import choose_method
from robocup_vision.memory import Memory
from robocup_vision.perception.color_table import Colors
from robocup_vision.perception.floor_view import FloorView
from robocup_vision.perception.free_space import FREE_RATIO, FreeSpaceGrid
from robocup_vision.perception.polar_view import PolarView
from robocup_vision.pipeline.frames import FrameOptions, to_bgr
from robocup_vision.pipeline.omni import OmniPipeline
from robocup_vision.pipeline.pinhole import PinholePipeline
from robocup_vision.pipeline.rig import RigFrames, RigPipeline, rig_frames
from robocup_vision.view import View

_NO_TIME = "memory needs the time of a frame: hand t_s to look"
_NO_FLOOR = "this camera maps none of its pixels to the floor (is its tilt_rad known?)"

_RIG_HAS_NO_SAMPLES = (
    "the cameras of a rig have floor samples of their own: view.views[0].polar and .grid are the first's"
)

# Cells finer than a tenth of a degree, or than a centimetre on a large field, contain no sample of their own.
_MAX_DIRECTIONS, _MAX_RINGS = 3600, 1000

__all__ = ["View", "Vision"]


def _is_same_field(one: Field, other: Field) -> bool:
    return one is other or (one.name, one.length_m, one.width_m) == (other.name, other.length_m, other.width_m)


def _masks(mask: object, count: int, *, is_rig: bool) -> tuple[UInt8Array | None, ...]:
    """Return the mask of each of `count` cameras."""
    if mask is None or not is_rig:
        return (cast("UInt8Array | None", mask),) * count
    if not isinstance(mask, (tuple, list)) or len(mask) != count:
        raise ArgumentError(f"mask of a rig must be a sequence of {count}, None for a camera without one")
    return tuple(mask)


def _with_camera(
    pipeline: OmniPipeline | PinholePipeline | RigPipeline, camera: OmniCamera | PinholeCamera | Rig
) -> OmniPipeline | PinholePipeline | RigPipeline:
    if isinstance(pipeline, RigPipeline):
        assert isinstance(camera, Rig)
        return pipeline.with_rig(camera)
    if isinstance(pipeline, PinholePipeline):
        assert isinstance(camera, PinholeCamera)
        return pipeline.with_camera(camera)
    assert isinstance(camera, OmniCamera)
    return pipeline.with_camera(camera)


class CameraRefiner(Protocol):
    """Refines a camera while frames are looked at, as `calibration.online.OnlineCalibration` does."""

    camera: OmniCamera | PinholeCamera | Rig

    def follow(self, frame: Any, view: View) -> OmniCamera | PinholeCamera | Rig | None:
        """Return a better camera, or None while the current one is good enough; a rig's `frame` is a sequence."""
        ...


class Vision:
    """Turns camera frames into views; one object per camera and thread.

    Parameters
    ----------
    field : Field or str
        The pitch, or the name of a built-in one, or the path of a field file.
    camera : OmniCamera or PinholeCamera, or Rig or sequence of PinholeCamera
        The camera, or the cameras of a rig: `load_rig(path)`, or `(left, right)`. A rig's views are `RigView`.
    colors : Colors, optional
        Fixed colours. Without them, colours are learnt from the first frame and again when the light has changed.
    method : str, optional
        How the pose is estimated. `robocup_vision.localization.methods.METHODS` lists the methods. "field", the default
        of a mirror camera, uses the floor's outline where walls or boards bound it. It uses the white lines where the
        outline is not bounded, fails, or is ambiguous and there is no prior. "floor" uses the outline alone. "edges",
        the default of a pinhole camera of known tilt, uses all edges of the field file that are in view: it follows
        them from frame to frame, and finds the pose without a prior. For such a camera, "field" does this by the lines
        alone, and "floor" by the feet of the walls alone. "goal", the default of a pinhole camera of unknown tilt, uses
        the posts and bar of a goal and the lines around it. Two published methods are kept for comparison: "hull"
        (mirror; Sekimori et al.), by the convex hull of the floor mask, and "angles" (pinhole; Yako et al.), by the
        angles between posts and bar.
    mask : (H, W) uint8, optional
        Non-zero pixels are never used. For a rig a sequence with one mask, or None, for each camera.
    directions : int
        Number J of directions of the free space, all around or over a pinhole camera's field of view.
    rings : int or tuple of float
        The rings of the free space, as in `FreeSpaceGrid`.
    free_ratio : float
        Fraction of a cell that must be floor for the cell to be free: the r_th of Sekimori et al., `threshold` of
        `FreeSpaceGrid`.
    online : CameraRefiner, optional
        An `OnlineCalibration`, which refines this camera, or this rig's mountings, from the frames. `camera`, or `rig`,
        is then the calibration in use, and `online.state`, or `online.mountings`, gives its uncertainty.
    channels : {"bgr", "rgb"}
        Order of the frames' channels: "bgr" as OpenCV reads images; "rgb" as ROS (rgb8), picamera2 and Pillow give
        them. Where balls and goals show the other order, the view has one warning. Where the colours of goals or
        beacons decide the field half, the pose is then `SwappedChannels`, a kind of `NotLocated`.
    memory : Memory, optional
        Combines the frames: `view.belief` is then the estimate over time, and its pose is the prior of the next
        frame. Each frame then needs `t_s`, and `odometry` unless the memory estimates the motion by `ego_motion`.

    Raises
    ------
    ArgumentError
        If `channels` is neither value, the mask's size differs from the camera's, the method does not fit the field or
        the camera, `online` was made for another camera, a pinhole camera is given a memory with `ego_motion`, or the
        cameras do not make a `Rig`.
    """

    def __init__(
        self,
        field: Field | str | Path,
        camera: OmniCamera | PinholeCamera | Rig | Sequence[PinholeCamera],
        colors: Colors | None = None,
        *,
        method: str | None = None,
        mask: UInt8Array | Sequence[UInt8Array | None] | None = None,
        directions: int = 80,
        rings: int | tuple[float, ...] = 20,
        free_ratio: float = FREE_RATIO,
        online: CameraRefiner | None = None,
        memory: Memory | None = None,
        channels: Literal["bgr", "rgb"] = "bgr",
    ) -> None:
        field = as_field(field)
        self.rig = as_rig(camera) if isinstance(camera, (Rig, tuple, list)) else None
        camera = as_camera(camera) if self.rig is None else self.rig.cameras[0]
        if colors is not None:
            require_kind("colors", colors, Colors, "what load_colors(path) returns")
        if memory is not None:
            require_kind("memory", memory, Memory, "a Memory(field)")
        if memory is not None and not _is_same_field(memory.field, field):
            raise ArgumentError(f"memory is of field '{memory.field.name}', this Vision of '{field.name}'")
        directions = as_count("directions", directions, 3, _MAX_DIRECTIONS)
        if not isinstance(rings, (tuple, list)):
            rings = as_count("rings", rings, 1, _MAX_RINGS)
        free_ratio = as_number("free_ratio", free_ratio)
        if not 0.0 < free_ratio <= 1.0:
            raise ArgumentError(f"free_ratio must be above 0 and at most 1, got {free_ratio!r}")
        if online is not None and getattr(online, "camera", None) is not (self.rig or camera):
            raise ArgumentError(f"online must be made for this very {'camera' if self.rig is None else 'Rig'}")
        if memory is not None and memory.ego_motion is not None and isinstance(camera, PinholeCamera):
            raise ArgumentError("the memory's ego_motion needs a mirror camera, which sees all around")
        if memory is not None:
            memory.serve(camera)
        self._memory = memory
        chosen = choose_method(camera, method)
        masks = _masks(mask, 1 if self.rig is None else len(self.rig), is_rig=self.rig is not None)
        options = FrameOptions(chosen, colors, masks[0], directions, rings, channels, free_ratio)
        self._pipeline: OmniPipeline | PinholePipeline | RigPipeline
        if self.rig is not None:
            for other in self.rig.cameras:
                if choose_method(other, method) is not chosen:
                    raise ArgumentError("the cameras of a rig need one method: has each a tilt_rad, or none?")
            self._pipeline = RigPipeline(field, self.rig, tuple(replace(options, mask=one) for one in masks))
        elif isinstance(camera, PinholeCamera):
            self._pipeline = PinholePipeline(field, camera, options)
        else:
            self._pipeline = OmniPipeline(field, camera, options)
        self.field = field
        self.camera = camera
        self.method = chosen.name
        self.mask, self.directions, self.rings, self.free_ratio = masks[0], directions, rings, free_ratio
        self.fixed_colors, self.online = colors, online
        self.channels = channels
        self._is_fresh = True
        # collected since the last view
        self._odometry_warnings: list[str] = []
        self._looked_s: float | None = None
        self._by_edges = chosen.by_edges

    def look(
        self,
        frame: Frame | Sequence[Frame | None] | None,
        t_s: float | Sequence[float | None] | None = None,
        odometry: Pose2 | None = None,
        prior: PoseEstimate | Pose2 | None = None,
        pan_rad: float | None = None,
        mounting: Mounting | None = None,
    ) -> View:
        """See what a frame shows.

        Parameters
        ----------
        frame : (H, W, 3) uint8 or None
            The image, of the camera's size, with the channel order `channels`. None: the camera gave no frame. The pose
            is then `NotLocated`, the free space is that of the last frame moved by the odometry, for half a second at
            most, and the belief is predicted. For a rig a sequence in the order of its cameras, None without a frame.
        t_s : float, optional
            When the frame was taken; copied to the view. Required with a memory. For a rig one time for all frames, or
            a sequence. The view is of the latest time; odometry, or the memory's motion, moves older frames to it.
            Without either, their poses get the uncertainty of the motion that a robot can do in between.
        odometry : Pose2, optional
            The robot's motion since the frame before (for a rig up to the latest time), in the robot frame of that
            moment; it moves the last pose to make a prior. Odometry that no robot can do in that time
            (`PoseFilterSettings`) is ignored, and the view has a warning.
        prior : PoseEstimate or Pose2, optional
            Where the robot probably is. It saves time and ranks candidates that the frame itself does not separate. A
            pinhole camera can refine a prior by a frame that alone would not give a pose.
        pan_rad : float, optional
            Pan of a pinhole camera when the frame was taken, from straight ahead, positive to the left; by default the
            camera file's. Where a camera file has neither pan nor offset, camera and robot have the same pose.
        mounting : Mounting, optional
            How neck and body held a pinhole camera when the frame was taken, as joints or an inertial sensor measured
            it: pan, tilt, roll and height, each with its standard deviation. Values left out are those of the camera
            file. Only method "edges" takes values other than the pan.

        Raises
        ------
        FrameError
            If the frame has another size or type, or the number of frames differs from the number of the rig's cameras.
        ArgumentError
            With a memory: if `t_s` is missing, or runs backwards where odometry is given. If a mirror camera is
            given a pan or mounting, the method or `online` does not take a mounting, or an argument is of another type
            or not finite.
        """
        odometry = None if odometry is None else as_pose("odometry", odometry)
        prior = None if prior is None else as_prior(prior)
        given: RigFrames | None = None
        if self.rig is not None:
            given, t_s = rig_frames(self.rig, frame, t_s, partial(self._motion_between, odometry, self._looked_s))
        else:
            # one camera takes one time: as_time refuses a sequence
            t_s = None if t_s is None else as_time(t_s)
        mounting = self._as_mounting(mounting, None if pan_rad is None else as_angle("pan_rad", pan_rad))
        self._is_fresh = False
        self._check_odometry(odometry, t_s)
        if self._memory is None and self._odometry_warnings:
            odometry = None
        self._looked_s = t_s
        if frame is None or (given is not None and not any(one is not None for one in given.frames)):
            view = self._look_at_nothing(t_s, odometry)
        else:
            # the pipeline refuses a frame that is not uint8
            shown = cast("UInt8Array", frame) if given is None else given
            if self._memory is None:
                view = self._look(shown, t_s, odometry, prior, mounting)
                self._refine_camera(shown, view)
            else:
                view = self._look_and_remember(self._memory, shown, t_s, odometry, prior, mounting)
        if self._odometry_warnings:
            view = replace(view, warnings=(*view.warnings, *self._odometry_warnings))
            self._odometry_warnings.clear()
        return view

    def _check_odometry(self, odometry: Pose2 | None, t_s: float | None) -> None:
        """Add a warning to the next view if no robot can do this odometry in the time since the call before."""
        if odometry is None or t_s is None:
            return
        if self._memory is not None:
            can_move = self._memory.can_move(odometry, t_s)
        elif self._looked_s is not None:
            can_move = PoseFilterSettings().is_possible(odometry, max(t_s - self._looked_s, 0.0))
        else:
            return
        if not can_move:
            way_m, turn_rad = math.hypot(odometry.x_m, odometry.y_m), odometry.theta_rad
            self._odometry_warnings.append(
                f"odometry of {way_m:.3g} m and {turn_rad:.3g} rad at {t_s:g} s is not believed: no robot moves so fast"
            )

    def _motion_between(
        self, odometry: Pose2 | None, before_s: float | None, then_s: float, now_s: float
    ) -> Pose2 | None:
        """Return the robot's motion from `then_s` to `now_s`, in the robot frame at `then_s`; None: not known.

        Parameters
        ----------
        odometry : Pose2 or None
            The motion from the look before to this one.
        before_s : float or None
            The time of the look before.
        then_s, now_s : float
            The times of one camera's frame and of the look.
        """
        if self._memory is not None:
            return self._memory.poses.motion_since(then_s)
        if odometry is None or before_s is None or not before_s < now_s:
            return None
        part = (now_s - then_s) / (now_s - before_s)
        return Pose2(part * odometry.x_m, part * odometry.y_m, part * odometry.theta_rad)

    def _refine_camera(self, frame: UInt8Array | RigFrames, view: View) -> bool:
        """Refine the camera by a frame and its view; return whether it has changed."""
        if self.online is None:
            return False
        if isinstance(frame, RigFrames):
            shown = tuple(None if one is None else to_bgr(one, self.channels) for one in frame.frames)
            better = self.online.follow(shown, view)
        else:
            better = self.online.follow(to_bgr(frame, self.channels), view)
        if better is None:
            return False
        self._pipeline = _with_camera(self._pipeline, better)
        if isinstance(better, Rig):
            self.rig, self.camera = better, better.cameras[0]
        else:
            self.camera = better
        return True

    def _look(
        self,
        frame: UInt8Array | RigFrames,
        t_s: float | None,
        odometry: Pose2 | None,
        prior: PoseEstimate | Pose2 | None,
        mounting: Mounting | None,
    ) -> View:
        if isinstance(frame, RigFrames):
            assert isinstance(self._pipeline, RigPipeline)
            return self._pipeline.look(frame, t_s, odometry, prior)
        assert not isinstance(self._pipeline, RigPipeline)
        if isinstance(self._pipeline, PinholePipeline):
            return self._pipeline.look(frame, t_s, odometry, prior, mounting)
        return self._pipeline.look(frame, t_s, odometry, prior)

    def _as_mounting(self, mounting: Mounting | None, pan_rad: float | None) -> Mounting | None:
        """Combine both arguments into one mounting; None: the camera is held as its file says."""
        if mounting is None and pan_rad is None:
            return None
        if self.rig is not None:
            raise ArgumentError(
                "pan_rad and mounting are for one camera on a head: those of a rig are fixed to the body"
            )
        if not isinstance(self.camera, PinholeCamera):
            raise ArgumentError("pan_rad and mounting are for a pinhole camera on a head: a mirror camera has no pan")
        if mounting is None:
            return Mounting(pan_rad=pan_rad)
        require_kind("mounting", mounting, Mounting, "a Mounting(tilt_rad=..., ...)")
        if pan_rad is not None:
            if mounting.pan_rad is not None:
                raise ArgumentError("the pan is given twice, by pan_rad and by the mounting")
            mounting = replace(mounting, pan_rad=pan_rad)
        if not mounting.pans_only:
            if not self._by_edges:
                raise ArgumentError(
                    f"method '{self.method}' takes no mounting but the pan: method 'edges' does, where the camera file"
                    " has a tilt_rad"
                )
            if self.online is not None:
                raise ArgumentError("online refines how the camera is held at rest: it takes no mounting but the pan")
        return mounting

    def _look_at_nothing(self, t_s: float | None, odometry: Pose2 | None) -> View:
        """Return the view without a frame: the last free space, moved, and the memory's prediction."""
        if self._memory is not None and t_s is None:
            raise ArgumentError(_NO_TIME)
        view = self._pipeline.drop(t_s, odometry)
        if self._memory is None or t_s is None:
            return view
        if odometry is not None:
            self._memory.predict(odometry, t_s)
        return replace(view, belief=self._memory.belief(t_s))

    def _look_and_remember(
        self,
        memory: Memory,
        frame: UInt8Array | RigFrames,
        t_s: float | None,
        odometry: Pose2 | None,
        prior: PoseEstimate | Pose2 | None,
        mounting: Mounting | None,
    ) -> View:
        if t_s is None:
            raise ArgumentError(_NO_TIME)
        by_view = memory.ego_motion is not None
        if odometry is not None and not by_view:
            memory.predict(odometry, t_s)
        if prior is None and self._by_edges:
            prior = memory.prior_estimate(t_s)
        elif prior is None:
            before = memory.prior(t_s)
            # ego-motion is estimated after the look only: until then odometry predicts the motion
            if by_view and before is not None and odometry is not None and memory.can_move(odometry, t_s):
                before = before.compose(odometry)
            prior = before
        view = self._look(frame, t_s, odometry, prior, mounting)
        if self._refine_camera(frame, view) and prior is not None:
            # the view was computed with a camera that this frame has shown to be wrong: the memory must not take it in
            view = self._look(frame, t_s, None, prior, mounting)
        if by_view:
            memory.predict_by_view(view, odometry)
        return replace(view, belief=memory.update(view))

    def predict(self, odometry: Pose2, t_s: float) -> None:
        """Predict the memory's belief, at a control step without a frame.

        Parameters
        ----------
        odometry : Pose2
            The robot's motion since the last step, in the robot frame of that moment.
        t_s : float
            Time of the end of the motion.

        Raises
        ------
        ArgumentError
            If there is no memory, or time runs backwards.
        """
        if self._memory is None:
            raise ArgumentError("predict needs a memory: Vision(..., memory=Memory(field))")
        self._is_fresh = False
        odometry, t_s = as_pose("odometry", odometry), as_time(t_s)
        self._check_odometry(odometry, t_s)
        self._memory.predict(odometry, t_s)

    def forget(self) -> None:
        """Forget learnt colours, the last pose and the memory's state: the next frame is the first one again."""
        self._pipeline.forget()
        self._odometry_warnings.clear()
        self._looked_s = None
        if self._memory is not None:
            self._memory.forget()
        # a refined camera is kept
        self._is_fresh = self.online is None

    @property
    def memory(self) -> Memory | None:
        """What combines the frames over time; None: each frame is used alone."""
        return self._memory

    @property
    def is_fresh(self) -> bool:
        """Whether nothing is remembered yet: another object made with the same arguments would see the same."""
        return self._is_fresh and (self._memory is None or self._memory.poses.is_fresh)

    @property
    def colors(self) -> Colors | None:
        """The colours in use, None before the first frame."""
        return self._pipeline.colors

    @property
    def swapped_channels_nats(self) -> float:
        """Log-likelihood ratio, in nats, of swapped red and blue channels over the stated order.

        It adds up the balls and goals seen since the last `forget`; 0: no evidence. From ln(100) on, views have a
        warning and poses may be `SwappedChannels`.
        """
        return self._pipeline.swapped_channels_nats

    @property
    def polar(self) -> PolarView | FloorView:
        """The floor samples that a frame is reduced to.

        Raises
        ------
        ArgumentError
            If the camera maps no pixel to the floor (its tilt is unknown, or it looks above the floor), or this is a
            rig, each camera of which has its own samples in `view.views`.
        """
        polar = self._pipeline.polar
        if polar is None:
            raise ArgumentError(_NO_FLOOR if self.rig is None else _RIG_HAS_NO_SAMPLES)
        return polar

    @property
    def grid(self) -> FreeSpaceGrid:
        """The cells of the free space; raises as `polar` does."""
        grid = self._pipeline.grid
        if grid is None:
            raise ArgumentError(_NO_FLOOR if self.rig is None else _RIG_HAS_NO_SAMPLES)
        return grid

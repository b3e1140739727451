"""Camera models: pixels <-> rays <-> floor, and their files."""

from robocup_vision.camera.files import Camera, load_camera, save_camera
from robocup_vision.camera.fisheye import FisheyeCamera
from robocup_vision.camera.floor_range import FloorRange, Hyperboloid, Table, Tangent
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import Mounting, PinholeCamera, camera_rotation
from robocup_vision.camera.rig import Rig, load_camera_or_rig, load_rig, save_rig
from robocup_vision.camera.rolling_shutter import RollingShutter

__all__ = [
    "Camera",
    "FisheyeCamera",
    "FloorRange",
    "Hyperboloid",
    "Mounting",
    "OmniCamera",
    "PinholeCamera",
    "Rig",
    "RollingShutter",
    "Table",
    "Tangent",
    "camera_rotation",
    "load_camera",
    "load_camera_or_rig",
    "load_rig",
    "save_camera",
    "save_rig",
]

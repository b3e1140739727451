"""Camera models: pixels <-> rays <-> floor, and their files."""

from robocup_vision.camera.files import load_camera, save_camera
from robocup_vision.camera.floor_range import FloorRange, Hyperboloid, Table, Tangent
from robocup_vision.camera.omni import OmniCamera

__all__ = ["FloorRange", "Hyperboloid", "OmniCamera", "Table", "Tangent", "load_camera", "save_camera"]

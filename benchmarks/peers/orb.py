"""ORB features, to compare with SIFT: binary descriptors in a fraction of the time, and coarser."""

from __future__ import annotations

import cv2
import numpy as np

from robocup_vision.arguments import as_frame
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.landmarks.features import Features, features_of


class OrbExtractor:
    """Finds ORB features: a fraction of SIFT's time, and coarser. A map must be made with what it is used with.

    Parameters
    ----------
    camera : PinholeCamera
        As for `SiftExtractor`.
    """

    def __init__(self, camera: PinholeCamera) -> None:
        self.camera = camera
        self._orb = cv2.ORB.create(nfeatures=800)

    def extract(self, frame: UInt8Array) -> Features:
        """Find the features of a frame, (H, W, 3) uint8 BGR; the descriptors' 256 bits as unit vectors."""
        as_frame(frame, self.camera.size_px)
        keypoints, packed = self._orb.detectAndCompute(cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY), None)
        if packed is None:
            return features_of(self.camera, (), None)
        bits = np.unpackbits(np.asarray(packed, dtype=np.uint8), axis=1)
        features = features_of(self.camera, keypoints, bits.astype(np.float32))
        octave = np.array([k.octave for k in keypoints], dtype=np.float64)
        scale = np.asarray(float(self._orb.getScaleFactor()) ** octave, dtype=np.float64)
        return Features(features.pixels, features.size_px, scale, features.contrast, features.descriptors)

"""Where to look: for the pose, for the half of the field, and for the way ahead, each beside simpler rules.

Pose (Miura and Shirai 2004, section 6.1; gaze_pose.py): a dog walks among five others and pans its head. Landmarks are
measured as the detectors of the first table measure them, and followed by a Kalman filter of bearings and elevations;
then the same with rendered frames, the goal localiser and PoseFilter themselves. RMS and |P|^(1/6) are medians over
runs. A frame is lost where the position errs by over 0.5 m.
"""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor

import gaze_half
import gaze_pose
from harness import finish, parse_arguments


def main() -> None:
    """Measure and print."""
    arguments = parse_arguments(str(__doc__))
    with ProcessPoolExecutor(2) as pool:
        results = [part.measure(arguments, pool) for part in (gaze_pose, gaze_half)]
    finish(arguments.check, all(results))


if __name__ == "__main__":
    main()

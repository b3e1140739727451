"""Where to look: for the pose, for the half of the field, and for the way ahead, each beside simpler rules.

Pose (Miura and Shirai 2004, section 6.1; gaze_pose.py): a dog walks among five others and pans its head. Landmarks are
measured as the detectors of the first table measure them, and followed by a Kalman filter of bearings and elevations;
then the same with rendered frames, the goal localiser and PoseFilter themselves. RMS and |P|^(1/6) are medians over
runs; both must hold the targets. A frame is lost where the position errs by over 0.5 m.

Half of the field (section 4.2; gaze_half.py): a pose or its half turn, each as likely; looks are rendered frames and
what the goal localiser says of them without a prior, until 0.1 nat is left. Rules are compared on the questions that
all of them answered. The chances that the planner goes by were counted on other pictures.

The way ahead (section 4.1; gaze_refinement.py): a coarse scan leaves undecided what lies behind the nearest thing in
its bearing; a look settles 20 degrees, and one in ten looks is in vain. Every rule stops when the shortest path is
free of doubt; the best path is the one planned when everything in sight has been looked at.
"""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor

import gaze_half
import gaze_pose
import gaze_refinement
from harness import finish, parse_arguments


def main() -> None:
    """Measure and print."""
    arguments = parse_arguments(str(__doc__))
    with ProcessPoolExecutor(2) as pool:
        results = [part.measure(arguments, pool) for part in (gaze_pose, gaze_half, gaze_refinement)]
    finish(arguments.check, all(results))


if __name__ == "__main__":
    main()

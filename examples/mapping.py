"""What a robot remembers: it drives over a field with others on it, and knows its place, their ways and the free floor.

The robot is simulated, its frames and odometry are all that the code sees; on a robot they come from its own driver.
"""

import math
from pathlib import Path

import cv2
import numpy as np

from field_models import load_field
from robocup_vision import Memory, Vision
from robocup_vision.mapping.occupancy import FREE, NO_GO
from sim2d.match.arena import Arena
from sim2d.robot_link import Command

OUT = Path("out")

field = load_field("ssl_2001")
arena = Arena(field, players=2, seed=5)
memory = Memory.of_everything(field)
vision = Vision(field, arena.camera, memory=memory)

for period in range(150):
    senses = arena.senses()[0]
    view = vision.look(senses.frame, senses.t_s, odometry=senses.odometry)
    belief = view.belief
    assert belief is not None  # with a memory there is one
    free_map = belief.free_map
    assert free_map is not None

    if period % 30 == 29 and belief.pose:
        x_m, y_m, theta_rad = belief.pose.pose.array
        print(f"{belief.t_s:4.1f} s  at {x_m:+.2f} m, {y_m:+.2f} m, {math.degrees(theta_rad):+.0f} deg", end="")
        print(f", sure to {1000 * belief.pose.std[:2].max():.0f} mm")
        for track in belief.tracks:
            print(f"    robot at {track.x_m:+.2f} m, {track.y_m:+.2f} m", end="")
            print(f", going {track.vx_mps:+.2f} m/s, {track.vy_mps:+.2f} m/s")
        free, no_go = ((free_map.state == kind).sum() * free_map.cell_m**2 for kind in (FREE, NO_GO))
        print(f"    {free:.1f} m2 of free floor, {no_go:.1f} m2 that must not be entered")
    arena.step({0: Command(0.3, 0.0, 0.2), 1: Command(0.3, 0.0, -0.9), 2: Command(0.3, 0.0, 0.9)})

OUT.mkdir(exist_ok=True)
colors = np.array([(90, 160, 90), (60, 60, 200), (120, 120, 120)], dtype=np.uint8)
assert free_map is not None
picture = colors[free_map.state.T[::-1]]
cv2.imwrite(str(OUT / "map.png"), cv2.resize(picture, None, fx=5, fy=5, interpolation=cv2.INTER_NEAREST))
print(f"the map: {OUT / 'map.png'}")

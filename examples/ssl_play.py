"""Two teams of the small-size league's protocols play a match: ours by overhead vision, on a simulator of its own.

With a simulator or a game controller that runs already, leave those lines out.
"""

import subprocess
import sys
import time

from field_models import load_field
from robocup_vision.ssl import RefereeClient, Team
from sim2d.network.team.client import TeamClient

PORTS = ["--vision-port=30020", "--control-port=30300", "--tracker-port=30010", "--referee-port=30003"]
command = [sys.executable, "-m", "robocup_vision.cli", "simulate", "--players=2", "--seconds=60", *PORTS]
simulator = subprocess.Popen([*command, "--referee=match", "--built-in=blue=overhead"])

with (
    RefereeClient(30003) as referee,
    TeamClient(
        Team.YELLOW, load_field("ssl_division_b"), vision_port=30020, referee_port=30003, robot_port=30302
    ) as team,
):
    referee.receive(timeout_s=20.0)  # it runs
    end_s = time.monotonic() + 10.0
    team.run(lambda: time.monotonic() < end_s)
    while packet := referee.receive(timeout_s=0.0):
        if referee.new_command:
            print(packet.command.name)
    print(dict(sorted(team.team.intents.items())))
simulator.kill()
simulator.wait()

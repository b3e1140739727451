"""Watches vision and referee of the small-size league with asyncio; every packet is written to a log, then scored.

Starts a simulator of its own on the loopback; with another one running, leave that line out.
"""

import asyncio
import subprocess
import sys
import time
from pathlib import Path

from robocup_vision.ssl import RefereeClient, SslLog, SslLogWriter, TrackerClient, VisionClient, log_entry
from robocup_vision.ssl.log_score import score_log

LOG = Path("out/watched.log.gz")
PORTS = ["--vision-port=30020", "--control-port=30300", "--tracker-port=30010", "--referee-port=30003"]
simulator = subprocess.Popen(
    [sys.executable, "-m", "robocup_vision.cli", "simulate", "--realism=rc2021", "--seconds=60", *PORTS]
)


async def watch(client: VisionClient | TrackerClient | RefereeClient, log: SslLogWriter, until_s: float) -> None:
    """Write what a client receives until a time."""
    while time.monotonic() < until_s:
        packet = await client.receive_async(timeout_s=1.0)
        if packet is not None:
            log.write(log_entry(time.time_ns(), packet))


async def main() -> None:
    """Listen to all three at once."""
    with VisionClient(30020) as vision, TrackerClient(30010) as tracker, RefereeClient(30003) as referee:
        with SslLogWriter(LOG) as log:
            await asyncio.to_thread(vision.receive, 20.0)
            until_s = time.monotonic() + 3.0
            await asyncio.gather(*(watch(client, log, until_s) for client in (vision, tracker, referee)))
        if vision.geometry and referee.newest:
            print(f"field {vision.geometry.field.length_m:g} m long, referee says {referee.newest.command.name}")


LOG.parent.mkdir(exist_ok=True)
asyncio.run(main())
simulator.kill()
simulator.wait()
with SslLog(LOG) as log:
    score = score_log(log)
    print(f"{LOG}: {len(log.places)} packets")
    if score.robot_rms_m is not None:
        print(f"a robot is tracked to {1000 * score.robot_rms_m:.1f} mm")

"""A player that learns: it drives by what it sees alone, and the cross-entropy method finds the numbers it drives by.

Each generation plays one match for each of some tables of numbers, drawn about a mean, against an opponent that stands
still; the best ones give the next mean and spread. `python examples/learn_to_score.py --minutes 10 --jobs 2` trains for
ten minutes and prints what it found. Without arguments it trains for a moment, and plays a short match with the numbers
below, which were found so. Needs the extra `rl`.
"""

import argparse
import functools
import math
import multiprocessing
import time
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from sim2d.match.env import MatchEnv

Numbers = npt.NDArray[np.float64]
Piece = tuple[Numbers, int, float]  # numbers, seed and seconds of a match
Result = tuple[float, int, int]  # fitness, goals for and against

ME, OTHER = "plus_0", "minus_0"
GOAL_M, MAX_AGE = 1.37, 45  # where the goal is on ssl_2001; periods after which an unseen ball is forgotten
LIMITS = np.array([1.0, 1.0, 6.0])  # forward m/s, left m/s, turn rad/s
SIZE = 14
TRAINED = [-0.07, 1.77, 0.77, 0.12, -0.55, 0.16, 0.84, 1.37, -0.08, -1.7, 0.95, 1.41, 0.96, -0.13]


class Driver:
    """Drives by some numbers, from percepts; what is on its left it treats as what is on its right."""

    def __init__(self, numbers: Numbers) -> None:
        self.numbers = numbers.tolist()
        self.ball, self.age = np.zeros(2), MAX_AGE

    def act(self, seen: dict[str, Any]) -> dict[str, Any]:
        """Return the action for an observation."""
        self.follow_ball(seen)
        n, kicks = self.numbers, False
        if seen["ball_in_mouth"] and seen["located"]:
            x_m, y_m, cos, sin = map(float, seen["pose"])
            off_rad = math.atan2(-y_m, GOAL_M - x_m) - math.atan2(sin, cos)
            ahead, aside = math.cos(off_rad), math.sin(off_rad)
            wanted = n[0] + n[1] * ahead, n[2] * aside, n[3] * aside
            kicks = n[4] + n[5] * ahead > 0.0
        elif self.age < MAX_AGE:
            x_m, y_m = self.ball
            off_rad = math.atan2(y_m, x_m)
            wanted = n[6] + n[7] * x_m + n[8] * abs(off_rad), n[9] * y_m + n[10] * off_rad, n[11] * off_rad
        else:
            wanted = n[12], 0.0, n[13]
        velocity = np.clip(wanted, -1.0, 1.0) * LIMITS
        kick_mps = np.array([2.0 if kicks else 0.0], np.float32)
        return {"velocity": velocity.astype(np.float32), "kick_mps": kick_mps, "dribble": 1}

    def follow_ball(self, seen: dict[str, Any]) -> None:
        """Keep where the ball was seen last, robot frame: it moves as the robot moves the other way."""
        dx_m, dy_m, turn_rad = map(float, seen["odometry"])
        c, s = math.cos(turn_rad), math.sin(turn_rad)
        x_m, y_m = self.ball - (dx_m, dy_m)
        self.ball, self.age = np.array([c * x_m + s * y_m, c * y_m - s * x_m]), self.age + 1
        if seen["ball_seen"]:
            self.ball, self.age = np.asarray(seen["ball_m"], dtype=np.float64), 0


@functools.cache
def env_of(seconds: float) -> MatchEnv:
    """Return the environment of this process: making one takes longer than a match."""
    cv2.setNumThreads(0)
    return MatchEnv("ssl_2001", 1, seconds, observation="percepts")


def play(piece: Piece) -> Result:
    """Play a match against an opponent that stands still."""
    numbers, seed, seconds = piece
    env, driver, worth = env_of(seconds), Driver(numbers), 0.0
    seen, infos = env.reset(seed)
    still = {"velocity": np.zeros(3, np.float32), "kick_mps": np.zeros(1, np.float32), "dribble": 0}
    while env.agents:
        seen, _, _, _, infos = env.step({ME: driver.act(seen[ME]), OTHER: still})
        # the judge of the training may know the truth, the driver does not
        truth = env.state()
        x_m, y_m, cos, sin = map(float, truth[:4])
        ball_x_m, ball_y_m = map(float, truth[14:16])
        away_m = math.dist((x_m + 0.11 * cos, y_m + 0.11 * sin), (ball_x_m, ball_y_m))
        worth += (ball_x_m - min(away_m, 1.0)) / (30.0 * seconds)
    ours, theirs = infos[ME]["own_goals"], infos[ME]["other_goals"]
    return 3.0 * (ours - theirs) + worth, ours, theirs


def play_all(pieces: list[Piece], pool: Any) -> list[Result]:
    """Play matches, in the processes of a pool if there is one."""
    return [play(piece) for piece in pieces] if pool is None else list(pool.map(play, pieces, chunksize=1))


def train(minutes: float, pool: Any, population: int, seconds: float) -> Numbers:
    """Return the numbers that the cross-entropy method finds in so many minutes."""
    rng, began, generation = np.random.default_rng(1), time.monotonic(), 0
    mean, std = np.zeros(SIZE), np.ones(SIZE)
    while generation == 0 or time.monotonic() - began < 60.0 * minutes:
        drawn = mean + std * rng.standard_normal((population, SIZE))
        # all of a generation play the same match
        results = play_all([(numbers, 1000 + generation, seconds) for numbers in drawn], pool)
        fitness = np.array([result[0] for result in results])
        best = drawn[np.argsort(-fitness)[: max(2, population // 6)]]
        # a part of the old spread stays, or a lucky generation would end the search
        std = np.sqrt(0.3 * std**2 + 0.7 * best.var(axis=0) + (0.15 * 0.85**generation) ** 2)
        mean = 0.3 * mean + 0.7 * best.mean(axis=0)
        goals = sum(result[1] for result in results)
        print(
            f"generation {generation}: fitness {fitness.max():.2f}, mean {fitness.mean():.2f}, {goals} goals",
            flush=True,
        )
        print("numbers:", [round(float(value), 2) for value in mean], flush=True)
        generation += 1
    return mean


def main() -> None:
    """Train, then play against the opponent that stands still, in matches that it was not trained in."""
    parser = argparse.ArgumentParser(description="Train a player that drives by percepts.")
    parser.add_argument("--minutes", type=float, default=0.0, help="train so long (default: one small generation)")
    parser.add_argument("--jobs", type=int, default=1, help="processes (default: 1)")
    parser.add_argument("--matches", type=int, default=0, help="play so many matches of 30 s with the numbers")
    options = parser.parse_args()
    pool = multiprocessing.get_context("spawn").Pool(options.jobs) if options.jobs > 1 else None
    numbers = np.array(TRAINED)
    if options.minutes > 0.0:
        numbers = train(options.minutes, pool, population=42, seconds=6.0)
    elif not options.matches:
        train(0.0, pool, population=4, seconds=1.0)
    matches, seconds = (options.matches, 30.0) if options.matches else (1, 5.0)
    results = play_all([(numbers, seed, seconds) for seed in range(matches)], pool)
    goals = [sum(result[k] for result in results) for k in (1, 2)]
    print(f"{matches} matches of {seconds:g} s against an opponent that stands: goals {goals[0]} : {goals[1]}")
    if pool is not None:
        pool.terminate()


if __name__ == "__main__":
    main()

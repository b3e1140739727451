"""A match as a PettingZoo ParallelEnv: every robot an agent with its own camera (extra `rl`)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import cv2
import numpy as np
import numpy.typing as npt

from field_models import Field, load_field
from field_models.errors import ArgumentError
from robocup_vision.camera import PinholeCamera
from robocup_vision.geometry import Pose2
from robocup_vision.memory import Memory
from robocup_vision.vision import Vision
from sim2d.match.arena import Arena
from sim2d.match.disturbances import NONE
from sim2d.match.match import periods
from sim2d.match.setups import Camera, RobotKind, setup_for
from sim2d.report.top_view import TopView
from sim2d.robot_link import Command, RobotLimits, Senses
from sim2d.sensors.faults import Fault
from sim2d.world.state import WorldState

try:
    from gymnasium import spaces
    from pettingzoo import ParallelEnv  # type: ignore[import-untyped]
except ImportError as error:
    raise ImportError(f"sim2d.match.env needs the extra `rl`: pip install 'robocup-vision[rl]' ({error})") from None

Observation = dict[str, Any]
Action = dict[str, Any]

_PICTURE_PX = (900, 560)
_FURTHEST_M = 100.0


class MatchEnv(ParallelEnv):  # type: ignore[misc]
    """A match in which the user's policies play.

    Agents are ``plus_0``, ``plus_1``, ... (they attack the goal at +x) and ``minus_0``, ...; a step is a control period
    of 1/30 s. The reward is 1 for every agent of a side that scores, -1 for every agent of the other. A match is
    truncated after `seconds`; it never terminates.

    Actions are a `Dict`:

    - ``velocity``: Box (3,), wanted velocity in the robot frame: forward m/s, left m/s, turn rad/s.
    - ``kick_mps``: Box (1,), speed to kick the ball with, m/s; 0: do not kick.
    - ``dribble``: Discrete(2), whether the dribbler spins.
    - ``pan_rad``: Box (1,), wanted pan of the head, rad; only with a pinhole camera.

    Observations are a `Dict`, always with

    - ``odometry``: Box (3,), motion since the observation before, in the robot frame at that time: m, m, rad.
    - ``ball_in_mouth``: Discrete(2), the light barrier.
    - ``kick_off``: Discrete(3), 0: the ball is in play; 1: the own side kicks off; 2: the other side does.

    with ``observation="image"`` also

    - ``frame``: Box (H, W, 3) uint8, BGR; black if none came.
    - ``is_fresh``: Discrete(2), whether a frame came.
    - ``frame_pan_rad``: Box (1,), pan of the head when the frame was exposed, rad, 0 if none came; only with a pinhole
      camera.

    with ``observation="percepts"`` (mirror cameras only) the estimates of `Vision` and `PoseFilter` from frames and
    odometry, never the truth:

    - ``located``: Discrete(2), whether there is an estimated pose.
    - ``pose``: Box (4,), x m, y m, cos, sin of the estimated pose, in the side's own frame: x towards the goal it
      attacks. Zeros without an estimate.
    - ``free_range_m``: Box (80,), free range in metres in 80 directions, counter-clockwise, starting at the back.
    - ``ball_seen``: Discrete(2), whether the last frame showed the ball.
    - ``ball_m``: Box (2,), the ball in the robot frame: forward m, left m. Zeros if it was not seen.

    Parameters
    ----------
    field : Field or str
        The pitch, or its name or file.
    players, camera, robot, faults
        As in `Arena`, in every match.
    limits : RobotLimits, optional
        Limits of every robot, in place of the kind's; they bound the actions.
    seconds : float
        Length of a match.
    observation : {"image", "percepts"}
        See above.
    render_mode : {"rgb_array"}, optional
        Whether `render` returns the match from above.

    Raises
    ------
    ArgumentError
        If a parameter is out of its range.
    """

    metadata = {"name": "robocup_match_v0", "render_modes": ["rgb_array"], "render_fps": 30}  # noqa: RUF012

    def __init__(
        self,
        field: Field | str = "ssl_2001",
        players: int | None = None,
        seconds: float = 60.0,
        *,
        observation: Literal["image", "percepts"] = "image",
        camera: Camera | None = None,
        robot: RobotKind | None = None,
        limits: RobotLimits | None = None,
        faults: Sequence[Fault] = (),
        render_mode: str | None = None,
    ) -> None:
        if observation not in ("image", "percepts"):
            raise ArgumentError(f"observation must be image or percepts, got {observation!r}")
        if render_mode not in (None, "rgb_array"):
            raise ArgumentError(f"render_mode must be rgb_array or None, got {render_mode!r}")
        if not 0 < seconds < math.inf:
            raise ArgumentError(f"seconds must be positive, got {seconds!r}")
        self._field = load_field(field) if isinstance(field, str) else field
        setup = setup_for(self._field, players=players, camera=camera, robot=robot, limits=limits)
        if setup.rig is not None:
            raise ArgumentError("an agent's observation is of one camera, and these robots carry several")
        players, self._camera, self._robot = setup.players, setup.camera, setup.robot
        if observation == "percepts" and isinstance(self._camera, PinholeCamera):
            raise ArgumentError("percepts need a mirror camera; a pinhole camera has observation='image'")
        self._players, self._periods = players, periods(seconds)
        self._limits = self._robot.limits
        self._faults = tuple(faults)
        self.render_mode = render_mode
        self.possible_agents = [f"{side}_{number}" for side in ("plus", "minus") for number in range(players)]
        self.agents: list[str] = []
        self._percepts: dict[str, _Percepts] = {}
        if observation == "percepts":
            self._percepts = {agent: _Percepts(self._field, self._camera) for agent in self.possible_agents}
        self.observation_spaces = {agent: self._make_observation_space() for agent in self.possible_agents}
        self.action_spaces = {agent: self._make_action_space() for agent in self.possible_agents}
        self._rng = np.random.default_rng()
        self._arena: Arena | None = None
        self._step = 0
        self._top: TopView | None = None

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return an agent's observation space, the same object every time."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return an agent's action space, the same object every time."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Begin a match. The same seed gives the same match; without one, the next match of the series begins."""
        if seed is not None:
            self._rng = np.random.default_rng(seed)
        self._arena = Arena(
            self._field,
            self._players,
            int(self._rng.integers(2**31)),
            camera=self._camera,
            robot=self._robot,
            faults=self._faults,
            disturbances=NONE,
        )
        for percepts in self._percepts.values():
            percepts.forget()
        self.agents = list(self.possible_agents)
        self._step = 0
        state = self._arena.state
        return self._observe(self._arena), {agent: self._info(agent, state) for agent in self.agents}

    def step(
        self, actions: dict[str, Action]
    ) -> tuple[dict[str, Observation], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Let each agent's robot obey its action for a control period; one without an action stops.

        Raises
        ------
        ArgumentError
            If an action is not finite or of another shape, an agent is unknown, or no match has begun.
        """
        arena = self._begun()
        if not self.agents:
            return {}, {}, {}, {}, {}
        before = arena.state.score
        if not isinstance(actions, Mapping):
            raise ArgumentError(f"actions must be a dict of actions by agent, got {type(actions).__name__}")
        for agent in actions:
            if agent not in self.possible_agents:
                raise ArgumentError(f"there is no agent {agent!r}, only {', '.join(self.possible_agents)}")
        commands = {self.possible_agents.index(agent): _command(agent, action) for agent, action in actions.items()}
        state = arena.step(commands)
        self._step += 1
        gain = float((state.score[0] - before[0]) - (state.score[1] - before[1]))
        agents, is_over = self.agents, self._step >= self._periods
        observations = self._observe(arena)
        if is_over:
            self.agents = []
        return (
            observations,
            {agent: gain if agent.startswith("plus") else -gain for agent in agents},
            dict.fromkeys(agents, False),
            dict.fromkeys(agents, is_over),
            {agent: self._info(agent, state) for agent in agents},
        )

    def render(self) -> npt.NDArray[np.uint8] | None:
        """Return the match from above, (H, W, 3) uint8 RGB; None without a render mode."""
        if self.render_mode is None:
            return None
        if self._top is None:
            self._top = TopView(self._field, _PICTURE_PX, self._limits.radius_m)
        picture = self._top.draw(self._begun().state)
        return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), dtype=np.uint8)

    def state(self) -> npt.NDArray[np.float32]:
        """Return the truth for centralised critics, field frame; with P players a side (14 P + 4,) float32.

        For each of the 2 P robots x m, y m, cos, sin, velocity x and y m/s, turn rad/s; then the ball's x m, y m and
        velocity x and y m/s.
        """
        state = self._begun().state
        values: list[float] = []
        for robot in state.robots:
            x_m, y_m, theta_rad = robot.pose.array.tolist()
            values += [x_m, y_m, math.cos(theta_rad), math.sin(theta_rad), *robot.velocity_mps, robot.turn_rps]
        if state.ball is not None:
            values += [state.ball.x_m, state.ball.y_m, state.ball.vx_mps, state.ball.vy_mps]
        return np.array(values, dtype=np.float32)

    def _begun(self) -> Arena:
        if self._arena is None:
            raise ArgumentError("no match has begun: call reset first")
        return self._arena

    def _make_observation_space(self) -> spaces.Dict:
        parts: dict[str, spaces.Space[Any]] = {
            "odometry": _box([-1.0, -1.0, -math.pi], [1.0, 1.0, math.pi]),
            "ball_in_mouth": spaces.Discrete(2),
            "kick_off": spaces.Discrete(3),
        }
        if self._percepts:
            directions = next(iter(self._percepts.values())).directions
            parts["located"] = spaces.Discrete(2)
            parts["pose"] = _box([-_FURTHEST_M, -_FURTHEST_M, -1, -1], [_FURTHEST_M, _FURTHEST_M, 1, 1])
            parts["free_range_m"] = _box([0.0] * directions, [_FURTHEST_M] * directions)
            parts["ball_seen"] = spaces.Discrete(2)
            parts["ball_m"] = _box([-_FURTHEST_M] * 2, [_FURTHEST_M] * 2)
        else:
            width, height = self._camera.size_px
            parts["frame"] = spaces.Box(0, 255, (height, width, 3), np.uint8)
            parts["is_fresh"] = spaces.Discrete(2)
            if isinstance(self._camera, PinholeCamera):
                parts["frame_pan_rad"] = self._pan_space()
        return spaces.Dict(parts)

    def _make_action_space(self) -> spaces.Dict:
        limits = self._limits
        fastest = [limits.speed_mps, limits.speed_mps, limits.turn_rps]
        parts: dict[str, spaces.Space[Any]] = {
            "velocity": _box([-value for value in fastest], fastest),
            "kick_mps": _box([0.0], [limits.kick_speed_mps]),
            "dribble": spaces.Discrete(2),
        }
        if isinstance(self._camera, PinholeCamera):
            parts["pan_rad"] = self._pan_space()
        return spaces.Dict(parts)

    def _pan_space(self) -> spaces.Box:
        return _box([-self._limits.pan_limit_rad], [self._limits.pan_limit_rad])

    def _observe(self, arena: Arena) -> dict[str, Observation]:
        return {
            agent: self._observation(agent, senses)
            for agent, senses in zip(self.possible_agents, arena.senses(), strict=True)
        }

    def _observation(self, agent: str, senses: Senses) -> Observation:
        space = self.observation_spaces[agent]
        values: Observation = {
            "odometry": senses.odometry.array,
            "ball_in_mouth": int(senses.ball_in_mouth),
            "kick_off": 0 if senses.phase == "play" else 1 if senses.own_turn else 2,
        }
        if self._percepts:
            values |= self._percepts[agent].look(senses, agent.startswith("plus"))
        else:
            frame = senses.frame
            values["frame"] = np.zeros(space["frame"].shape, np.uint8) if frame is None else frame.copy()
            values["is_fresh"] = int(frame is not None)
            if "frame_pan_rad" in space.spaces:
                values["frame_pan_rad"] = [senses.frame_pan_rad or 0.0]
        return {name: _fitted(space[name], value) for name, value in values.items()}

    def _info(self, agent: str, state: WorldState) -> dict[str, Any]:
        ours, theirs = state.score if agent.startswith("plus") else state.score[::-1]
        return {"t_s": state.t_s, "own_goals": ours, "other_goals": theirs}


class _Percepts:
    """Estimates from one robot's frames and odometry."""

    def __init__(self, field: Field, camera: Camera) -> None:
        self._memory = Memory(field)
        self._vision = Vision(field, camera, memory=self._memory)
        self.directions = len(self._vision.grid.bearing_rad)
        self.forget()

    def forget(self) -> None:
        """Forget the match before."""
        self._vision.forget()
        self._free_range_m = np.zeros(self.directions)
        self._ball_m: tuple[float, float] | None = None

    def look(self, senses: Senses, attacks_plus: bool) -> Observation:
        """Return the percepts after these senses; without a frame, floor and ball are those of the last one."""
        self._memory.predict(senses.odometry, senses.t_s)
        if senses.frame is not None and senses.frame_t_s is not None:
            view = self._vision.look(senses.frame, senses.frame_t_s)
            self._free_range_m = view.free_space.range_m
            self._ball_m = None if view.ball is None else (view.ball.x_m, view.ball.y_m)
        belief = self._memory.poses.belief
        pose = [0.0] * 4
        if belief:
            place: Pose2 = belief.pose if attacks_plus else belief.pose.half_turn()
            pose = [place.x_m, place.y_m, math.cos(place.theta_rad), math.sin(place.theta_rad)]
        return {
            "located": int(bool(belief)),
            "pose": pose,
            "free_range_m": self._free_range_m,
            "ball_seen": int(self._ball_m is not None),
            "ball_m": self._ball_m or (0.0, 0.0),
        }


def _box(low: Sequence[float], high: Sequence[float]) -> spaces.Box:
    return spaces.Box(np.array(low, dtype=np.float32), np.array(high, dtype=np.float32), dtype=np.float32)


def _fitted(space: spaces.Space[Any], value: Any) -> Any:
    """Convert a value to its space's type and clip it to the bounds, which only a pushed robot exceeds."""
    if isinstance(space, spaces.Box) and space.dtype == np.float32:
        return np.clip(np.asarray(value, dtype=np.float32), space.low, space.high)
    return value


def _command(agent: str, action: Action) -> Command:
    forward_mps, left_mps, turn_rps = _values(agent, action, "velocity", 3)
    [kick_mps] = _values(agent, action, "kick_mps", 1)
    [dribble] = _values(agent, action, "dribble", 1)
    pan = _values(agent, action, "pan_rad", 1) if isinstance(action, Mapping) and "pan_rad" in action else None
    return Command(forward_mps, left_mps, turn_rps, kick_mps, bool(dribble), None if pan is None else pan[0])


def _values(agent: str, action: Action, key: str, count: int) -> list[float]:
    """Return the numbers of a part of an action.

    Raises
    ------
    ArgumentError
        If the part is missing, or of another shape.
    """
    if not isinstance(action, Mapping) or key not in action:
        got = ", ".join(map(str, action)) if isinstance(action, Mapping) else type(action).__name__
        raise ArgumentError(
            f"the action of {agent} must be a dict with the keys of its action space, got {got or '{}'}"
        )
    try:
        values = np.asarray(action[key], dtype=np.float64)
    except (TypeError, ValueError):
        raise ArgumentError(f"the action of {agent}: {key} must be numbers, got {action[key]!r}") from None
    if values.size != count or values.ndim > 1:
        raise ArgumentError(f"the action of {agent}: {key} must have the shape ({count},), got {values.shape}")
    return [float(value) for value in values.reshape(-1)]

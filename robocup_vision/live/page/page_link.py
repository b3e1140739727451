"""One open page: which moment it shows, what it is sent next, and its requests."""

from __future__ import annotations

import bisect
from collections.abc import Iterator, Mapping
from typing import Any

from field_models.field import COLOR_NAMES
from robocup_vision.live.handover.controls import Controls
from robocup_vision.live.handover.moment import RobotSetup
from robocup_vision.live.page.feed import Feed
from robocup_vision.live.page.picture import Picture

# largest number of a robot's pictures on their way to a page: one is drawn while the next one is transmitted
_MAX_ON_THE_WAY = 2


class PageLink:
    """Chooses what a page is sent, independently of sockets."""

    def __init__(self, feed: Feed, controls: Controls) -> None:
        self._feed, self._controls = feed, controls
        self._sent: dict[str, Picture] = {}
        self._on_the_way: dict[str, list[int]] = {}
        self._version = -1
        self._setups: tuple[RobotSetup, ...] | None = None
        # while the page stands still: pictures of each robot, and the time shown; None: it follows the newest moment
        self._kept: Mapping[str, tuple[Picture, ...]] = {}
        self._at_s: float | None = None
        self._must_tell = True

    @property
    def stands_still(self) -> bool:
        """Whether it shows a fixed moment instead of the newest one."""
        return self._at_s is not None

    def outgoing(self) -> Iterator[dict[str, Any] | bytes]:
        """Yield what is to be sent to the page now: plain values for JSON, or bytes of pictures."""
        setups = self._feed.setups
        if self._setups is None or list(map(id, setups)) != list(map(id, self._setups)):
            self._setups = setups
            self._sent.clear()
            self._on_the_way.clear()
            yield {
                "type": "hello",
                "offers": sorted(self._controls.offers),
                "robots": [_robot(setup) for setup in setups],
            }
        version, status = self._feed.status
        if version != self._version or self._must_tell:
            self._version, self._must_tell = version, False
            yield {"type": "status", "stands_still": self.stands_still, **self._span(), **status}
        for setup in setups:
            picture = self._picture(setup.name)
            under_way = self._on_the_way.setdefault(setup.name, [])
            if picture is None or picture is self._sent.get(setup.name) or len(under_way) >= _MAX_ON_THE_WAY:
                continue
            self._sent[setup.name] = picture
            under_way.append(picture.number)
            yield picture.data

    def close(self) -> None:
        """Withdraw the page's wishes, after it was closed."""
        self._feed.want_markings(self, False)

    def handle(self, message: tuple[Any, ...]) -> None:
        """Carry out a request, as `read_message` returns it; raises RobocupVisionError if that cannot be done."""
        match message:
            case "drawn", robot, number:
                under_way = self._on_the_way.get(robot, [])
                # all earlier pictures were drawn or skipped
                self._on_the_way[robot] = [other for other in under_way if other > number]
            case "pause", on:
                self._pause(on)
            case "step", frames:
                self._step(frames)
            case "back", seconds:
                self._stand_still()
                times = self._times()
                if times:
                    self._at_s = times[max(0, bisect.bisect_right(times, times[-1] - seconds + 1e-6) - 1)]
            case "markings", on:
                self._feed.want_markings(self, on)
            case _:
                if message[0] in ("seek", "open"):
                    self._follow()
                self._controls.ask(*message)
        self._must_tell |= message[0] != "drawn"

    def _pause(self, on: bool) -> None:
        if "pause" in self._controls.offers:
            self._controls.ask("pause", on)
        if not on:
            self._follow()
        elif "pause" not in self._controls.offers:
            self._stand_still()

    def _step(self, frames: int) -> None:
        can_pause = "pause" in self._controls.offers
        if can_pause:
            self._controls.ask("pause", True)
        if frames > 0 and can_pause and self._at_s is None:
            self._controls.ask("step")
            return
        self._stand_still()
        times = self._times()
        if not times:
            return
        at = bisect.bisect_right(times, times[-1] if self._at_s is None else self._at_s) - 1
        to = at + frames
        if to >= len(times) - 1 and can_pause:
            # at the newest moment again: the next step reads another frame
            self._follow()
        else:
            self._at_s = times[min(max(to, 0), len(times) - 1)]

    def _stand_still(self) -> None:
        """Keep the present pictures for as long as the page stands still."""
        if self._at_s is None or "pause" in self._controls.offers:
            self._kept = {setup.name: self._feed.history(setup.name) for setup in self._feed.setups}
        times = self._times()
        if self._at_s is None and times:
            self._at_s = times[-1]

    def _follow(self) -> None:
        self._kept, self._at_s = {}, None

    def _times(self) -> list[float]:
        return sorted({picture.t_s for pictures in self._kept.values() for picture in pictures})

    def _picture(self, robot: str) -> Picture | None:
        if self._at_s is None:
            return self._feed.newest(robot)
        pictures = self._kept.get(robot, ())
        at = bisect.bisect_right([picture.t_s for picture in pictures], self._at_s + 1e-9) - 1
        return pictures[at] if at >= 0 else None

    def _span(self) -> dict[str, Any]:
        if self._at_s is None:
            return {"back_s": 0.0}
        times = self._times()
        return {"back_s": round(times[-1] - self._at_s, 3), "kept_s": round(times[-1] - times[0], 3)}


def _robot(setup: RobotSetup) -> dict[str, Any]:
    """Return a robot and its field as the page needs them for drawing."""
    field = setup.field
    return {
        "name": setup.name,
        "radius_m": setup.radius_m,
        "calibrated": setup.camera is not None,
        "field": {
            "name": field.name,
            "line_width_m": field.line_width_m,
            "lines": field.lines.tolist(),
            "arcs": field.arcs.tolist(),
            "walls": field.walls.tolist() if field.is_bounded else [],
            "floor": field.floor_polygon.tolist(),
            "ball_radius_m": field.ball_radius_m,
            "goals": [
                {
                    "x_m": goal.line_x_m,
                    "back_x_m": goal.back_x_m,
                    "width_m": goal.width_m,
                    "color": "#{2:02x}{1:02x}{0:02x}".format(*COLOR_NAMES[goal.color]),
                }
                for goal in field.goals
            ],
        },
    }

"""A scripted agent: up to the floor that is named, round the building with the wall on the right, and towards the
colour that is named when it comes in sight. It shows how observations are read and actions given. It is no baseline:
it stops before the first large patch of that colour, whatever it is of, so that wrong windows are its usual end. What
to compare an agent with is in docs/leaderboard.md."""

import math
import re
from typing import Any

import cv2
import gymnasium
import numpy as np

import logisticsvln.gym  # noqa: F401 - makes the environment known
from logisticsvln.gym.actions import DISCRETE

FLOORS = {"first": 1, "second": 2, "third": 3, "fourth": 4, "fifth": 5, "sixth": 6, "ninth": 9}
HUES = {"red": 0, "yellow": 27, "green": 65, "blue": 108, "purple": 140}
STOP, FORWARD, LEFT, RIGHT, UP, ASIDE_LEFT, ASIDE_RIGHT = (
    DISCRETE.index(name) for name in ("stop", "forward", "turn_left", "turn_right", "up", "left", "right")
)


class Scripted:
    """One episode's decisions."""

    def __init__(self, request: str) -> None:
        words = re.findall(r"[a-z]+", request.lower())
        floor = next((FLOORS[word] for word in words if word in FLOORS), 3)
        self.height_m = 3.0 * floor - 1.2
        self.hue = HUES[next((word for word in words if word in HUES), "red")]
        self.plan = [LEFT] * 6  # the start faces the wall

    def act(self, seen: dict[str, Any]) -> int:
        if seen["pose"][2] < self.height_m:
            return UP
        if self.plan:
            return self.plan.pop()
        views = range(len(seen["rgb"]))
        area, bearing_deg, away_m = max(self._patch(view, seen) for view in views)
        if area > 12:
            if abs(bearing_deg) > 8.0:
                return LEFT if bearing_deg < 0.0 else RIGHT
            return STOP if away_m < 3.5 else FORWARD
        wall_m = float(np.median(self._middle(seen["depth"][4])))
        if self._ahead_m(seen) < 4.0:
            return LEFT
        if wall_m > 14.0:  # past the corner
            self.plan = [RIGHT, FORWARD]
            return RIGHT
        return ASIDE_LEFT if wall_m < 4.0 else ASIDE_RIGHT if wall_m > 9.0 else FORWARD

    def _patch(self, view: int, seen: dict[str, Any]) -> tuple[int, float, float]:
        """The largest patch of the colour at the drone's height, nearer than 16 m: its pixels, its bearing in degrees
        to the right of the nose, and how far it is. The views look 45 degrees apart, the middle one ahead, and are 90
        degrees wide."""
        height, width = seen["rgb"][view].shape[:2]
        rows = slice(height // 3, 2 * height // 3)
        band = cv2.cvtColor(seen["rgb"][view][rows], cv2.COLOR_RGB2HSV).astype(int)
        strong = (band[..., 1] > 140) & (band[..., 2] > 70) & (abs(band[..., 0] - self.hue) < 10)
        strong &= (seen["depth"][view][rows] > 0.0) & (seen["depth"][view][rows] < 16.0)
        _, which, stats, centres = cv2.connectedComponentsWithStats(strong.astype(np.uint8))
        best = max(range(1, len(stats)), key=lambda k: int(stats[k][4]), default=0)
        if not best:
            return 0, 0.0, 0.0
        aside = math.degrees(math.atan(2.0 * float(centres[best][0]) / width - 1.0))
        away_m = float(np.median(seen["depth"][view][rows][which == best]))
        return int(stats[best][4]), 45.0 * (view - 2) + aside, away_m

    def _ahead_m(self, seen: dict[str, Any]) -> float:
        return float(self._middle(seen["depth"][2]).min())

    def _middle(self, depth: Any) -> Any:
        """The depth straight on, metres; where it is unknown counts as near."""
        side = depth.shape[0]
        return depth[2 * side // 5 : 3 * side // 5, 2 * side // 5 : 3 * side // 5]


env = gymnasium.make("LogisticsVLN-v0", max_steps=120)
for sample in ("street-kite", "green-flower-pot"):
    seen, info = env.reset(seed=1, options={"task": sample})
    agent, over = Scripted(seen["instruction"]), False
    while not over:
        seen, _, terminated, truncated, info = env.step(agent.act(seen))
        over = terminated or truncated
    print({name: info[name] for name in ("task", "outcome", "steps", "path_m", "navigation_error_m", "spl")})
env.close()

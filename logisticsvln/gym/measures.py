"""The field's measures of one episode, from the simulator's own counts and its judge."""

import math
from typing import Any

from contracts.geometry import Pose
from contracts.sim import SUCCESS_RADIUS_M, Verdict
from contracts.vehicle import VehicleState
from evaluation.metrics.spl import Flown, spl
from logisticsvln.gym.assignments import Goal


class Measures:
    """They are for scoring and for rewards; an agent that decides by them flies with the truth."""

    def __init__(self, task: str, goal: Goal | None, start: VehicleState) -> None:
        self._task = task
        self._goal = goal
        self._state = start
        self._nearest_m = self._distance_m(start.pose)
        self._verdict: Verdict | None = None
        self._truncated = False

    @property
    def over(self) -> bool:
        return self._verdict is not None or self._truncated or self._state.collided

    @property
    def success(self) -> bool:
        """Delivered, by the simulator's judge."""
        return self._verdict is not None and self._verdict.delivered

    def moved(self, state: VehicleState) -> float:
        """The drone has moved; says by how many metres it is nearer to the window, 0 without a goal."""
        before, after = self._distance_m(self._state.pose), self._distance_m(state.pose)
        self._state = state
        if before is None or after is None:
            return 0.0
        self._nearest_m = min(after, self._nearest_m if self._nearest_m is not None else after)
        return before - after

    def judged(self, verdict: Verdict) -> None:
        """The agent has stopped."""
        self._verdict = verdict

    def out_of_steps(self) -> None:
        self._truncated = True

    def info(self) -> dict[str, Any]:
        """`steps`: moves, as the simulator numbers them. Distances in metres: `navigation_error_m` from the middle of
        the customer's window, `shortest_m` and what `spl` is of on the plan. At the end also `outcome`, `success`,
        `spl`, `oracle_success` (it was within 3 m at some time) and the judge's `verdict`; those are None where a scene
        has no goal."""
        state = self._state
        told: dict[str, Any] = {
            "task": self._task,
            "steps": state.moves,
            "path_m": state.path_m,
            "path_horizontal_m": state.path_horizontal_m,
            "flight_s": state.flight_s,
            "collided": state.collided,
            "navigation_error_m": self._distance_m(state.pose),
        }
        return told | self._end() if self.over else told

    def _end(self) -> dict[str, Any]:
        shortest_m = None if self._goal is None else self._goal.shortest_m
        flown = None if shortest_m is None else Flown(self.success, shortest_m, self._state.path_horizontal_m)
        return {
            "outcome": self._outcome(),
            "success": None if self._goal is None else self.success,
            "oracle_success": None if self._nearest_m is None else self._nearest_m <= SUCCESS_RADIUS_M,
            "shortest_m": shortest_m,
            "spl": None if flown is None else spl([flown]),
            "verdict": None if self._verdict is None else self._verdict.model_dump(mode="json"),
        }

    def _outcome(self) -> str:
        """In a mission's words, and `truncated`."""
        if self._state.collided:
            return "collision"
        verdict = self._verdict
        if verdict is None:
            return "truncated"
        if not verdict.judged:
            return "stopped_not_judged"
        if verdict.delivered:
            return "delivered"
        return "wrong_window" if verdict.right_window is False else "not_in_front"

    def _distance_m(self, pose: Pose) -> float | None:
        if self._goal is None:
            return None
        place = self._goal.place
        return math.dist((pose.x, pose.y, pose.z), (place.x, place.y, place.z))

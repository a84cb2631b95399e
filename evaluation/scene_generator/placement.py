"""Where the goal, the things that look like it and everything else stand: only where their class allows.

Windows with a balcony take what stands on a floor, windows without take the rest, so that no railing hides a sill.
"""

from collections.abc import Iterable

import numpy as np

from contracts.near import did_you_mean
from contracts.scene import Building, SceneObject, WindowPlace
from contracts.scene_layout import WindowSlot, columns_of, window_slots
from contracts.sim import Catalogue, CatalogueEntry
from evaluation.scene_generator.scene_plan import DecoySpec, PlaceOn, SceneSpec, UnbuildableScene

FLOOR_DECOY_APART = 4
"""Floors between the goal and its twin: twelve metres are out of the picture at the height of the goal."""
_TALL_M = 1.25
_WINDOW_PLACES: tuple[PlaceOn, ...] = ("balcony", "sill", "wall", "pane", "hang")
Spot = tuple[str, int, int, int]


def entry_of(catalogue: Catalogue, kind: str, colour: str | None = None) -> CatalogueEntry:
    """The catalogue's entry of a class that there is, in that colour where one is named. Raises UnbuildableScene."""
    for entry in catalogue.entries:
        if entry.kind == kind:
            if colour not in (None, *entry.colours):
                raise UnbuildableScene(f"a {kind} comes in {', '.join(entry.colours)}, not in {colour!r}")
            return entry
    there = [entry.kind for entry in catalogue.entries]
    raise UnbuildableScene(f"the catalogue has no {kind!r}{did_you_mean(kind, there)}; it has {', '.join(there)}")


def facade_at(target: Building, start: int, corners: int) -> int:
    """The facade that a clockwise lap meets after so many corners."""
    return (start - corners) % len(target.footprint)


class Placer:
    """Hands out windows, each at most once."""

    def __init__(
        self,
        spec: SceneSpec,
        target: Building,
        neighbours: tuple[Building, ...],
        catalogue: Catalogue,
        rng: np.random.Generator,
    ) -> None:
        self._spec = spec
        self._target = target
        self._neighbours = neighbours
        # by name, so that a catalogue in another order builds the same scene
        self._catalogue = Catalogue(entries=tuple(sorted(catalogue.entries, key=lambda e: e.kind)))
        self._rng = rng
        self._slots = window_slots(target)
        self._taken: set[Spot] = set()
        self._goal: Spot | None = None
        self._count = 0

    def goal(self) -> SceneObject:
        """Raises UnbuildableScene where no window fits."""
        goal = self._spec.goal
        entry = entry_of(self._catalogue, goal.kind, goal.colour)
        facade = facade_at(self._target, self._spec.start_facade, goal.corners)
        columns = columns_of(self._target, facade)
        if not 1 <= goal.floor <= self._target.floors or columns == 0:
            raise UnbuildableScene(
                f"facade {facade} of {self._spec.name} has {columns} columns on floors 1..{self._target.floors}; "
                f"the goal wants floor {goal.floor}"
            )
        slots = [
            s
            for s in self._slots
            if s.facade == facade and s.floor == goal.floor and (goal.column is None or s.column == goal.column)
        ]
        return self._put("goal", entry, goal.colour, slots, goal.on, goal.scale)

    def decoy(self, decoy: DecoySpec) -> SceneObject:
        """Raises UnbuildableScene where no window fits."""
        goal = self._spec.goal
        self._count += 1
        name = f"decoy-{self._count}"
        if decoy.like == "neighbour":
            if not self._neighbours:
                raise UnbuildableScene(f"{self._spec.name} has no neighbours for a decoy to stand at")
            slots: Iterable[WindowSlot] = (
                s for b in self._neighbours for s in window_slots(b) if abs(s.floor - goal.floor) <= 2
            )
        else:
            before = range(goal.corners + 1) if decoy.corners is None else (decoy.corners,)
            walls = {facade_at(self._target, self._spec.start_facade, c) for c in before}
            slots = (s for s in self._slots if s.facade in walls and self._floor_fits(decoy, s.floor))
        if decoy.column is not None:
            slots = (s for s in slots if s.column == decoy.column)
        free = self._away_from_goal(slots)
        reason = UnbuildableScene(f"{self._spec.name}: nothing can be a decoy of {goal.kind} {goal.colour} here")
        for kind, colour in self._looks(decoy):
            try:
                return self._put(name, entry_of(self._catalogue, kind), colour, free, None, goal.scale)
            except UnbuildableScene as error:
                reason = error
        raise reason

    def clutter(self) -> SceneObject | None:
        """Something of another class somewhere near the goal's floor; None when every window is taken."""
        goal = self._spec.goal
        entries = [e for e in self._catalogue.entries if e.kind != goal.kind and set(e.places) & set(_WINDOW_PLACES)]
        entry = entries[int(self._rng.integers(len(entries)))]
        colours = [c for c in entry.colours if c != goal.colour] or list(entry.colours)
        slots = (s for s in self._slots if abs(s.floor - goal.floor) <= 3)
        self._count += 1
        try:
            return self._put(
                f"thing-{self._count}", entry, str(self._rng.choice(colours)), self._away_from_goal(slots), None, 1.0
            )
        except UnbuildableScene:
            return None

    def _looks(self, decoy: DecoySpec) -> list[tuple[str, str]]:
        """Classes and colours that a decoy may have, in the order in which they are tried."""
        goal = self._spec.goal
        if decoy.like in ("floor", "neighbour"):
            return [(goal.kind, goal.colour)]
        looks = [
            (e.kind, c)
            for e in self._catalogue.entries
            for c in e.colours
            if (e.kind == goal.kind) == (decoy.like == "colour")
            and (c == goal.colour) == (decoy.like == "kind")
            and decoy.kind in (None, e.kind)
            and decoy.colour in (None, c)
        ]
        return [looks[int(i)] for i in self._rng.permutation(len(looks))]

    def _floor_fits(self, decoy: DecoySpec, floor: int) -> bool:
        apart = abs(floor - self._spec.goal.floor)
        return apart >= FLOOR_DECOY_APART if decoy.like == "floor" else apart <= 1

    def _away_from_goal(self, slots: Iterable[WindowSlot]) -> list[WindowSlot]:
        goal = self._goal
        return [
            s
            for s in slots
            if goal is None
            or (s.building, s.facade) != goal[:2]
            or abs(s.column - goal[3]) >= 2
            or abs(s.floor - goal[2]) >= 2
        ]

    def _put(
        self, name: str, entry: CatalogueEntry, colour: str, slots: list[WindowSlot], on: PlaceOn | None, scale: float
    ) -> SceneObject:
        fits = [
            (slot, place)
            for slot in slots
            if (slot.building, slot.facade, slot.floor, slot.column) not in self._taken
            for place in _WINDOW_PLACES
            if (on is None or place == on) and place in entry.places and _stands(slot, place, entry, scale)
        ]
        if not fits:
            raise UnbuildableScene(
                f"{self._spec.name}: no free window takes a {entry.kind} on {on or ' or '.join(entry.places)} "
                f"among the {len(slots)} looked at"
            )
        windows = sorted({(s.building, s.facade, s.floor, s.column) for s, _ in fits})
        spot = windows[int(self._rng.integers(len(windows)))]
        places = [p for s, p in fits if (s.building, s.facade, s.floor, s.column) == spot]
        place = places[int(self._rng.integers(len(places)))]
        self._taken.add(spot)
        if self._goal is None:
            self._goal = spot  # the goal is put first
        flat = place in ("wall", "pane")
        turn = 0.0 if flat or entry.category == "posters" else round(float(self._rng.uniform(-0.35, 0.35)), 3)
        return SceneObject(
            id=name,
            kind=entry.kind,
            colour=colour,
            place=WindowPlace(building=spot[0], facade=spot[1], floor=spot[2], column=spot[3], on=place),
            scale=scale,
            yaw=turn,
        )


def _stands(slot: WindowSlot, place: PlaceOn, entry: CatalogueEntry, scale: float) -> bool:
    if slot.balcony is None:
        return place != "balcony"
    if place != "balcony":
        return False
    return slot.balcony.railing != "solid" or entry.size_m[2] * scale >= _TALL_M

"""The questions of `logisticsvln scene new`, each with its usual answer."""

from collections.abc import Sequence
from typing import Literal, TypeVar, get_args

import typer

from contracts.scene import BuildingKind
from contracts.sim import Catalogue
from evaluation.scene_generator.footprints import outline
from evaluation.scene_generator.placement import entry_of
from evaluation.scene_generator.scene_plan import DecoySpec, FootprintSpec, GoalSpec, SceneSpec, Shape, Surroundings

Neighbours = Literal["none", "street", "ring"]
T = TypeVar("T", bound=str)
_USUAL_FLOORS: dict[BuildingKind, int] = {"low_rise": 5, "high_rise": 12, "villa": 2, "cultural": 3}


class Questions:
    """What is given is not asked; where nobody can be asked the usual answer is taken."""

    def __init__(self, catalogue: Catalogue, *, interactive: bool) -> None:
        self._catalogue = catalogue
        self._interactive = interactive

    def spec(
        self,
        *,
        name: str,
        kind: BuildingKind | None,
        shape: Shape | None,
        floors: int | None,
        thing: str | None,
        colour: str | None,
        floor: int | None,
        corners: int | None,
        neighbours: Neighbours | None,
    ) -> SceneSpec:
        """The plan. Raises UnbuildableScene for a class that there is not, pydantic.ValidationError."""
        kinds: tuple[BuildingKind, ...] = get_args(BuildingKind)
        built: BuildingKind = kind or self._one_of("What kind of building is it?", kinds, "low_rise")
        shapes: tuple[Shape, ...] = get_args(Shape)
        footprint = FootprintSpec(shape=shape or self._one_of("Its ground plan?", shapes, "rectangle"))
        floors = floors or self._number("How many floors has it?", _USUAL_FLOORS[built])
        thing = thing or self._text("What marks the customer's window (a class of the catalogue)?", "flower_pot")
        entry = entry_of(self._catalogue, thing)
        colour = colour or self._one_of("In which colour?", entry.colours, entry.colours[0])
        floor = floor or self._number("On which floor?", min(3, floors))
        last = len(outline(footprint)) - 1
        if corners is None:
            corners = self._number(f"How many corners from the start, clockwise (0 to {last})?", 1)
        around: tuple[Neighbours, ...] = get_args(Neighbours)
        return SceneSpec(
            name=name,
            kind=built,
            footprint=footprint,
            floors=floors,
            goal=GoalSpec(kind=thing, colour=colour, floor=floor, corners=corners, scale=1.2),
            decoys=(DecoySpec(like="kind"),),
            surroundings=Surroundings(
                neighbours=neighbours or self._one_of("Other buildings?", around, "street"), gap_m=30.0
            ),
        )

    def _one_of(self, question: str, answers: Sequence[T], usual: T) -> T:
        if not self._interactive:
            return usual
        while True:
            said = typer.prompt(f"{question} {', '.join(map(str, answers))}", default=usual)
            if said in answers:
                return said  # type: ignore[no-any-return]
            typer.echo(f"{said!r} is none of these")

    def _number(self, question: str, usual: int) -> int:
        return int(typer.prompt(question, default=usual, type=int)) if self._interactive else usual

    def _text(self, question: str, usual: str) -> str:
        return str(typer.prompt(question, default=usual)) if self._interactive else usual

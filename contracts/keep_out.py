"""Volumes that no flight enters: what aviation calls an exclusion zone with a floor and a ceiling."""

from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator

from contracts.base import Name, Wire
from contracts.footprint import outline_problem
from contracts.geometry import Point2

MAX_KEEP_OUT = 32


class KeepOut(Wire):
    """An upright volume over `outline` (metres, the vehicle's frame, in a simulator the scene's; either way round),
    from `min_height_m` to `max_height_m` above the ground at the start. `name` is told where a flight is refused for
    it. About a wire: a strip along it as wide as it swings, from below its lowest place to above its highest."""

    name: Name
    outline: Annotated[tuple[Point2, ...], Field(min_length=3, max_length=32)]
    min_height_m: float = Field(default=0.0, ge=-500.0, le=1_000.0)
    max_height_m: float = Field(default=1_000.0, ge=-500.0, le=1_000.0)

    @model_validator(mode="after")
    def _sound(self) -> Self:
        if problem := outline_problem(self.corners):
            raise ValueError(f"keep-out volume {self.name}: {problem.replace('wall', 'side')}")
        if self.min_height_m >= self.max_height_m:
            raise ValueError(f"keep-out volume {self.name}: min_height_m must be less than max_height_m")
        return self

    @property
    def corners(self) -> tuple[tuple[float, float], ...]:
        """East and north of each."""
        return tuple((p.x, p.y) for p in self.outline)


def _named_apart(volumes: tuple[KeepOut, ...]) -> tuple[KeepOut, ...]:
    names = [volume.name for volume in volumes]
    twice = next((name for k, name in enumerate(names) if name in names[:k]), None)
    if twice is not None:
        raise ValueError(f"two keep-out volumes are named {twice}; give each a name of its own")
    return volumes


KeepOuts = Annotated[tuple[KeepOut, ...], Field(max_length=MAX_KEEP_OUT), AfterValidator(_named_apart)]
AllKeepOuts = Annotated[tuple[KeepOut, ...], Field(max_length=2 * MAX_KEEP_OUT)]
"""The operator's and a request's."""


class KeepOutFile(Wire):
    """A file of volumes, TOML: one `[[keep_out]]` for each."""

    keep_out: KeepOuts

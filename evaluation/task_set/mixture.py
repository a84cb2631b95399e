"""Mixtures: how often a set's tasks have which sensor, light, weather, wind and start. They ship as TOML files."""

from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from contracts.base import Name, Unit, Wire
from contracts.sensor_profiles import sensor_names
from contracts.toml_documents import Kind

Weight = Annotated[float, Field(ge=0.0, le=1_000.0)]
LightName = Literal["day", "dusk", "night"]
WeatherName = Literal["dry", "fog", "rain"]
WindName = Literal["calm", "breeze", "gusts"]
StartName = Literal["usual", "near", "far", "oblique", "away"]


class BadMixture(ValueError):
    """A mixture that is none, or a name that none has; the message says what was wrong and what there is."""


class Mixture(Wire):
    """Shares (0..1) and weights. `absent`: the object is not there; `twins`: there is a second one like it, so that the
    right end is to say so; `first_floor`: the goal is on floor 1, in houses of more; `one_storey`: buildings of one
    floor; `terraced`: rectangular houses in a row of their like, where the goal faces the street; `same_clothes`:
    houses across the street that look like the target; `furnished`: shops, hedges, wires (`task_set.furniture`);
    `traffic`: people, cars and birds are about (`task_set.street_life`)."""

    name: Name
    requests: Literal["own", "strangers"]
    absent: Unit
    twins: Unit
    first_floor: Unit
    one_storey: Unit
    terraced: Unit
    same_clothes: Unit
    furnished: Unit = Field(default=0.0, exclude_if=lambda share: share == 0.0)
    traffic: Unit = Field(default=0.0, exclude_if=lambda share: share == 0.0)
    sensors: dict[Name, Weight]
    light: dict[LightName, Weight]
    weather: dict[WeatherName, Weight]
    wind: dict[WindName, Weight]
    start: dict[StartName, Weight]

    @model_validator(mode="after")
    def _sound(self) -> Self:
        unknown = sorted(set(self.sensors) - set(sensor_names()))
        if unknown:
            raise ValueError(f"there is no sensor profile {unknown[0]!r}; there are {', '.join(sensor_names())}")
        for name in ("sensors", "light", "weather", "wind", "start"):
            if sum(getattr(self, name).values()) <= 0.0:
                raise ValueError(f"{name} needs at least one weight above 0")
        if self.absent + self.twins > 1.0:
            raise ValueError("absent and twins are shares of the same tasks: at most 1 together")
        return self


_MIXTURES = Kind("data", "mixture of tasks", "mixtures", BadMixture, package="evaluation.task_set")


def mixture_names() -> tuple[str, ...]:
    """Those that ship with the project."""
    return _MIXTURES.names()


def load_mixture(name_or_file: str) -> Mixture:
    """A shipped mixture by its name, or one from a TOML file. Raises BadMixture."""
    return _MIXTURES.load(name_or_file, _mixture)


def drawn(weights: dict[str, float], rng: np.random.Generator) -> str:
    """One of the names, by weight."""
    names = list(weights)
    shares = np.array([weights[name] for name in names])
    return names[int(rng.choice(len(names), p=shares / shares.sum()))]


def _mixture(document: dict[str, Any]) -> Mixture:
    return Mixture.model_validate(document)

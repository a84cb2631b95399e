"""Where scenes lie in CARLA: one TOML document a scene in a folder of the service, named like the scene.

A scene says where buildings, windows and the customer's thing are, where the drone starts, and so how a claim is
judged; it is the same document that the simulator takes. What only CARLA needs is here: the map, where on it the
scene's origin lies, and the props that stand for its objects.
"""

import tomllib
from pathlib import Path
from typing import Annotated

from pydantic import Field, ValidationError

from contracts.base import Coordinate, Metres, Name, Radians, Wire
from contracts.errors import first_problem
from contracts.geometry import Point3
from service_kit.errors import BadQuestion
from services.carla_world.frames import Origin

CarlaName = Annotated[str, Field(pattern=r"^[\w.\-]{1,80}$")]
MapMetres = Annotated[float, Field(ge=-100_000.0, le=100_000.0)]


class MapPlace(Wire):
    """In CARLA's own coordinates: metres, x east, y south, z up."""

    x_m: MapMetres = 0.0
    y_m: MapMetres = 0.0
    z_m: MapMetres = 0.0


class Prop(Wire):
    """A thing that is put up for the episode. `position` (metres, ENU, of the scene) is the origin of CARLA's model,
    usually the middle of its underside; `yaw` in radians, counter-clockwise from east. `object`: the scene's object
    that it stands for; the judge then knows where that really is."""

    blueprint: CarlaName
    position: Point3
    yaw: Radians = 0.0
    object: Name | None = None
    attributes: dict[CarlaName, str] = {}


class CarlaScene(Wire):
    """`map`: as CARLA calls it. `origin`: of the scene, on the map. `weather`: a preset of `carla.WeatherParameters`;
    null: as it is. `roof_m`: above all that a flight home might meet, `underground_m`: below all ground, heights in the
    scene's frame."""

    map: CarlaName
    origin: MapPlace = MapPlace()
    weather: CarlaName | None = None
    props: tuple[Prop, ...] = Field(default=(), max_length=100)
    roof_m: Metres = 60.0
    underground_m: Coordinate = -50.0

    @property
    def frame(self) -> Origin:
        return Origin(self.origin.x_m, self.origin.y_m, self.origin.z_m)


class SceneDocuments:
    """Those of one folder; read anew whenever one is asked for."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def names(self) -> list[str]:
        """Of the scenes that lie somewhere in CARLA."""
        return sorted(path.stem for path in self._folder.glob("*.toml"))

    def find(self, scene: str) -> CarlaScene:
        """The document of the scene of that name. Raises BadQuestion."""
        names = self.names()
        if scene not in names:
            raise BadQuestion(
                f"nothing says where scene {scene!r} lies in CARLA; put {scene}.toml into {self._folder} "
                f"(CARLA_SCENES), see docs/carla.md; there are: {', '.join(names[:20]) or 'none'}",
                code="no_carla_scene",
            )
        path = self._folder / f"{scene}.toml"
        try:
            return CarlaScene.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
        except ValidationError as error:
            problem = first_problem(error)
        except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            problem = f"not TOML: {error}"
        except OSError as error:
            problem = str(error.strerror)
        raise BadQuestion(f"{path}: {problem}", code="bad_carla_scene")

"""Sensor profiles as data: what a real camera and a real odometry make of what is there. They ship as TOML files beside
the rigs, named and versioned, with the sources of their numbers; docs/sim-to-real.md says what is modelled of them.

On the wire depth stays what it is: 0 where the sensor says nothing (unknown), 65535 where nothing returned up to its
range. Only the `ideal` principle can tell the second from the first: a real camera gives 0 for the sky.
"""

from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from contracts.base import Name, Unit, Wire
from contracts.toml_documents import Kind

DEFAULT_SENSORS = "perfect"
FaultKind = Literal["frozen", "no_depth", "pose_jump"]
Positive = Annotated[float, Field(gt=0.0, le=10_000.0)]
Small = Annotated[float, Field(ge=0.0, le=100.0)]


class BadSensors(ValueError):
    """A sensor profile that is none, or a name that none has; the message says what was wrong and what there is."""


class IdealDepth(Wire):
    """The renderer's depth as it is."""

    principle: Literal["ideal"] = "ideal"


class RealDepth(Wire):
    """What all real depth cameras have in common. Shares are of the pixels concerned, 0..1.

    `min_m`, `max_m`: nothing is valid nearer or farther. `grain_px`: errors are alike over so many pixels.
    `glass_holes`: of window panes, invalid. `thin_px`: what is narrower is thin; of it `thin_holes` are invalid and
    `thin_missed` show what lies behind. `edge_m`: a step between neighbours that is an edge; there `edge_mixed` of the
    pixels lie somewhere between near and far. `partial_frames`: of the frames end somewhere in the picture."""

    min_m: Positive
    max_m: Positive
    grain_px: int = Field(default=1, ge=1, le=64)
    glass_holes: Unit = 0.0
    thin_px: int = Field(default=0, ge=0, le=31)
    thin_holes: Unit = 0.0
    thin_missed: Unit = 0.0
    edge_m: Positive = 0.3
    edge_mixed: Unit = 0.0
    partial_frames: Unit = 0.0

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.min_m >= self.max_m:
            raise ValueError(f"depth.min_m must lie below depth.max_m, not {self.min_m:g} and {self.max_m:g}")
        if self.thin_holes + self.thin_missed > 1.0:
            raise ValueError("depth.thin_holes and depth.thin_missed are shares of the same pixels: at most 1 together")
        return self


class StereoDepth(RealDepth):
    """Two cameras `baseline_m` apart. The error of a disparity is `disparity_noise_px` (standard deviation), so that of
    a depth z is z² times that over `focal_px` times the baseline; disparities come in steps. Where the picture varies
    by less than `min_contrast` grey levels, nothing can be matched: `plain_holes` of it are invalid."""

    principle: Literal["stereo"] = "stereo"
    baseline_m: Positive
    focal_px: Positive
    disparity_noise_px: Small
    disparity_step_px: Annotated[float, Field(gt=0.001, le=1.0)]
    min_contrast: int = Field(default=0, ge=0, le=255)
    plain_holes: Unit = 0.0


class TimeOfFlightDepth(RealDepth):
    """Light sent out and timed: the standard deviation of a depth z is `noise_m` + `noise_per_m2` z²."""

    principle: Literal["time-of-flight"] = "time-of-flight"
    noise_m: Positive
    noise_per_m2: Positive


DepthSensor = Annotated[IdealDepth | StereoDepth | TimeOfFlightDepth, Field(discriminator="principle")]


class PictureSensor(Wire):
    """A colour camera. `exposure_ev`: spread of the exposure from look to look, in stops; `exposure_s`: how long the
    shutter is open; noise in grey levels of 255: `read_noise`, and `shot_noise` times the root of the brightness;
    `vibration_deg_s`: how fast a hovering airframe trembles; `rolling_shutter_s`: from the first row to the last, 0 for
    a global shutter."""

    exposure_ev: Small = 0.0
    exposure_s: Small = 0.0
    read_noise: Small = 0.0
    shot_noise: Small = 0.0
    vibration_deg_s: Small = 0.0
    rolling_shutter_s: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    jpeg_quality: int = Field(default=90, ge=1, le=100)

    @property
    def ideal(self) -> bool:
        """Nothing is done to the picture before it is encoded."""
        return self.model_copy(update={"jpeg_quality": 90}) == PictureSensor()


class PoseSensor(Wire):
    """An odometry. Noise is drawn anew for each reading (standard deviations). Drift adds up: `drift` and
    `vertical_drift` are shares of the way flown, `yaw_drift_deg_per_m` turns the believed frame about the drone.
    `jumps_per_minute` of flight the believed position leaps by `jump_m`, level, in a direction drawn each time."""

    horizontal_noise_m: Small = 0.0
    vertical_noise_m: Small = 0.0
    yaw_noise_deg: Small = 0.0
    drift: Annotated[float, Field(ge=0.0, le=0.5)] = 0.0
    vertical_drift: Annotated[float, Field(ge=0.0, le=0.5)] = 0.0
    yaw_drift_deg_per_m: Annotated[float, Field(ge=0.0, le=10.0)] = 0.0
    jumps_per_minute: Small = 0.0
    jump_m: Small = 0.0


class Sensors(Wire):
    """What a drone senses with, beside the rig that says where its cameras look. `version` rises whenever a number
    changes; results name both."""

    name: Name
    version: int = Field(ge=1)
    sources: tuple[str, ...] = Field(min_length=1, max_length=20)
    depth: DepthSensor = IdealDepth()
    picture: PictureSensor = PictureSensor()
    pose: PoseSensor = PoseSensor()

    @property
    def label(self) -> str:
        """As results name it: `d455:1`."""
        return f"{self.name}:{self.version}"


class SensorFault(Wire):
    """A fault on request, for tests: `frozen`, the cameras give the same frame with the same time; `no_depth`, all
    depth is invalid; `pose_jump`, the believed position leaps `jump_m` to the east. From look `first_look` on (1, 2,
    ...), for `looks` of them, null for ever; a jump happens once, before `first_look`."""

    kind: FaultKind
    first_look: int = Field(default=1, ge=1, le=10_000)
    looks: int | None = Field(default=None, ge=1, le=10_000)
    jump_m: Annotated[float, Field(ge=-100.0, le=100.0)] = 2.0

    def at(self, look: int) -> bool:
        """Whether it holds at that look."""
        return self.first_look <= look and (self.looks is None or look < self.first_look + self.looks)


_PROFILES = Kind("sensors", "sensor profile", "sensor profiles", BadSensors)


def sensor_names() -> tuple[str, ...]:
    """The profiles that ship with the project."""
    return _PROFILES.names()


def shipped_sensors(name: str) -> Sensors:
    """The profile of that name. Raises BadSensors."""
    return _PROFILES.shipped(name, _sensors)


def load_sensors(name_or_file: str) -> Sensors:
    """A shipped profile by its name, or one from a TOML file. Raises BadSensors."""
    return _PROFILES.load(name_or_file, _sensors)


def _sensors_by_name(given: object) -> object:
    """For a wire: a shipped profile's name stands for it. Raises ValueError for a name that none has."""
    return shipped_sensors(given) if isinstance(given, str) else given


SensorsOrName = Annotated[
    Sensors | None, BeforeValidator(_sensors_by_name, json_schema_input_type=Sensors | Name | None)
]
"""As a document, or by the name of a shipped profile."""


def _sensors(document: dict[str, Any]) -> Sensors:
    return Sensors.model_validate(document)

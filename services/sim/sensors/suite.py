"""All that a drone senses with, put together: what is drawn goes in, what is encoded comes out."""

import math
from typing import NamedTuple

import numpy as np

from contracts.cameras import Camera
from contracts.geometry import Pose
from contracts.images import DEPTH_METRES_PER_UNIT, NO_RETURN, DepthMap, JpegImage, encode_depth_units, encode_jpeg
from contracts.scene import CALM, Air
from contracts.sensor_profiles import IdealDepth, Sensors
from episode_kit.drone import Rates
from services.sim.render.views import RenderedViews
from services.sim.sensors.chance import generator
from services.sim.sensors.depth import Frame, sensed_depth
from services.sim.sensors.picture import Motion, motion_of, sensed_picture
from services.sim.sensors.rain import rained

_SAMPLED = 16
_NOTHING_NEAR_M = 100.0
_PICTURE, _DEPTH = 1, 2


class Look(NamedTuple):
    """One look: its number in the episode, the drone's true pose and rates. `blind`: all depth is invalid."""

    number: int
    pose: Pose
    rates: Rates
    blind: bool = False


class SensorSuite:
    """`seeds`: of the episode; each camera's frame at each look draws from a generator of its own. `air`: what is
    between the cameras and what they look at; the renderer has drawn all of it but the drops."""

    def __init__(self, sensors: Sensors, seeds: tuple[int, ...], air: Air = CALM) -> None:
        self._sensors = sensors
        self._seeds = seeds
        self._air = air

    @property
    def tells_panes(self) -> bool:
        """Whether it matters which pixels are window panes."""
        depth = self._sensors.depth
        return not isinstance(depth, IdealDepth) and depth.glass_holes > 0.0

    def picture(self, frame: Frame, camera: Camera, look: Look) -> JpegImage:
        """The camera's picture, encoded."""
        sensor, rain = self._sensors.picture, self._air.rain_mm_h
        if sensor.ideal and not rain:
            return encode_jpeg(frame.rgb, sensor.jpeg_quality)
        rng = generator((*self._seeds, _PICTURE), look.number, camera.name)
        if rain:
            frame = frame._replace(rgb=rained(frame.rgb, camera.fy_px, rain, sensor.exposure_s, rng))
        return encode_jpeg(
            sensed_picture(frame.rgb, camera, sensor, _motion(frame, camera, look), rng), sensor.jpeg_quality
        )

    def depth(self, frame: Frame, camera: Camera, look: Look) -> DepthMap:
        """The camera's depth, encoded."""
        sensor = self._sensors.depth
        if look.blind:
            return encode_depth_units(np.zeros_like(frame.units))
        if isinstance(sensor, IdealDepth):
            return encode_depth_units(frame.units)
        rng = generator((*self._seeds, _DEPTH), look.number, camera.name)
        return encode_depth_units(sensed_depth(frame, sensor, rng, self._air))


def frames_of(drawn: RenderedViews) -> tuple[Frame, ...]:
    """What was drawn, camera by camera."""
    panes = drawn.panes or (None,) * len(drawn.rgb)
    return tuple(Frame(*one) for one in zip(drawn.rgb, drawn.depth_units, panes, strict=True))


def _motion(frame: Frame, camera: Camera, look: Look) -> Motion:
    """How the picture moves, before things that are as far away as half of what is seen."""
    rates = look.rates
    if not any(rates):
        return Motion(0.0, 0.0)
    some = frame.units[::_SAMPLED, ::_SAMPLED]
    some = some[some < NO_RETURN]
    depth_m = max(0.5, float(np.median(some)) * DEPTH_METRES_PER_UNIT) if len(some) else _NOTHING_NEAR_M
    bearing = look.pose.yaw - math.radians(camera.heading_deg)
    aside_m_s = rates.east * math.sin(bearing) - rates.north * math.cos(bearing)
    return motion_of(camera, rates.yaw, aside_m_s, rates.up, depth_m)

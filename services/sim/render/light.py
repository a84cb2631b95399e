"""What sun and sky do to a picture, as numbers for the shaders and for the plain renderer. Linear light, RGB."""

from math import cos, log, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contracts.scene import Air, Light

Rgb = tuple[float, float, float]


class Weather(NamedTuple):
    """sun, sky and ground: light from there; zenith, horizon and cloud: colours of the sky; cover: share of clouds."""

    sun: Rgb
    sky: Rgb
    ground: Rgb
    zenith: Rgb
    horizon: Rgb
    cloud: Rgb
    cover: float
    glow: Rgb
    haze: Rgb
    haze_per_m: float


WEATHER: dict[str, Weather] = {
    "clear": Weather(
        sun=(0.92, 0.84, 0.68),
        sky=(0.50, 0.56, 0.68),
        ground=(0.34, 0.31, 0.27),
        zenith=(0.09, 0.25, 0.60),
        horizon=(0.56, 0.72, 0.88),
        cloud=(0.97, 0.97, 0.98),
        cover=0.40,
        glow=(0.30, 0.26, 0.18),
        haze=(0.60, 0.71, 0.83),
        haze_per_m=0.0016,
    ),
    "cloudy": Weather(
        sun=(0.62, 0.58, 0.50),
        sky=(0.58, 0.61, 0.67),
        ground=(0.37, 0.35, 0.32),
        zenith=(0.16, 0.31, 0.58),
        horizon=(0.66, 0.75, 0.84),
        cloud=(0.88, 0.89, 0.92),
        cover=0.66,
        glow=(0.18, 0.16, 0.12),
        haze=(0.66, 0.73, 0.80),
        haze_per_m=0.002,
    ),
    "overcast": Weather(
        sun=(0.12, 0.12, 0.12),
        sky=(0.78, 0.80, 0.84),
        ground=(0.46, 0.45, 0.43),
        zenith=(0.52, 0.56, 0.62),
        horizon=(0.74, 0.76, 0.79),
        cloud=(0.62, 0.65, 0.69),
        cover=0.75,
        glow=(0.02, 0.02, 0.02),
        haze=(0.71, 0.74, 0.77),
        haze_per_m=0.003,
    ),
    "dusk": Weather(
        sun=(1.00, 0.58, 0.30),
        sky=(0.40, 0.40, 0.56),
        ground=(0.30, 0.25, 0.23),
        zenith=(0.12, 0.16, 0.40),
        horizon=(0.94, 0.58, 0.36),
        cloud=(0.86, 0.54, 0.46),
        cover=0.48,
        glow=(0.50, 0.26, 0.10),
        haze=(0.80, 0.60, 0.48),
        haze_per_m=0.002,
    ),
    "night": Weather(
        sun=(0.030, 0.036, 0.052),
        sky=(0.022, 0.026, 0.040),
        ground=(0.030, 0.025, 0.020),
        zenith=(0.004, 0.006, 0.016),
        horizon=(0.030, 0.027, 0.032),
        cloud=(0.022, 0.021, 0.026),
        cover=0.55,
        glow=(0.0, 0.0, 0.0),
        haze=(0.020, 0.020, 0.024),
        haze_per_m=0.002,
    ),
}
LAMP_LIGHT: Rgb = (5.5, 4.2, 2.6)
"""Of one street lamp, linear, at a metre."""
MOST_LAMPS = 6
"""That are burning at once: those nearest to what shadows are sharpest about."""
_WINDOW_LIGHTS: tuple[Rgb, ...] = ((1.0, 0.72, 0.42), (0.95, 0.80, 0.58), (0.80, 0.85, 0.95), (0.55, 0.36, 0.18))
_CONTRAST_LEFT = 0.05
"""At the meteorological optical range."""


def extinction_per_m(air: Air) -> float:
    """Of fog, by its visibility, and of rain: 1.076 R^0.67 dB a kilometre (ITU-R P.1814), R in mm an hour."""
    fog = -log(_CONTRAST_LEFT) / air.visibility_m if air.visibility_m is not None else 0.0
    rain = 1.076 * air.rain_mm_h**0.67 / 4343.0 if air.rain_mm_h else 0.0
    return fog + rain


def airlight(light: Light) -> Rgb:
    """The colour of thick air, linear: the haze's, paler."""
    haze = WEATHER[light.sky].haze
    grey = sum(haze) / 3.0
    r, g, b = (0.35 * part + 0.65 * grey for part in haze)
    return r, g, b


def window_lights(light: Light, panes: int, seed: int) -> NDArray[np.float64]:
    """(panes, 3) what shines through each kind of pane, linear; 0 for those that are dark."""
    rng = np.random.default_rng((seed, panes))
    lit = rng.permutation(panes) < round(light.lit_windows * panes)
    colours = np.array(_WINDOW_LIGHTS)[rng.integers(len(_WINDOW_LIGHTS), size=panes)]
    return np.asarray(colours * lit[:, None] * rng.uniform(0.6, 1.3, (panes, 1)))


def sun_direction(light: Light) -> NDArray[np.float64]:
    """(3,) unit vector towards the sun."""
    a, e = light.sun_azimuth, light.sun_elevation
    return np.array([cos(a) * cos(e), sin(a) * cos(e), sin(e)])


def fill_direction(light: Light) -> NDArray[np.float64]:
    """(3,) a weak sideways gradient of the sky's light, so that two walls in the shade are told apart."""
    a = light.sun_azimuth + 0.6
    return 0.22 * np.array([cos(a), sin(a), 0.0])

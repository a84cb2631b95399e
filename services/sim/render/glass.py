"""Window panes that reflect: by Fresnel's law, the sky in the direction in which light would have come.

Variants of the scene's programs, for scenes that ask for them. What stands across the street is not in the panes:
below the horizon they show plain ground.
"""

import moderngl

from contracts.scene import Light
from services.sim.render.light import WEATHER
from services.sim.render.shaders import SKY_COLOUR

REFLECTANCE = 0.15
"""Of double glazing, looked at square on: four surfaces of 4 %."""
_GROUND_ALBEDO = 0.45

_REFLECTED = """
    if (layer >= pane_layers.x && layer <= pane_layers.y) {
        vec3 look = normalize(place - eye);
        vec3 outward = normalize(facing);
        vec3 mirrored = reflect(look, outward);
        vec3 above = sky(vec3(mirrored.xy, max(mirrored.z, 0.0)));
        float below = smoothstep(0.02, -0.06, mirrored.z);
        float glint = pow(max(dot(mirrored, sun), 0.0), 900.0) * texture(shade, sun_place);
        vec3 come = mix(above * above, ground_seen, below) + 6.0 * glint * sun_light;
        float grazing = pow(1.0 - clamp(-dot(look, outward), 0.0, 1.0), 5.0);
        c = min(mix(c, come, REFLECTANCE + (1.0 - REFLECTANCE) * grazing), vec3(1.0));
    }
""".replace("REFLECTANCE", str(REFLECTANCE))


def reflects(light: Light) -> bool:
    """Whether the scene asks for it: all others are drawn as ever."""
    return light.glass == "reflecting"


def reflecting_fragment(fragment: str) -> str:
    """Of a plain or a weathered fragment program; it goes with the weathered vertex program."""
    if "in vec3 facing;" not in fragment:
        fragment = fragment.replace(
            "uniform vec2 pane_layers;", "uniform vec2 pane_layers;\nuniform vec3 eye;\nin vec3 place;\nin vec3 facing;"
        )
    sky = SKY_COLOUR.replace("uniform sampler2DArray surface;\n", "")
    return fragment.replace("void main() {", f"uniform vec3 ground_seen;\n{sky}\nvoid main() {{").replace(
        "    float h = ", f"{_REFLECTED}    float h = "
    )


def set_reflections(program: moderngl.Program, light: Light) -> None:
    """Hands the program what panes show below the horizon; the sky it is told as the sky's own programs are."""
    program["ground_seen"] = tuple(_GROUND_ALBEDO * light.exposure * part for part in WEATHER[light.sky].ground)

"""The GLSL programs. Colours are squared on the way in and rooted on the way out: light adds up in linear space."""

from services.sim.render.light import MOST_LAMPS

MOST_PANES = 32

SCENE_VERTEX = """
#version 430
uniform mat4 to_clip;
uniform mat4 to_sun;
uniform vec3 sun;
in vec3 in_position;
in vec3 in_normal;
in vec2 in_uv;
in vec3 in_colour;
in uint in_layer;
out vec2 uv;
out vec3 albedo;
out vec4 lit;
out vec3 sun_place;
flat out float layer;
uniform vec3 sky_light;
uniform vec3 ground_light;
uniform vec3 fill_light;
void main() {
    gl_Position = to_clip * vec4(in_position, 1.0);
    uv = in_uv;
    layer = float(in_layer);
    albedo = in_colour * in_colour;
    vec3 normal = (in_normal * 255.0 - 127.0) / 127.0;
    vec3 ambient = mix(ground_light, sky_light, normal.z * 0.5 + 0.5);
    ambient *= 1.0 + dot(normal, fill_light);
    lit = vec4(ambient, max(dot(normal, sun), 0.0));
    sun_place = (to_sun * vec4(in_position + normal * 0.06, 1.0)).xyz * 0.5 + 0.5;
    sun_place.z = min(sun_place.z, 0.999);
}
"""

SCENE_FRAGMENT = """
#version 430
uniform sampler2DArray surface;
uniform sampler2DShadow shade;
uniform vec3 sun_light;
uniform vec3 haze;
uniform float haze_per_m;
uniform vec2 pane_layers;
in vec2 uv;
in vec3 albedo;
in vec4 lit;
in vec3 sun_place;
flat in float layer;
layout(location = 0) out vec4 colour;
layout(location = 1) out uint depth_units;
void main() {
    vec3 t = texture(surface, vec3(uv, layer)).rgb;
    float open = lit.w * texture(shade, sun_place);
    float depth = 1.0 / gl_FragCoord.w;
    vec3 c = t * t * albedo * (lit.rgb + sun_light * open);
    float h = min(depth * haze_per_m, 0.75);
    // nobody blends: alpha tells window panes from everything else
    float pane = step(pane_layers.x, layer) * step(layer, pane_layers.y);
    colour = vec4(sqrt(mix(c, haze, h)), 1.0 - pane);
    depth_units = uint(clamp(depth * 500.0 + 0.5, 1.0, 65535.0));
}
"""

# after dark, in fog and rain: windows and street lamps give light, and air between eye and thing takes it away
WEATHERED_VERTEX = SCENE_VERTEX.replace(
    "out vec3 sun_place;", "out vec3 sun_place;\nout vec3 place;\nout vec3 facing;"
).replace("    sun_place = ", "    place = in_position;\n    facing = normal;\n    sun_place = ")

WEATHERED_FRAGMENT = (
    SCENE_FRAGMENT.replace(
        "uniform vec2 pane_layers;",
        """uniform vec2 pane_layers;
uniform vec3 eye;
uniform int lamp_count;
uniform vec3 lamps[MOST_LAMPS];
uniform vec3 lamp_light;
uniform vec3 window_light[MOST_PANES];
in vec3 place;
in vec3 facing;""",
    )
    .replace(
        "    float h = min(depth * haze_per_m, 0.75);",
        """    vec3 lamplight = vec3(0.0);
    for (int i = 0; i < lamp_count; i++) {
        vec3 way = lamps[i] - place;
        float squared = dot(way, way);
        lamplight += max(dot(facing, way), 0.0) / (squared * sqrt(squared) + 0.5) * lamp_light;
    }
    c += t * t * albedo * lamplight;
    if (layer >= pane_layers.x && layer <= pane_layers.y)
        c += t * t * window_light[int(layer - pane_layers.x + 0.5)];
    c = min(c, vec3(1.0));
    float h = 1.0 - exp(-length(place - eye) * haze_per_m);""",
    )
    .replace("MOST_LAMPS", str(MOST_LAMPS))
    .replace("MOST_PANES", str(MOST_PANES))
)


def labelled_vertex(vertex: str) -> str:
    """The same pictures, and the part seen in each pixel beside them."""
    return vertex.replace("in uint in_layer;", "in uint in_layer;\nin uint in_part;\nflat out uint part;").replace(
        "    layer = ", "    part = in_part;\n    layer = "
    )


def labelled_fragment(fragment: str) -> str:
    """Its other half."""
    return (
        fragment.replace("flat in float layer;", "flat in float layer;\nflat in uint part;")
        .replace("out uint depth_units;", "out uint depth_units;\nlayout(location = 2) out uint ids;")
        .replace("    vec3 t = ", "    ids = part;\n    vec3 t = ")
    )


def crowded_fragment(fragment: str) -> str:
    """The same pictures, with the shadows of what moves in them."""
    return fragment.replace("uniform sampler2DShadow shade;", "uniform sampler2DShadow shade, moving_shade;").replace(
        "texture(shade, sun_place)", "texture(shade, sun_place) * texture(moving_shade, sun_place)"
    )


SHADOW_VERTEX = """
#version 430
uniform mat4 to_sun;
in vec3 in_position;
void main() { gl_Position = to_sun * vec4(in_position, 1.0); }
"""

SHADOW_FRAGMENT = """
#version 430
void main() {}
"""

PANORAMA_VERTEX = """
#version 430
in vec2 in_corner;
out vec2 at_panorama;
void main() {
    gl_Position = vec4(in_corner, 0.0, 1.0);
    at_panorama = in_corner * 0.5 + 0.5;
}
"""

# the sky's colour in a direction; shared by the painting that level views look at, by views that look up past it and by
# panes that reflect
SKY_COLOUR = """
uniform sampler2DArray surface;
uniform float cloud_layer;
uniform vec3 zenith;
uniform vec3 horizon;
uniform vec3 cloud;
uniform float cover;
uniform vec3 sun;
uniform vec3 glow;
uniform vec3 airlight;
uniform float thickness;
uniform vec2 slopes;
vec3 sky(vec3 d) {
    float up = max(d.z, 0.0);
    float low = 1.0 - up;
    vec3 c = mix(zenith, horizon, low * low * low);
    float s = max(dot(d, sun), 0.0);
    float s2 = s * s, s8 = s2 * s2 * s2 * s2, s64 = s8 * s8 * s8 * s8 * s8 * s8 * s8 * s8;
    c += glow * (0.25 * s2 + 0.75 * s64);
    vec2 at = d.xy / (up + 0.16);
    float density = textureLod(surface, vec3(at * 0.11 + 0.37, cloud_layer), 0.0).r;
    float inside = smoothstep(1.0 - cover, 1.25 - cover, density) * smoothstep(0.02, 0.22, up);
    c = mix(c, cloud * (0.86 + 0.14 * density), inside * 0.85);
    return sqrt(mix(c, airlight, 1.0 - exp(-thickness / (up + 0.05))));
}
"""

# the sky is painted once for each scene: u runs round the horizon, v up to the slope that a level view can reach
PANORAMA_FRAGMENT = f"""
#version 430
{SKY_COLOUR}
in vec2 at_panorama;
out vec4 colour;
void main() {{
    float azimuth = at_panorama.x * 6.283185307;
    colour = vec4(sky(normalize(vec3(cos(azimuth), sin(azimuth), mix(slopes.x, slopes.y, at_panorama.y)))), 1.0);
}}
"""

# views that look up past the painting: the sky's colour pixel by pixel; below the horizon its lowest row goes on
DOME_VERTEX = """
#version 430
uniform mat3 rays;
in vec2 in_corner;
out vec3 ray;
void main() {
    gl_Position = vec4(in_corner, 1.0, 1.0);
    ray = rays * vec3(in_corner, 1.0);
}
"""

DOME_FRAGMENT = f"""
#version 430
{SKY_COLOUR}
in vec3 ray;
layout(location = 0) out vec4 colour;
layout(location = 1) out uint depth_units;
void main() {{
    colour = vec4(sky(normalize(vec3(ray.xy, max(ray.z, slopes.x * length(ray.xy))))), 1.0);
    depth_units = 65535u;
}}
"""

SKY_VERTEX = """
#version 430
uniform mat4 to_clip;
in vec3 in_direction;
in vec2 in_uv;
out vec2 uv;
void main() {
    gl_Position = (to_clip * vec4(in_direction, 1.0)).xyww;
    uv = in_uv;
}
"""

SKY_FRAGMENT = """
#version 430
uniform sampler2D panorama;
in vec2 uv;
layout(location = 0) out vec4 colour;
layout(location = 1) out uint depth_units;
void main() {
    colour = texture(panorama, uv);
    depth_units = 65535u;
}
"""

LABELLED_SKY_FRAGMENT, LABELLED_DOME_FRAGMENT = (
    fragment.replace("out uint depth_units;", "out uint depth_units;\nlayout(location = 2) out uint ids;").replace(
        "    depth_units = ", "    ids = 0u;\n    depth_units = "
    )
    for fragment in (SKY_FRAGMENT, DOME_FRAGMENT)
)

IDS_VERTEX = """
#version 430
uniform mat4 to_clip;
in vec3 in_position;
in uint in_part;
flat out uint part;
void main() {
    gl_Position = to_clip * vec4(in_position, 1.0);
    part = in_part;
}
"""

IDS_FRAGMENT = """
#version 430
flat in uint part;
layout(location = 1) out uint ids;
void main() { ids = part; }
"""

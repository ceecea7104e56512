#version 330
// Subsurface scattering: each pixel gathers the light that entered around it, by its own skin's profile.
//
// The light within a radius is known per channel (encircled energy P), so a ring between two radii has weight
// P(outer) - P(inner) and all weights sum to 1. Rings end at quantiles of the widest channel; one tap stands for each,
// turned by the golden angle, its start and its place in the ring from a 4 x 4 tile, so that 16 neighbors average.
// The pixel itself stands for all within 0.56 pixel (a disc of its area). Taps lie in the tangent plane; one whose
// depth is off that plane is no neighbor, and the rest are divided by the weights that counted.
#include "lut.glsl"
uniform sampler2D entering;   // rgb: irradiance that enters; a: view depth in mm, 0 where there is nothing
uniform sampler2D facing;     // rgb: view-space geometric normal; a: exit factor
uniform sampler2D skin;       // melanin, eumelanin, hemoglobin; a: thickness in mm
uniform sampler2D behind;     // a: light on the far side, relative to `sun`
uniform sampler2D detail;     // rgb: painted detail times color
uniform vec3 sun;
uniform float focal;          // pixels per unit of x / z
uniform vec2 center;          // of projection, in pixels
uniform int taps;             // at most; 0: no scattering
uniform int frame;            // another rotation and phase each
in vec2 screen;
layout(location = 0) out vec4 scattered;    // radiance, a: 1 where there is skin; sums over frames

// A profile whose r99 is less, in pixels, needs no taps: what they change stays below 1/255 after the display's curve,
// beside black and at three times white; at half a pixel they change up to 18/255 there.
const float LEAST_FOOTPRINT = 0.25;

const mat2 GOLDEN = mat2(-0.73736888, 0.67549029, -0.67549029, -0.73736888);

float bayer(ivec2 p) {
    int a = p.x ^ p.y, b = p.y;
    return (float(((a & 1) << 3) | ((b & 1) << 2) | ((a >> 1 & 1) << 1) | (b >> 1 & 1)) + 0.5) / 16.0;
}

vec3 gathered(ivec2 pixel, vec4 here, vec4 place, int count) {
    ivec2 size = textureSize(entering, 0);
    float pixels_per_mm = focal / here.a;
    vec3 n = texelFetch(facing, pixel, 0).xyz, position = vec3((gl_FragCoord.xy - center) / focal, -1.0) * here.a;
    vec3 t = normalize(cross(abs(n.x) < 0.9 ? vec3(1, 0, 0) : vec3(0, 1, 0), n)), b = cross(n, t);

    float own = 0.56 / pixels_per_mm;
    vec3 inner = encircled(own, place).rgb;
    if (own < LEAST_RADIUS_MM) inner *= own * own / (LEAST_RADIUS_MM * LEAST_RADIUS_MM);
    float first = min(inner.r, min(inner.g, inner.b));  // the widest channel has the least within the pixel

    float phase = bayer(pixel), turn = 6.2831853 * fract(phase + float(frame) * 0.75488);
    float along = fract(phase * 16.0 * 0.61803399 + float(frame) * 0.56984);
    vec2 way = vec2(cos(turn), sin(turn));
    vec3 sum = inner * here.rgb, weights = inner;
    for (int i = 0; i < count; i++) {
        float middle = mix(first, 1.0, (float(i) + along) / float(count)), end = mix(first, 1.0, float(i + 1) / float(count));
        float radius = ring(middle, place).x;
        vec3 outer = i == count - 1 ? vec3(1.0) : max(ring(end, place).yzw, inner);
        vec3 weight = outer - inner;
        inner = outer;
        vec3 at = position + (t * way.x + b * way.y) * radius;
        way = GOLDEN * way;
        ivec2 tap = ivec2(floor(at.xy / -at.z * focal + center));
        if (any(lessThan(tap, ivec2(0))) || any(greaterThanEqual(tap, size))) continue;
        vec4 there = texelFetch(entering, tap, 0);
        float counts = there.a > 0.0 ? clamp(2.0 - abs(there.a + at.z) / (radius + 0.35), 0.0, 1.0) : 0.0;
        sum += weight * counts * there.rgb;
        weights += weight * counts;
    }
    return sum / max(weights, vec3(1e-4));
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 here = texelFetch(entering, pixel, 0);
    scattered = vec4(0.0);
    if (here.a <= 0.0) return;
    vec4 own = texelFetch(skin, pixel, 0), place = profile_place(own.rgb);
    float footprint = encircled(1.0, place).a * focal / here.a;  // r99 in pixels
    int count = taps == 0 || footprint < LEAST_FOOTPRINT ? 0 : clamp(int(ceil(4.0 * footprint)), min(8, taps), taps);
    vec3 light = count == 0 ? here.rgb : gathered(pixel, here, place, count);
    // What comes through a thin part from its far side: all light that travels farther than the part is thick.
    light += sun * texelFetch(behind, pixel, 0).a * (1.0 - encircled(own.a, place).rgb) * step(own.a, 31.9);
    float leaving = texelFetch(facing, pixel, 0).a;
    scattered = vec4(skin_color(own.rgb) * texelFetch(detail, pixel, 0).rgb * light * leaving / 3.14159265, 1.0);
}

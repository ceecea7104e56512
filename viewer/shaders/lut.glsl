// What the LUT set says about a skin (melanin, eumelanin, hemoglobin). Textures and coordinates: viewer/textures.py.
#include "functions.glsl"
uniform sampler3D lut_color, lut_rings, lut_encircled;

vec3 skin_color(vec3 skin) {
    return texture(lut_color, color_coordinates(skin)).rgb;
}

// Where a skin lies in the profile tables: melanin, the slices of hemoglobin below and above in eumelanin, their mix.
vec4 profile_place(vec3 skin) {
    vec3 count = vec3(profile_COUNT), at = profile_coordinates(skin);
    float e = at.y * count.y - 0.5, first = clamp(floor(e), 0.0, max(count.y - 2.0, 0.0)), next = min(first + 1.0, count.y - 1.0);
    return vec4(at.x, (vec2(first, next) + at.z) / count.y, clamp(e - first, 0.0, 1.0));
}

vec4 in_profile(sampler3D table, float at, vec4 place) {
    return mix(texture(table, vec3(at, place.xy)), texture(table, vec3(at, place.xz)), place.w);
}

// Radius in mm and encircled energies at a quantile of the widest channel.
vec4 ring(float quantile, vec4 place) {
    return in_profile(lut_rings, ring_tail(1.0 - quantile), place);
}

// Encircled energies within a radius; a: the radius that holds 99 % of the widest channel, both in mm.
vec4 encircled(float radius_mm, vec4 place) {
    return in_profile(lut_encircled, encircled_radius_mm(radius_mm), place);
}

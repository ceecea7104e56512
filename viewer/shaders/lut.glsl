// What the LUT set says about a skin (melanin, eumelanin, hemoglobin). Textures and coordinates: viewer/textures.py.
#include "functions.glsl"
uniform sampler3D lut_color, lut_rings, lut_encircled;

vec3 skin_color(vec3 skin) {
    return texture(lut_color, vec3(color_melanin(skin.x), color_hemoglobin(skin.z), color_eumelanin(skin.y))).rgb;
}

// Where a skin lies in the profile tables: melanin, the slices of hemoglobin below and above in eumelanin, their mix.
vec4 profile_place(vec3 skin) {
    float counts = float(profile_COUNT.y * profile_COUNT.z);
    float e = profile_eumelanin(skin.y) * float(profile_COUNT.y) - 0.5, first = clamp(floor(e), 0.0, float(max(profile_COUNT.y - 2, 0)));
    float in_slice = profile_hemoglobin(skin.z) * float(profile_COUNT.z);
    float next = min(first + 1.0, float(profile_COUNT.y - 1));
    return vec4(profile_melanin(skin.x), (vec2(first, next) * float(profile_COUNT.z) + in_slice) / counts, clamp(e - first, 0.0, 1.0));
}

vec4 in_profile(sampler3D table, float at, vec4 place) {
    return mix(texture(table, vec3(at, place.xy)), texture(table, vec3(at, place.xz)), place.w);
}

// Radius in mm and encircled energies at a quantile of the widest channel.
vec4 ring(float quantile, vec4 place) {
    float s = 1.0 - sqrt(max(1.0 - quantile, 0.0));
    return in_profile(lut_rings, (s * (QUANTILE_COUNT - 1.0) + 0.5) / QUANTILE_COUNT, place);
}

// Encircled energies within a radius; a: the radius that holds 99 % of the widest channel, both in mm.
vec4 encircled(float radius_mm, vec4 place) {
    float t = clamp((log(max(radius_mm, 1e-9)) - LOG_RADIUS_LOW) / LOG_RADIUS_SPAN, 0.0, 1.0);
    return in_profile(lut_encircled, (t * (RADIUS_COUNT - 1.0) + 0.5) / RADIUS_COUNT, place);
}

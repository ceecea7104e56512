// Light from all around, linear ACEScg: a studio of three soft boxes, or an equirectangular picture with mips.
uniform sampler2D environment_map;
uniform int environment_levels;   // mip levels of environment_map; 0: the studio
uniform float environment;        // gain
uniform vec2 environment_turn;    // cosine and sine of the angle that the surroundings are turned by, from +z toward +x
uniform vec3 irradiance_sh[9];    // cosine-convolved harmonics of the same light, order 2

vec3 studio(vec3 d, float roughness) {
    vec3 light = mix(vec3(0.088, 0.083, 0.080), vec3(0.29, 0.31, 0.335), smoothstep(-0.6, 0.9, d.y));
    float widened = 1.2 * roughness * roughness * roughness;
    for (int i = 0; i < STUDIO_LOBES; i++) {
        float sharp = STUDIO_SHARPNESS[i] / (1.0 + widened * STUDIO_SHARPNESS[i]);
        light += STUDIO_COLOR[i] * (sharp / STUDIO_SHARPNESS[i]) * exp(sharp * (dot(d, STUDIO_DIRECTION[i]) - 1.0));
    }
    return light;
}

// A direction as the surroundings have it before they are turned.
vec3 unturned(vec3 d) {
    return vec3(d.x * environment_turn.x - d.z * environment_turn.y, d.y, d.x * environment_turn.y + d.z * environment_turn.x);
}

// What a rough mirror of normal n shows of the surroundings, seen from v at cosine nv. Its lobe around the mirrored
// direction narrows toward grazing, where that of a rough one leans back to n. Fitted to the lobes' own means of the studio
// (roughness 0.15 to 1, all cosines): off by 13 % RMS; one width for all cosines that does not lean was off by 47 %.
vec3 reflected(vec3 n, vec3 v, float nv, float roughness) {
    vec3 d = unturned(normalize(mix(reflect(-v, n), n, 0.6 * pow(roughness * (1.0 - nv), 2.0))));
    float seen = roughness * pow(max(nv, 0.2), 1.0 / 3.0);
    if (environment_levels == 0) return environment * studio(d, seen);
    vec2 at = vec2(atan(d.x, -d.z) / 6.28318531 + 0.5, acos(clamp(d.y, -1.0, 1.0)) / 3.14159265);
    return environment * textureLod(environment_map, at, sqrt(seen) * float(environment_levels - 1)).rgb;
}

// Irradiance from the hemisphere around n (Ramamoorthi & Hanrahan 2001).
vec3 irradiance(vec3 n) {
    n = unturned(n);
    vec3 e = irradiance_sh[0] * 0.282095 + 0.488603 * (irradiance_sh[1] * n.y + irradiance_sh[2] * n.z + irradiance_sh[3] * n.x)
        + 1.092548 * (irradiance_sh[4] * n.x * n.y + irradiance_sh[5] * n.y * n.z + irradiance_sh[7] * n.x * n.z)
        + irradiance_sh[6] * 0.315392 * (3.0 * n.z * n.z - 1.0)
        + irradiance_sh[8] * 0.546274 * (n.x * n.x - n.y * n.y);
    return environment * max(e, vec3(0.0));
}

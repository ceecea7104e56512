// Two GGX lobes with the energy of multiple scattering between facets put back (Turquin 2019).
uniform sampler2D ggx_albedo;     // (root of the cosine, roughness) -> directional albedo of one lobe: x at F = 1, y the part times (1 - c)^5

const float F0 = 0.0277778;       // skin against air, index 1.4
const float SECOND_LOBE = 0.55, SECOND_WEIGHT = 0.2;

float fresnel(float c) { return F0 + (1.0 - F0) * pow(1.0 - c, 5.0); }

// Share of light at that cosine that enters, relative to light along the normal: what a LUT color is multiplied with.
float entry_factor(float c) { return (1.0 - fresnel(c)) / (1.0 - F0); }

vec2 lobe_albedo(float c, float roughness) {
    vec2 size = vec2(textureSize(ggx_albedo, 0));
    return texture(ggx_albedo, (vec2(sqrt(c), roughness) * (size - 1.0) + 0.5) / size).xy;
}

// Microfacet lobe times cosine, for Fresnel reflectance f. What is put back was reflected once more, by facets that
// stand at all angles to the light: f0, as environment_lobe has it, not f, which near grazing is far larger.
float ggx(vec3 n, vec3 v, vec3 l, float roughness, float f, float f0) {
    vec3 h = normalize(v + l);
    float nl = max(dot(n, l), 0.0), nv = max(dot(n, v), 1e-3), nh = max(dot(n, h), 0.0);
    float a2 = pow(roughness, 4.0), d = nh * nh * (a2 - 1.0) + 1.0;
    float visible = 0.5 / (nl * sqrt(nv * nv * (1.0 - a2) + a2) + nv * sqrt(nl * nl * (1.0 - a2) + a2) + 1e-6);
    float single = a2 / (3.14159265 * d * d) * visible * nl * f;
    return single * (1.0 + f0 * (1.0 / lobe_albedo(nv, roughness).x - 1.0));
}

float specular_lobes(vec3 n, vec3 v, vec3 l, float roughness, float second) {
    float f = fresnel(max(dot(v, normalize(v + l)), 0.0));
    return mix(ggx(n, v, l, roughness, f, F0), ggx(n, v, l, second, f, F0), SECOND_WEIGHT);
}

// What an even environment reflects: split-sum of one lobe (Karis 2013), the lost energy put back.
float environment_lobe(vec2 albedo) {
    return (F0 * (albedo.x - albedo.y) + albedo.y) * (1.0 + F0 * (1.0 / albedo.x - 1.0));
}

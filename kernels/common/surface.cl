// Optics of a skin's surface, which OpenCL (renderer) and GLSL (viewer) both read: what it reflects, what of the
// light enters, and what of it leaves. lutgen/scene/surface.py puts each language's words and the constants of a
// refractive index before it, and has the same in NumPy, which tests compare both with. Everything is float.
//
// FUNCTION: what a function begins with. REAL, WHOLE: conversions. F0: reflectance along the normal. EXIT_MEAN
// [EXIT_MEANS]: mean over all directions of what a surface of a roughness (evenly from 0 to 1) lets out. An `energy` is of
// one GGX lobe at a cosine and a roughness: x at F = 1, y the part that goes with (1 - cosine to the facet)^5.

// Schlick's reflectance at cosine c. Photons inside the skin are reflected by Fresnel's own (optics.cl, `reflects`).
FUNCTION float fresnel(float c) {
    float d = 1.0f - c, square = d * d;
    return F0 + (1.0f - F0) * square * square * d;
}

// Share of light at cosine c that enters, relative to light along the normal: what a LUT color is multiplied with.
FUNCTION float entry_factor(float c) { return (1.0f - fresnel(c)) / (1.0f - F0); }

// What a lobe has with multiple scattering between facets over what it has without (Turquin 2019): light reflected once
// more by facets that stand at all angles to the light, so f0, not F at this angle, which near grazing is far larger.
FUNCTION float recovery(float f0, float2 energy) { return 1.0f + f0 * (1.0f / energy.x - 1.0f); }

// What one lobe reflects of an even environment: split sum (Karis 2013), the lost energy recovered.
FUNCTION float lobe_share(float2 energy) { return (F0 * (energy.x - energy.y) + energy.y) * recovery(F0, energy); }

// Light that leaves a rough surface at the cosine of an energy, relative to the mean over all: all but what it reflects
// from there inward, so that outlines do not turn black as under a polished surface.
FUNCTION float exit_factor(float2 energy, float roughness) {
    float node = roughness * REAL(EXIT_MEANS - 1);
    int low = min(WHOLE(node), EXIT_MEANS - 2);
    return (1.0f - lobe_share(energy)) / mix(EXIT_MEAN[low], EXIT_MEAN[low + 1], node - REAL(low));
}

// One GGX lobe at F = 1 times the light's cosine, with height-correlated masking (Heitz 2014), nothing recovered.
FUNCTION float ggx(float3 n, float3 v, float3 l, float roughness) {
    float3 h = normalize(v + l);
    float nl = fmax(dot(n, l), 0.0f), nv = fmax(dot(n, v), 1e-3f), nh = fmax(dot(n, h), 0.0f);
    float square = roughness * roughness, a2 = square * square, d = nh * nh * (a2 - 1.0f) + 1.0f;
    float visible = 0.5f / (nl * sqrt(nv * nv * (1.0f - a2) + a2) + nv * sqrt(nl * nl * (1.0f - a2) + a2) + 1e-6f);
    return a2 / (3.14159265f * d * d) * visible * nl;
}

// Both lobes of skin times the light's cosine; energies of each at the view's cosine.
FUNCTION float specular_lobes(float3 n, float3 v, float3 l, float rough, float rough2, float2 energy, float2 energy2) {
    float first = ggx(n, v, l, rough) * recovery(F0, energy), second = ggx(n, v, l, rough2) * recovery(F0, energy2);
    return fresnel(fmax(dot(v, normalize(v + l)), 0.0f)) * mix(first, second, SECOND_WEIGHT);
}

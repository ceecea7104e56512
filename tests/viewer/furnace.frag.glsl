#version 330
// What the specular reflects of light that comes from everywhere, for 16 cosines of the view from 0.1 to 1.
//
// Directions are mirrored at visible normals of both lobes (Heitz 2018), on a grid that is dense at the lobes' rims;
// each counts as the function over the sum of both densities, so that no peak falls between the points.
#include "specular.glsl"
uniform float roughness;
uniform int law;                  // 0: one lobe at F = 1; 1: the skin's two lobes with their Fresnel reflectance
out vec4 pixel;                   // reflected; what lobe_share promises; Fresnel reflectance of a smooth surface

const int RADII = 96, TURNS = 64;

float density(vec3 v, vec3 l, float rough) {
    float a2 = pow(rough, 4.0), h = normalize(v + l).z, d = h * h * (a2 - 1.0) + 1.0, k = 1.0 / (v.z * v.z) - 1.0;
    return a2 / (3.14159265 * d * d) / (0.5 + 0.5 * sqrt(1.0 + a2 * k)) / (4.0 * v.z);
}

vec3 mirrored(vec3 v, float rough, float t, float turn) {
    float a = rough * rough, r = sqrt(1.0 - (1.0 - t) * (1.0 - t) * (1.0 - t));
    vec2 seen = normalize(vec2(a * v.x, v.z));
    float x = r * cos(turn), lean = 0.5 + 0.5 * seen.y, y = (1.0 - lean) * sqrt(1.0 - x * x) + lean * r * sin(turn);
    float z = sqrt(max(1.0 - x * x - y * y, 0.0));
    vec3 h = normalize(vec3(a * (z * seen.x - y * seen.y), a * x, y * seen.x + z * seen.y));
    return 2.0 * dot(v, h) * h - v;
}

void main() {
    float nv = 0.1 + 0.9 * floor(gl_FragCoord.x) / 15.0, second = roughness * SECOND_LOBE, sum = 0.0;
    vec2 energy = lobe_energy(nv, roughness), energy2 = lobe_energy(nv, second);
    vec3 n = vec3(0.0, 0.0, 1.0), v = vec3(sqrt(1.0 - nv * nv), 0.0, nv);
    for (int lobe = 0; lobe < 2; lobe++)
        for (int i = 0; i < RADII; i++)
            for (int j = 0; j < TURNS; j++) {
                float t = (float(i) + 0.5) / float(RADII), turn = 3.14159265 * ((float(j) + 0.5) / float(TURNS) - 0.5);
                vec3 l = mirrored(v, lobe == 0 ? roughness : second, t, turn);
                if (l.z <= 0.0) continue;
                float share = 3.0 * (1.0 - t) * (1.0 - t) / float(RADII * TURNS);
                float light = law == 0 ? ggx(n, v, l, roughness) * recovery(1.0, energy)
                                       : specular_lobes(n, v, l, roughness, second, energy, energy2);
                sum += share * light / (density(v, l, roughness) + density(v, l, second));
            }
    float promised = mix(lobe_share(energy), lobe_share(energy2), SECOND_WEIGHT);
    pixel = vec4(sum, promised, fresnel(nv), 1.0);
}

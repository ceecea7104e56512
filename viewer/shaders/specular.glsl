// The surface's optics (kernels/common/surface.cl), and the table of its lobes' energy.
#include "surface.cl"
uniform sampler2D lobe_table;     // (root of the cosine, roughness) -> energy of one lobe

vec2 lobe_energy(float c, float roughness) {
    vec2 size = vec2(textureSize(lobe_table, 0));
    return texture(lobe_table, (vec2(sqrt(c), roughness) * (size - 1.0) + 0.5) / size).xy;
}

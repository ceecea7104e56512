#version 330
// The color of a head's skin over its texture coordinates: what a game without lutgen has painted once.
#include "lut.glsl"
uniform sampler2D chromophore_map, detail_map;
uniform vec3 chromophores, chromophores_low, chromophores_high;
uniform vec2 contrast;
in vec2 screen;
out vec4 albedo;

void main() {
    vec3 ratio = texture(chromophore_map, screen).xyz;
    ratio.xz = pow(ratio.xz, contrast);
    albedo = vec4(skin_color(clamp(chromophores * ratio, chromophores_low, chromophores_high)) * texture(detail_map, screen).rgb, 1.0);
}

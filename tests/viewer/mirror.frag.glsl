#version 330
// What a rough mirror shows of the surroundings, for pairs of a normal and a direction of view.
#include "constants.glsl"
#include "environment.glsl"
uniform sampler2D pairs;          // row 0: normals, row 1: directions toward the eye
uniform float roughness;
out vec4 pixel;

void main() {
    vec3 n = texelFetch(pairs, ivec2(gl_FragCoord.x, 0), 0).xyz, v = texelFetch(pairs, ivec2(gl_FragCoord.x, 1), 0).xyz;
    pixel = vec4(reflected(n, v, dot(n, v), roughness), 1.0);
}

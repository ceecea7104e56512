#version 330
// The head as the camera sees it: view space for scattering, world space for light.
uniform mat4 view, clip, light_clip;
uniform float shadow_offset_mm;
in vec3 position;
in vec3 normal;
in vec2 uv;
out vec3 view_position, view_normal, world_position, world_normal;
out vec2 texcoord;
out vec3 light_position;
invariant gl_Position;           // the same depth as in shadow.vert.glsl

void main() {
    view_position = (view * vec4(position, 1.0)).xyz;
    view_normal = mat3(view) * normal;
    world_position = position;
    world_normal = normal;
    texcoord = uv;
    light_position = (light_clip * vec4(position + normal * shadow_offset_mm, 1.0)).xyz * 0.5 + 0.5;
    gl_Position = clip * vec4(position, 1.0);
}

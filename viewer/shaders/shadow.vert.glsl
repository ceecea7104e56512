#version 330
uniform mat4 light_clip;
in vec3 position;
invariant gl_Position;

void main() { gl_Position = light_clip * vec4(position, 1.0); }

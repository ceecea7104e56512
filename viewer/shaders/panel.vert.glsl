#version 330
uniform vec2 size;
in vec2 position;
in vec2 uv;
in vec4 color;
out vec2 at;
out vec4 tint;

void main() {
    at = uv;
    tint = color;
    gl_Position = vec4(2.0 * position.x / size.x - 1.0, 1.0 - 2.0 * position.y / size.y, 0.0, 1.0);
}

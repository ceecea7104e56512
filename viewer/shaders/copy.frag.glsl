#version 330
uniform sampler2D frame;
in vec2 screen;
out vec4 pixel;

void main() { pixel = texture(frame, screen); }

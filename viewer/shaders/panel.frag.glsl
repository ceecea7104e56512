#version 330
uniform sampler2D glyphs;
in vec2 at;
in vec4 tint;
out vec4 pixel;

void main() { pixel = tint * texture(glyphs, at); }

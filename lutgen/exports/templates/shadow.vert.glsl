// The head as the key light sees it.
uniform mat4 light_view;
in vec3 position;

void main() { gl_Position = light_view * vec4(position, 1.0); }

// The head in view space, in millimetres; `center` moves the picture by parts of a pixel, so that frames add up smooth.
uniform mat4 view, projection, light_view;
uniform vec2 center;
in vec3 position, normal;
in vec2 corner;
in float sky;
out vec3 at, facing, in_light;
out vec2 uv;
out float open_sky, height;

void main() {
    vec4 seen = view * vec4(position, 1.0);
    at = seen.xyz;
    facing = mat3(view) * normal;
    uv = corner;
    open_sky = sky;
    height = position.y;
    in_light = (light_view * vec4(position + 0.8 * normal, 1.0)).xyz * 0.5 + 0.5;
    gl_Position = projection * seen;
    gl_Position.xy += center * gl_Position.w;
}

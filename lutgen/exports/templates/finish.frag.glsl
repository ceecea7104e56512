// Linear Rec. 709 to sRGB; within `swatch` (left, bottom, right, top in pixels) the slider's color itself: one fetch.
uniform sampler2D sum;
uniform highp sampler3D lut;
uniform vec3 skin;
uniform vec4 swatch;
out vec4 pixel;

void main() {
    vec2 at = gl_FragCoord.xy;
    vec4 all_frames = texelFetch(sum, ivec2(at), 0);
    vec3 linear = all_frames.rgb / all_frames.a;
    bool flat_color = all(greaterThan(at, swatch.xy)) && all(lessThan(at, swatch.zw));
    if (flat_color) linear = lutgen_color(lut, skin);
    linear = clamp(linear, 0.0, 1.0);
    vec3 coded = mix(1.055 * pow(linear, vec3(1.0 / 2.4)) - 0.055, 12.92 * linear, lessThanEqual(linear, vec3(0.0031308)));
    float dither = fract(52.9829189 * fract(dot(at, vec2(0.06711056, 0.00583715)))) - 0.5;
    pixel = vec4(coded + (flat_color ? 0.0 : dither / 255.0), 1.0);
}

#version 330
// Scattered and reflected light together, then exposure, gamut, tone curve, sRGB and dither.
uniform sampler2D scattered, reflected_light;
uniform mat3 srgb_from_acescg;
uniform vec3 luminance;           // of linear sRGB
uniform float exposure;
uniform int samples;              // pixels averaged along x and y
in vec2 screen;
out vec4 pixel;

// Toward gray as far as the most negative channel needs, so that pure red light keeps its hue (instead of clipping).
vec3 into_gamut(vec3 c) {
    float gray = max(dot(c, luminance), 0.0), least = min(c.r, min(c.g, c.b));
    return least < 0.0 && gray > least ? mix(vec3(gray), c, gray / (gray - least)) : c;
}

// Khronos PBR Neutral: colors below the shoulder stay what they are.
vec3 tone(vec3 c) {
    const float start = 0.76, desaturation = 0.15;
    float x = min(c.r, min(c.g, c.b)), offset = x < 0.08 ? x - 6.25 * x * x : 0.04;
    c -= offset;
    float peak = max(c.r, max(c.g, c.b));
    if (peak < start) return c;
    float d = 1.0 - start, top = 1.0 - d * d / (peak + d - start);
    c *= top / peak;
    return mix(c, vec3(top), 1.0 - 1.0 / (desaturation * (peak - top) + 1.0));
}

vec3 encode(vec3 c) { return mix(12.92 * c, 1.055 * pow(max(c, vec3(0.0)), vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c)); }

void main() {
    vec2 from_center = screen - vec2(0.5, 0.55);
    vec3 backdrop = encode(mix(vec3(0.030, 0.033, 0.038), vec3(0.0045, 0.0048, 0.0060), smoothstep(0.0, 0.75, length(from_center))));
    vec3 sum = vec3(0.0);
    ivec2 first = ivec2(gl_FragCoord.xy) * samples;
    for (int y = 0; y < samples; y++)
        for (int x = 0; x < samples; x++) {
            vec4 light = texelFetch(scattered, first + ivec2(x, y), 0);
            vec3 linear = srgb_from_acescg * (exposure * (light.rgb / max(light.a, 1.0) + texelFetch(reflected_light, first + ivec2(x, y), 0).rgb));
            sum += light.a > 0.0 ? encode(clamp(tone(into_gamut(linear)), 0.0, 1.0)) : backdrop;
        }
    float grain = fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715)))) - 0.5;
    pixel = vec4(sum / float(samples * samples) + grain / 255.0, 1.0);
}

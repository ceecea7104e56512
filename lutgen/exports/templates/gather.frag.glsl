// Subsurface scattering in screen space: a pixel gathers what entered around it, ring by ring of its skin's profile.
//
// A ring between two quantiles of the widest channel weighs, per channel, the encircled energy between its radii, so the
// weights sum to 1. Taps lie in the tangent plane; one whose depth is off that plane is no neighbor. Each frame turns
// them anew, and frames are averaged.
uniform sampler2D entering, surface, place, gloss, row;
uniform highp sampler3D lut;
uniform float focal, scatters;
uniform vec2 middle;
uniform int frame;
out vec4 radiance;

const int TAPS = 16;
const mat2 GOLDEN = mat2(-0.73736888, 0.67549029, -0.67549029, -0.73736888);

vec4 ring(float quantile) {
    float column = clamp(quantile * float(QUANTILES) - 0.5, 0.0, float(QUANTILES - 1));
    int first = min(int(column), QUANTILES - 2);
    return mix(texelFetch(row, ivec2(first, 0), 0), texelFetch(row, ivec2(first + 1, 0), 0), column - float(first));
}

// Encircled energies within a radius in mm (rgb), and the quantile there (a); within the first column's, by area.
vec4 within(float radius) {
    int low = 0, high = QUANTILES - 1;
    while (high - low > 1) {
        int half_way = (low + high) / 2;
        if (texelFetch(row, ivec2(half_way, 0), 0).x < radius) low = half_way; else high = half_way;
    }
    vec4 a = texelFetch(row, ivec2(low, 0), 0), b = texelFetch(row, ivec2(high, 0), 0);
    if (radius < a.x) return vec4(a.yzw, 0.5 / float(QUANTILES)) * radius * radius / (a.x * a.x);
    float along = clamp((radius - a.x) / max(b.x - a.x, 1e-6), 0.0, 1.0);
    return vec4(mix(a.yzw, b.yzw, along), (float(low) + 0.5 + along) / float(QUANTILES));
}

float noise(ivec2 p, float seed) {
    return fract(52.9829189 * fract(dot(vec2(p) + seed, vec2(0.06711056, 0.00583715))));
}

vec3 gathered(ivec2 pixel, vec4 here) {
    vec3 n = texelFetch(surface, pixel, 0).xyz, at = vec3((gl_FragCoord.xy - middle) / focal, -1.0) * here.a;
    vec3 t = normalize(cross(abs(n.x) < 0.9 ? vec3(1, 0, 0) : vec3(0, 1, 0), n)), b = cross(n, t);
    vec4 own = within(0.56 * here.a / focal);  // a disc of the pixel's area
    float phase = noise(pixel, 5.588238 * float(frame)), turn = 6.2831853 * phase, along = fract(phase * 16.0);
    vec2 way = vec2(cos(turn), sin(turn));
    vec3 inner = own.rgb, sum = inner * here.rgb, weights = inner;
    for (int i = 0; i < TAPS; i++) {
        float from = mix(own.a, 1.0, float(i) / float(TAPS)), to = mix(own.a, 1.0, float(i + 1) / float(TAPS));
        float radius = ring(mix(from, to, along)).x;
        vec3 outer = i == TAPS - 1 ? vec3(1.0) : max(ring(to).yzw, inner), weight = outer - inner;
        inner = outer;
        vec3 there = at + (t * way.x + b * way.y) * radius;
        way = GOLDEN * way;
        ivec2 tap = ivec2(floor(there.xy / -there.z * focal + middle));
        if (any(lessThan(tap, ivec2(0))) || any(greaterThanEqual(tap, textureSize(entering, 0)))) continue;
        vec4 light = texelFetch(entering, tap, 0);
        float counts = light.a > 0.0 ? clamp(2.0 - abs(light.a + there.z) / (radius + 0.35), 0.0, 1.0) : 0.0;
        sum += weight * counts * light.rgb;
        weights += weight * counts;
    }
    return sum / max(weights, vec3(1e-4));
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 here = texelFetch(entering, pixel, 0);
    if (here.a <= 0.0) {
        float far = length((gl_FragCoord.xy - middle) / float(textureSize(entering, 0).y) - vec2(0.0, 0.1));
        radiance = vec4(vec3(mix(0.055, 0.014, smoothstep(0.0, 0.9, far))), 1.0);
        return;
    }
    vec3 light = scatters > 0.5 ? gathered(pixel, here) : here.rgb;
    radiance = vec4(lutgen_color(lut, texelFetch(place, pixel, 0).rgb) * light + texelFetch(gloss, pixel, 0).rgb, 1.0);
}

// What enters the skin at each pixel, and what its surface reflects at once.
uniform sampler2D pigments, bumps;
uniform highp sampler2DShadow shadow;
uniform mat4 view;
uniform vec3 skin, key;          // key: toward the light, in world space
uniform float mapped;
in vec3 at, facing, in_light;
in vec2 uv;
in float open_sky, height;
layout(location = 0) out vec4 entering;   // irradiance / pi that enters; a: depth in mm, 0 where there is nothing
layout(location = 1) out vec4 surface;    // geometric normal
layout(location = 2) out vec4 place;      // melanin, eumelanin, hemoglobin
layout(location = 3) out vec4 gloss;      // reflected radiance

const float KEY = 0.92, RIM = 0.55, SKY = 0.42;
const vec3 RIM_WAY = vec3(0.80, 0.25, -0.55);

// Share that enters at a cosine, relative to the normal: dielectric Fresnel, as the LUT's values contain it.
float enters(float c) {
    float t = sqrt(1.0 - (1.0 - c * c) / (INDEX * INDEX));  // cosine inside
    float a = (c - INDEX * t) / (c + INDEX * t), b = (INDEX * c - t) / (INDEX * c + t);
    return (1.0 - 0.5 * (a * a + b * b)) / ENTRY;
}

vec3 bumped(vec3 n) {
    vec3 px = dFdx(at), py = dFdy(at);
    vec2 tx = dFdx(uv), ty = dFdy(uv);
    vec3 across = cross(py, n), along = cross(n, px);
    vec3 t = across * tx.x + along * ty.x, b = across * tx.y + along * ty.y;
    float size = inversesqrt(max(max(dot(t, t), dot(b, b)), 1e-20));
    vec3 m = texture(bumps, uv).xyz * 2.0 - 1.0;
    return normalize(t * size * m.x + b * size * m.y + n * m.z);
}

// GGX with height-correlated shadowing (Heitz 2014) and Schlick's Fresnel; times the cosine to the light.
float glint(vec3 n, vec3 v, vec3 l, float roughness) {
    vec3 h = normalize(v + l);
    float nl = dot(n, l), nv = max(dot(n, v), 0.02), nh = dot(n, h), a2 = roughness * roughness * roughness * roughness;
    if (nl <= 0.0) return 0.0;
    float d = nh * nh * (a2 - 1.0) + 1.0, F = F0 + ENTRY * pow(1.0 - max(dot(v, h), 0.0), 5.0);
    float shade = nl * sqrt(nv * nv * (1.0 - a2) + a2) + nv * sqrt(nl * nl * (1.0 - a2) + a2);
    return a2 / (d * d) * F * 0.5 / shade * nl;
}

void main() {
    if (height < -178.0) discard;  // the bust ends in a ragged edge
    vec3 n = normalize(facing), v = normalize(-at);
    if (dot(n, v) < 0.0) n = normalize(n - dot(n, v) * v + 0.02 * v);
    vec3 m = mix(n, bumped(n), mapped), p = texture(pigments, uv).rgb;
    vec2 ratio = mix(vec2(1.0), 4.0 * p.rg * p.rg * p.rg, mapped);
    float roughness = mix(0.5, clamp(0.5 * 2.0 * p.b, 0.3, 0.8), mapped);

    vec3 l = mat3(view) * key, r = mat3(view) * normalize(RIM_WAY), up = mat3(view) * vec3(0.0, 1.0, 0.0);
    float lit = texture(shadow, in_light), nl = max(dot(m, l), 0.0) * step(0.0, dot(n, l)), nr = max(dot(m, r), 0.0);
    float ambient = SKY * open_sky * mix(0.35, 1.0, 0.5 + 0.5 * dot(m, up));
    float enter = KEY * lit * nl * enters(nl) + RIM * open_sky * nr * enters(nr) + ambient * 0.95;
    entering = vec4(vec3(enter), -at.z);
    surface = vec4(n, 0.0);
    place = vec4(skin.x * ratio.x, skin.y, skin.z * ratio.y, 1.0);
    vec3 back = reflect(-v, m);
    float around = SKY * open_sky * mix(0.25, 1.0, smoothstep(-0.4, 0.8, dot(back, up)));
    float rim = F0 + (1.0 - roughness) * 0.55 * pow(1.0 - max(dot(m, v), 0.0), 5.0);
    gloss = vec4(vec3(KEY * lit * glint(m, v, l, roughness) + RIM * open_sky * glint(m, v, r, roughness) + around * rim), 1.0);
}

#version 330
// First pass over the head: light that enters the skin, what the skin is, and the light that does not enter.
#include "constants.glsl"
#include "environment.glsl"
#include "specular.glsl"
#include "pores.glsl"
uniform sampler2D normal_map, chromophore_map, surface_map, detail_map, shadow_map;
uniform vec3 light_direction, light_color, eye;
uniform vec3 from_skin;           // irradiance from all around by skin that lies open
uniform vec3 chromophores;        // melanin, eumelanin, hemoglobin: what the maps multiply
uniform vec3 chromophores_low, chromophores_high;  // what the LUT set covers
uniform vec2 contrast;            // exponents of the melanin and hemoglobin ratios: freckles fade on dark skin
uniform float roughness, specular, bumps, entry, transmission, light_radius, shadow_bias, environment_entry, light_range_mm;
in vec3 view_position, view_normal, world_position, world_normal;
in vec2 texcoord;
in vec3 light_position;
#ifdef PLAIN_ALBEDO                         // the skin of a game without lutgen (viewer/measure/plain.py)
uniform sampler2D albedo_map;
layout(location = 0) out vec4 seen;         // rgb: radiance; a: 1 where there is a head
vec4 entering, facing, skin, reflected_light, detail;
#else
layout(location = 0) out vec4 entering;     // rgb: irradiance that enters; a: view depth in mm, 0 where there is no head
layout(location = 1) out vec4 facing;       // rgb: view-space geometric normal; a: exit factor of the skin seen there
layout(location = 2) out vec4 skin;         // melanin, eumelanin, hemoglobin; a: thickness in mm
layout(location = 3) out vec4 reflected_light;  // rgb: specular; a: light on the far side of a thin part
layout(location = 4) out vec4 detail;       // rgb: painted detail times albedo
#endif

float noise(vec2 p) { return fract(52.9829189 * fract(dot(p, vec2(0.06711056, 0.00583715)))); }

float lit(float facing_light) {
    float angle = noise(gl_FragCoord.xy) * 6.2831853, sum = 0.0;
    vec2 offset = vec2(cos(angle), sin(angle));
    for (int i = 0; i < 16; i++) {
        vec2 at = light_position.xy + offset * sqrt((float(i) + 0.5) / 16.0) * light_radius;
        offset = mat2(-0.73736888, 0.67549029, -0.67549029, -0.73736888) * offset;
        sum += step(light_position.z - shadow_bias, textureLod(shadow_map, at, 0.0).r);
    }
    return sum / 16.0 * smoothstep(0.0, 0.12, facing_light);
}

// The normal that the map gives (its length in alpha: below 1 where mipmaps averaged different ones) and the pores' share.
vec4 bumped(vec3 n, out float porous) {
    vec3 dx = dFdx(world_position), dy = dFdy(world_position), across = cross(dy, n), along = cross(n, dx);
    vec2 ux = dFdx(texcoord), uy = dFdy(texcoord);
    vec3 t = across * ux.x + along * uy.x, b = across * ux.y + along * uy.y;
    float scale = inversesqrt(max(max(dot(t, t), dot(b, b)), 1e-20));
    vec4 texel = texture(normal_map, texcoord);
    porous = texel.a;
    vec3 tangent = texel.xyz * 2.0 - 1.0;
    float even = min(length(tangent), 1.0);
    tangent = normalize(vec3(tangent.xy * bumps, max(tangent.z, 0.2)));
    return vec4(normalize(t * scale * tangent.x + b * scale * tangent.y + n * tangent.z), even);
}

void main() {
    float porous;
    vec3 geometric = normalize(world_normal), v = normalize(eye - world_position);
    vec4 mapped = bumped(geometric, porous);
    vec4 relief = pores(world_position, mapped.xyz);
    float strength = bumps * porous;
    // Not of unit length: the light per area of the plain skin, so that relief moves light about and adds none.
    vec3 tilted = mapped.xyz - strength * relief.xyz, n = normalize(tilted);
    float nv = max(dot(n, v), 1e-3), nl = max(dot(n, light_direction), 0.0), received = max(dot(tilted, light_direction), 0.0);
    vec4 surface = texture(surface_map, texcoord);  // roughness and specular ratio, occlusion, thickness / 32 mm
    float open = surface.z, shadow = lit(dot(geometric, light_direction));
    vec3 sun = light_color * shadow;

    // What the pixel's slopes vary by too finely to be seen makes it rougher.
    float unseen = strength * strength * relief.w + bumps * bumps * 2.0 * (1.0 - mapped.w);
    float rough = rougher(clamp(roughness * surface.x, 0.15, 1.0), unseen), rough2 = rougher(clamp(roughness * surface.x * SECOND_LOBE, 0.1, 1.0), unseen);
    vec2 energy = lobe_energy(nv, rough), energy2 = lobe_energy(nv, rough2);

    vec3 hidden = open * from_skin;  // skin that hides the sky lies about as open as what it hides it from
    vec3 sky = mix(hidden, irradiance(mapped.xyz), open) * mix(1.0, environment_entry, entry);
    entering = vec4(sun * received * mix(1.0, entry_factor(nl), entry) + sky, -view_position.z);
    facing = vec4(normalize(view_normal), mix(1.0, exit_factor(energy, rough), entry));

    vec3 ratio = texture(chromophore_map, texcoord).xyz;
    ratio.xz = pow(ratio.xz, contrast);
    skin = vec4(clamp(chromophores * ratio, chromophores_low, chromophores_high), surface.w * 32.0);
    detail = texture(detail_map, texcoord);

    float grazing = clamp(pow(nv + open, exp2(-16.0 * rough - 1.0)) - 1.0 + open, 0.0, 1.0);
    vec3 around = mix(reflected(n, v, nv, rough) * lobe_share(energy),
                      reflected(n, v, nv, rough2) * lobe_share(energy2), SECOND_WEIGHT);
    around = mix(lobe_share(energy) * hidden / 3.14159265, around, grazing);
    vec3 gloss = sun * specular_lobes(n, v, light_direction, rough, rough2, energy, energy2) + around;
    // Only where the far side is what the light meets first: no glow in nostrils that the nose shades.
    float covered = (light_position.z - textureLod(shadow_map, light_position.xy, 0.0).r) * light_range_mm;
    float behind = transmission * open * max(0.8 * dot(-geometric, light_direction) + 0.2, 0.0) * (1.0 - smoothstep(1.5, 3.0, covered / (surface.w * 32.0 + 1.5)));
    reflected_light = vec4(specular * surface.y * gloss, behind);
#ifdef PLAIN_ALBEDO
    seen = vec4(texture(albedo_map, texcoord).rgb * entering.rgb * facing.a / 3.14159265 + reflected_light.rgb, 1.0);
#endif
}

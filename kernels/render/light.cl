// Light at a surface: sun and surroundings with shadow rays, what of it enters, and what the skin reflects.
// Its optics are the viewer's (common/surface.cl), so that a comparison is one of transport. With look.entry 1 a surface
// lets light in and out by `entry_factor` and `exit_factor`; with entry 0 both are 1.

inline float entering_factor(const scene_t *s, float c) { return mix(1.0f, entry_factor(c), s->view->entry); }

// Energy of one lobe, read linearly from the table.
inline float2 lobe_energy(const scene_t *s, float c, float roughness) {
    float x = clamp(sqrt(c), 0.0f, 1.0f) * (LOBES - 1), y = clamp(roughness, 0.0f, 1.0f) * (LOBES - 1);
    int i = min((int)x, LOBES - 2), j = min((int)y, LOBES - 2);
    __global const float2 *row = s->lobe_table + j * LOBES + i;
    return mix(mix(row[0], row[1], x - i), mix(row[LOBES], row[LOBES + 1], x - i), y - j);
}

// What leaves toward a viewer at cosine c, relative to the mean over all directions.
inline float leaving_factor(const scene_t *s, float c, float roughness) {
    return mix(1.0f, exit_factor(lobe_energy(s, c, roughness), roughness), s->view->entry);
}

inline float lobes(const scene_t *s, const surface_t *here, float3 n, float3 v, float3 l) {
    float c = fmax(dot(n, v), 1e-3f);
    return specular_lobes(n, v, l, here->rough, here->rough2, lobe_energy(s, c, here->rough), lobe_energy(s, c, here->rough2));
}

// Radiance of the surroundings from direction d: an equirectangular table read linearly, row 0 on top.
inline float3 surroundings(const scene_t *s, float3 d) {
    __global const view_t *view = s->view;
    float x = d.x * view->turn[0] - d.z * view->turn[1], z = d.x * view->turn[1] + d.z * view->turn[0];
    int rows = view->environment_rows, columns = 2 * rows;
    float u = atan2(x, -z) * (0.5f * M_1_PI_F) + 0.5f, v = acos(clamp(d.y, -1.0f, 1.0f)) * M_1_PI_F;
    float row = clamp(v * rows - 0.5f, 0.0f, rows - 1.0f), column = u * columns - 0.5f;
    int top = min((int)row, max(rows - 2, 0)), left = (int)floor(column);
    float down = row - top, right = column - left;
    int first = left < 0 ? left + columns : left >= columns ? left - columns : left, next = first + 1 == columns ? 0 : first + 1;
    __global const float4 *a = s->environment_map + top * columns, *b = a + (rows > 1 ? columns : 0);
    return view->environment * mix(mix(a[first], a[next], right), mix(b[first], b[next], right), down).xyz;
}

// How bright the surroundings are about direction d, roughly and soon: what directions are chosen by.
inline float sky_strength(const scene_t *s, float3 d) {
    float3 p = (float3)(d.x * s->view->turn[0] - d.z * s->view->turn[1], d.y, d.x * s->view->turn[1] + d.z * s->view->turn[0]);
    p /= fabs(p.x) + fabs(p.y) + fabs(p.z);
    float x = p.y < 0.0f ? copysign(1.0f - fabs(p.z), p.x) : p.x, z = p.y < 0.0f ? copysign(1.0f - fabs(p.x), p.z) : p.z;
    int column = min((int)((0.5f + 0.5f * x) * SKY_CELLS), SKY_CELLS - 1);
    int row = min((int)((0.5f + 0.5f * z) * SKY_CELLS), SKY_CELLS - 1);
    return s->sky[row * SKY_CELLS + column];
}

// Where light rays start: off the round surface, so that no triangle shades itself or its neighbors.
inline float3 start(const surface_t *here) { return here->lifted + 0.01f * here->smooth; }

inline bool shaded(const scene_t *s, float3 o, float3 d) {
    return trace(o, d, 1e-3f, 1e9f, true, TREE_OF(s)).triangle >= 0;
}

// A direction into the sun, a disc of even radiance.
inline float3 toward_sun(const scene_t *s, rng_t *rng) {
    __global const view_t *view = s->view;
    float3 way = view3(view->sun_direction), t, b;
    float drop = view->sun_spread * next_uniform(rng), sine = sqrt(drop * (2.0f - drop)), y, x;
    uniform_azimuth(next_bits(rng), &y, &x);
    across(way, &t, &b);
    return normalize(way * (1.0f - drop) + (t * x + b * y) * sine);
}

// Sunlight that enters at a surface, relative to light along the normal, over pi: times a skin's color it is radiance.
inline float3 sunlight(const scene_t *s, const surface_t *here, float3 l, uint *rays) {
    float received = dot(here->relief, l);
    if (received <= 0.0f || dot(here->smooth, l) <= 0.0f || !s->view->sunny) return 0.0f;
    (*rays)++;
    if (shaded(s, start(here), l)) return 0.0f;
    float c = received * rsqrt(dot(here->relief, here->relief));
    return view3(s->view->sun_color) * (received * entering_factor(s, c) * M_1_PI_F);
}

// Directions that would lead into the skin are mirrored out of it: relief hands its light on.
inline float3 outward(float3 d, float3 n) {
    float c = dot(d, n);
    return c < 0.0f ? d - 2.0f * c * n : d;
}

// A direction into the surroundings, and the weight of the light from there: drawn out of CANDIDATES about the mapped
// normal by how much light would come from each (resampled importance sampling, Talbot et al. 2005); none counts less
// than a share of the mean, since skin may be there instead. Candidates lie evenly in azimuth and in sine squared.
inline float3 toward_surroundings(const scene_t *s, const surface_t *here, rng_t *rng, float *weight) {
    float3 t, b, n = here->mapped, chosen = n;
    const float turn_x = TURN_COSINE, turn_y = TURN_SINE, first = next_uniform(rng);
    float y, x, sum = 0.0f, kept = 1.0f, enters = 1.0f, u = next_uniform(rng);
    uniform_azimuth(next_bits(rng), &y, &x);
    across(n, &t, &b);
    for (uint i = 0; i < CANDIDATES; i++) {
        float square = ((i * STRIDE) % CANDIDATES + first) * (1.0f / CANDIDATES), sine = sqrt(square), c = sqrt(1.0f - square);
        float3 d = outward(normalize(n * c + (t * x + b * y) * sine), here->smooth);
        float entering = entering_factor(s, c), strength = entering * sky_strength(s, d);
        sum += strength;
        if (u * sum < strength) {
            u = u * sum / strength;
            chosen = d;
            kept = strength;
            enters = entering;
        } else {
            u = (u * sum - strength) / (sum - strength);
        }
        float turned = x * turn_x - y * turn_y;
        y = x * turn_y + y * turn_x;
        x = turned;
    }
    *weight = enters * sum / (CANDIDATES * kept);
    return chosen;
}

// A direction that one of the lobes reflects light from toward v, drawn by its visible facets (Heitz 2018), and the
// weight of the light from there; the mean weight is what `lobe_share` says of both.
inline float3 toward_reflection(const scene_t *s, const surface_t *here, float3 n, float3 v, rng_t *rng, float *weight) {
    float roughness = next_uniform(rng) < SECOND_WEIGHT ? here->rough2 : here->rough, alpha = roughness * roughness;
    float3 t, b;
    across(n, &t, &b);
    float nv = fmax(dot(n, v), 1e-3f);
    float3 out = normalize((float3)(alpha * dot(v, t), alpha * dot(v, b), nv));
    float r = sqrt(next_uniform(rng)), share = 0.5f * (1.0f + out.z), y, x;
    uniform_azimuth(next_bits(rng), &y, &x);
    x *= r;
    y *= r;
    float3 level = out.z < 0.9999f ? normalize((float3)(-out.y, out.x, 0.0f)) : (float3)(1.0f, 0.0f, 0.0f);
    float3 upright = cross(out, level);
    y = (1.0f - share) * sqrt(fmax(1.0f - x * x, 0.0f)) + share * y;
    float3 h = x * level + y * upright + sqrt(fmax(1.0f - x * x - y * y, 0.0f)) * out;
    h = normalize((float3)(alpha * h.x, alpha * h.y, fmax(h.z, 1e-6f)));
    float3 facet = h.x * t + h.y * b + h.z * n, l = normalize(2.0f * dot(v, facet) * facet - v);
    float nl = dot(n, l), vh = clamp(dot(v, facet), 0.0f, 1.0f), a2 = alpha * alpha;
    *weight = 0.0f;
    if (nl <= 0.0f) return l;
    float masked = 0.5f * (sqrt(1.0f + a2 * (1.0f - nv * nv) / (nv * nv)) - 1.0f);
    float hidden = 0.5f * (sqrt(1.0f + a2 * (1.0f - nl * nl) / (nl * nl)) - 1.0f);
    float kept = (1.0f + masked) / (1.0f + masked + hidden);
    *weight = fresnel(vh) * kept * recovery(F0, lobe_energy(s, nv, roughness));
    return outward(l, here->smooth);
}

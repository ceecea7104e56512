// What both ways to a picture share: what the surface reflects, and the light where a walk leaves the skin. Light that
// skin sends onto skin is followed: where a ray into the surroundings, or the mirrored one, meets the head, a walk
// starts anew there, and what the surface there reflects of sun and surroundings counts too.

// A walk's start: a hit (triangle -1: none), the direction that it is seen along, and how much of its light counts.
typedef struct {
    hit_t hit;
    float3 direction, tint;
} start_t;

inline rng_t stream(const scene_t *s, uint pixel, uint sample, uint round) {
    uint state[4];
    stream_state(s->view->seed, pixel, sample, round, state);
    rng_t rng = {state[0], state[1], state[2], state[3]};
    return rng;
}

// Cosine toward where a surface is seen from along d, as seen by the walk: never quite grazing.
inline float seen_cosine(float3 n, float3 d) { return clamp(-dot(n, d), 0.01f, 1.0f); }

// What the surface lets out toward where it is seen from, painted detail included.
inline float3 shown(const scene_t *s, const surface_t *here, float3 d) {
    return here->detail * leaving_factor(s, fmax(-dot(normalize(here->relief), d), 1e-3f), here->rough);
}

// Unit vector along the surface, the way that a ray along d goes.
inline float3 way_along(float3 n, float3 d) {
    float3 t = d - n * dot(n, d), b;
    if (dot(t, t) > 1e-12f) return normalize(t);
    across(n, &t, &b);
    return t;
}

// Light where a walk leaves the skin, `color` being what the walk carries; the ray into the surroundings that meets the
// head becomes the next start.
inline float3 gathered(const scene_t *s, const surface_t *there, float3 color, start_t *next, rng_t *rng, uint *tally) {
    float3 light = color * sunlight(s, there, toward_sun(s, rng), tally + SUN_RAYS);
    next->hit.triangle = -1;
    if (s->view->around) {
        float weight;
        next->direction = toward_surroundings(s, there, rng, &weight);
        tally[SKY_RAYS]++;
        next->hit = nearest(s, start(there), next->direction);
        if (next->hit.triangle < 0) light += color * weight * surroundings(s, next->direction);
        next->tint *= weight;
    }
    return light;
}

// Whether light that may be so strong is worth a ray, and how often: faint light is looked for the more rarely, and
// then counts as often as it was left out.
inline float worth(const scene_t *s, float strength, rng_t *rng) {
    float chance = fmin(strength / s->view->faint, 1.0f);
    return next_uniform(rng) < chance ? 1.0f / chance : 0.0f;
}

// Radiance that the surface reflects toward -d; a mirrored ray that meets the head becomes another start.
inline float3 reflected(const scene_t *s, const surface_t *here, float3 d, start_t *mirrored, rng_t *rng, uint *tally) {
    const float3 n = normalize(here->relief), v = -d, sun = toward_sun(s, rng);
    float3 light = 0.0f;
    mirrored->hit.triangle = -1;
    if (here->gloss <= 0.0f) return light;
    if (s->view->sunny && dot(n, sun) > 0.0f && dot(here->smooth, sun) > 0.0f) {
        float3 shine = view3(s->view->sun_color) * lobes(s, here, n, v, sun);
        float counts = worth(s, here->gloss * shine.y, rng);
        if (counts > 0.0f) {
            tally[SUN_RAYS]++;
            if (!shaded(s, start(here), sun)) light = counts * shine;
        }
    }
    float weight = 0.0f;
    mirrored->direction = toward_reflection(s, here, n, v, rng, &weight);
    if (s->view->around) weight *= worth(s, here->gloss * weight * sky_strength(s, mirrored->direction), rng);
    if (s->view->around && weight > 0.0f) {
        tally[SKY_RAYS]++;
        mirrored->hit = nearest(s, start(here), mirrored->direction);
        if (mirrored->hit.triangle < 0) light += weight * surroundings(s, mirrored->direction);
        mirrored->tint = here->gloss * weight;
    }
    return here->gloss * light;
}

// The camera ray of a sample, jittered within its pixel.
inline hit_t aimed(const scene_t *s, uint pixel, rng_t *rng, float3 *d, uint *tally) {
    uint columns = s->view->columns;
    float x = pixel % columns + next_uniform(rng), y = pixel / columns + next_uniform(rng);
    *d = camera_ray(s, x, y);
    tally[CAMERA_RAYS]++;
    hit_t hit = nearest(s, view3(s->view->eye), *d);
    if (hit.triangle >= 0) tally[HITS]++;
    return hit;
}

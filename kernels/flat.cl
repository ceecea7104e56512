// Pictures by flat walks, one kernel from camera to light (the document's section 4): camera ray, hit, exit drawn, exit
// on the real surface, light there. All wavelengths go through one exit; chromophores count half at its entry and half
// at its exit. Light that skin reflects onto skin is followed: where the ray into the surroundings, or the mirrored one,
// meets the head, the walk starts anew.

// One walk's start: where, seen along which direction, with which share of each wavelength.
typedef struct {
    hit_t hit;
    float3 direction, tint;
    float share[WAVES];
} path_t;

inline float3 color_of(const scene_t *s, const float *share) {
    float3 sum = 0.0f;
    for (int k = 0; k < WAVES; k++) sum += share[k] * view3(s->waves + k * WAVE + 7);
    return sum;
}

// Radiance of what a path sees through the skin; a ray that meets the head becomes the path's next start.
inline float3 scattered(const scene_t *s, const exits_t *exits, path_t *path, const surface_t *here, rng_t *rng,
                        uint *tally) {
    const float3 n = here->smooth, d = path->direction;
    const float seen = fmax(-dot(normalize(here->relief), d), 1e-3f), c = clamp(-dot(n, d), 0.01f, 1.0f);
    float3 t = unit_or(d + c * n - n * dot(n, d + c * n), (float3)(0.0f)), b;
    if (dot(t, t) == 0.0f) across(n, &t, &b);
    b = cross(n, t);
    float2 paths[WAVES];
    float weight[WAVES];
    const float2 place = draw_exit(s, exits, c, rng, paths, weight);
    const surface_t there = exit_at(s, here, place.x * (t * cos(place.y) + b * sin(place.y)), tally);
    path->tint *= here->detail * exit_factor(s, seen, here->rough);
    for (int k = 0; k < WAVES; k++) {
        float2 rate = 0.5f * (absorption(s, k, here->skin) + absorption(s, k, there.skin));
        path->share[k] *= ENTRY * weight[k] * exp(-dot(rate, paths[k]));
    }
    const float3 color = path->tint * color_of(s, path->share);
    float3 light = color * sunlight(s, &there, toward_sun(s, rng), tally + SUN_RAYS);
    path->hit.triangle = -1;
    if (s->view->environment > 0.0f) {
        float enters;
        path->direction = toward_surroundings(s, &there, rng, &enters);
        tally[SKY_RAYS]++;
        path->hit = nearest(s, start(&there), path->direction);
        if (path->hit.triangle < 0) light += color * enters * surroundings(s, path->direction);
        path->tint *= enters;
    }
    return light;
}

// Radiance that the surface reflects toward -d; a mirrored ray that meets the head becomes another path.
inline float3 reflected(const scene_t *s, const surface_t *here, float3 d, path_t *mirrored, rng_t *rng, uint *tally) {
    const float3 n = normalize(here->relief), v = -d, sun = toward_sun(s, rng);
    float3 light = 0.0f;
    mirrored->hit.triangle = -1;
    if (here->gloss <= 0.0f) return light;
    if (s->view->sunny && dot(n, sun) > 0.0f && dot(here->smooth, sun) > 0.0f) {
        tally[SUN_RAYS]++;
        if (!shaded(s, start(here), sun)) light = view3(s->view->sun_color) * lobes(s, here, n, v, sun);
    }
    float weight = 0.0f;
    mirrored->direction = toward_reflection(s, here, n, v, rng, &weight);
    if (s->view->environment > 0.0f && weight > 0.0f) {
        tally[SKY_RAYS]++;
        mirrored->hit = nearest(s, start(here), mirrored->direction);
        if (mirrored->hit.triangle < 0) light += weight * surroundings(s, mirrored->direction);
        mirrored->tint = here->gloss * weight;
        for (int k = 0; k < WAVES; k++) mirrored->share[k] = 1.0f;
    }
    return here->gloss * light;
}

// Radiance of one camera ray that met the head.
inline float3 radiance(const scene_t *s, const exits_t *exits, hit_t hit, float3 d, rng_t *rng, uint *tally) {
    surface_t here = surface_at(s, hit);
    if (dot(here.geometric, d) > 0.0f) tally[BACKS]++;
    path_t path = {hit, d, 1.0f, {0}}, mirrored;
    for (int k = 0; k < WAVES; k++) path.share[k] = 1.0f;
    float3 light = reflected(s, &here, d, &mirrored, rng, tally);
    for (int bounce = 0;; bounce++) {
        light += scattered(s, exits, &path, &here, rng, tally);
        if (path.hit.triangle < 0 || bounce >= s->view->bounces) {
            if (mirrored.hit.triangle < 0 || !s->view->bounces) return light;
            path = mirrored;
            mirrored.hit.triangle = -1;
            bounce = 0;
        }
        tally[BOUNCES]++;
        here = surface_at(s, path.hit);
    }
}

// Samples of pixels, added to their moments one by one. Work-item i takes PIXELS pixels from begin + i PIXELS on; random
// streams belong to pixel and sample, so launches may be cut anywhere.
__kernel void flat(SCENE, EXITS, uint begin, uint end, uint first_sample, uint samples, __global float *moments,
                   __global uint *tallies) {
    const scene_t scene = SCENE_HERE, *s = &scene;
    const exits_t exits = EXITS_HERE;
    uint tally[TALLIES] = {0};
    const uint from = begin + get_global_id(0) * PIXELS, to = min(from + PIXELS, end);
    for (uint pixel = from; pixel < to; pixel++) {
        float sums[MOMENTS];
        for (int m = 0; m < MOMENTS; m++) sums[m] = moments[pixel * MOMENTS + m];
        for (uint i = first_sample; i < first_sample + samples; i++) {
            rng_t rng = start_streams(s->view->seed, pixel, i);
            float x = pixel % s->view->columns + next_uniform(&rng), y = pixel / s->view->columns + next_uniform(&rng);
            float3 d = camera_ray(s, x, y);
            tally[CAMERA_RAYS]++;
            hit_t hit = nearest(s, view3(s->view->eye), d);
            if (hit.triangle < 0) continue;
            tally[HITS]++;
            add_sample(sums, radiance(s, &exits, hit, d, &rng, tally), tally);
        }
        for (int m = 0; m < MOMENTS; m++) moments[pixel * MOMENTS + m] = sums[m];
    }
    for (int i = 0; i < TALLIES; i++) tallies[get_global_id(0) * TALLIES + i] += tally[i];
}

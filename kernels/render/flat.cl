// Pictures by flat walks, one kernel from camera to light (Zhang, Human face rendering, section 4): camera ray, hit, exit
// drawn, exit on the real surface, light there. All wavelengths go through one exit; chromophores count half at its
// entry and half at its exit.

// Radiance of what is seen through the skin from a start whose shares by wavelength are given; both become the next's.
inline float3 scattered(const scene_t *s, const exits_t *exits, const surface_t *here, start_t *path, float *share,
                        float how_far, rng_t *rng, uint *tally) {
    const float3 n = here->smooth, t = way_along(n, path->direction), b = cross(n, t);
    int row;
    const float2 place = draw_place(exits, seen_cosine(n, path->direction), how_far, rng, &row);
    const float which = next_uniform(rng);
    const surface_t there = exit_at(s, here, place.x * (t * cos(place.y) + b * sin(place.y)), tally);
    path->tint *= shown(s, here, path->direction);
    float3 color = 0.0f;
    for (int k = 0; k < WAVES; k++) {
        float2 rate = 0.5f * (absorption(s, k, here->skin) + absorption(s, k, there.skin));
        share[k] *= ENTRY * carried(exits, row, k, which, rate);
        color += share[k] * color_weight(s, k);
    }
    return gathered(s, &there, path->tint * color, path, rng, tally);
}

// Radiance of one camera ray that met the head.
inline float3 radiance(const scene_t *s, const exits_t *exits, hit_t hit, float3 d, float how_far, rng_t *rng,
                       uint *tally) {
    surface_t here = surface_at(s, hit);
    if (dot(here.geometric, d) > 0.0f) tally[BACKS]++;
    start_t path = {hit, d, 1.0f}, mirrored;
    float share[WAVES];
    for (int k = 0; k < WAVES; k++) share[k] = 1.0f;
    float3 light = reflected(s, &here, d, &mirrored, rng, tally);
    for (int bounce = 0;; bounce++) {
        light += scattered(s, exits, &here, &path, share, bounce ? next_uniform(rng) : how_far, rng, tally);
        if (path.hit.triangle < 0 || bounce >= s->view->bounces) {
            if (mirrored.hit.triangle < 0 || !s->view->bounces) return light;
            path = mirrored;
            mirrored.hit.triangle = -1;
            for (int k = 0; k < WAVES; k++) share[k] = 1.0f;
            bounce = 0;
        }
        tally[BOUNCES]++;
        here = surface_at(s, path.hit);
        start_t unseen;
        float3 color = 0.0f;
        for (int k = 0; k < WAVES; k++) color += share[k] * color_weight(s, k);
        light += path.tint * color * reflected(s, &here, path.direction, &unseen, rng, tally);
    }
}

// Samples of pixels, added to their moments GROUP by GROUP: the walks of a group go evenly near and far. Near ones are
// blue and far ones red, so that a pixel of independent walks would be a colored noise. Work-item i takes PIXELS pixels from begin + i PIXELS on; random
// streams belong to pixel and group, so launches may be cut anywhere.
__kernel void flat(SCENE, EXITS, uint begin, uint end, uint first_sample, uint samples, __global float *moments,
                   __global uint *tallies) {
    const scene_t scene = SCENE_HERE, *s = &scene;
    const exits_t exits = EXITS_HERE;
    uint tally[TALLIES] = {0};
    const uint from = begin + get_global_id(0) * PIXELS, to = min(from + PIXELS, end);
    for (uint pixel = from; pixel < to; pixel++) {
        for (uint i = first_sample; i < first_sample + samples; i += GROUP) {
            rng_t rng = stream(s, pixel, i, 0);
            const float how_far = next_uniform(&rng);
            float3 light = 0.0f, d;
            uint hits = 0;
            for (uint j = 0; j < GROUP; j++) {
                hit_t hit = aimed(s, pixel, &rng, &d, tally);
                if (hit.triangle < 0) continue;
                hits++;
                light += radiance(s, &exits, hit, d, (j + how_far) * (1.0f / GROUP), &rng, tally);
            }
            if (hits)
                add_sample(moments + pixel * MOMENTS, light * (1.0f / GROUP), hits * (1.0f / GROUP), tally);
        }
    }
    for (int i = 0; i < TALLIES; i++) tallies[get_global_id(0) * TALLIES + i] += tally[i];
}

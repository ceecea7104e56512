// Pictures in stages over a queue: camera rays fill it with entries (`aim`), a walk of any kind turns entries into exits,
// `gather` adds the light at the exits and fills the places of walks that go on, from skin to skin, with their next
// entry; in the end `settle` adds each pixel's samples to its moments. A sample has one wavelength; WAVES in a row have
// all of them and make one estimate. Structs: lutgen/render/sample_queue.py.
#define EMPTY 0xffffffffu

inline void put3(__global float *to, float3 v) {
    to[0] = v.x;
    to[1] = v.y;
    to[2] = v.z;
}

// Queue the walk that a start begins: its light enters the skin there, refracted.
inline void enter(const scene_t *s, const surface_t *here, const start_t *from, uint slot, __global entry_t *entry,
                  __global sample_t *sample) {
    const float3 n = here->smooth, d = from->direction;
    const float c = seen_cosine(n, d), sine = sqrt(1.0f - c * c) * SINE_INSIDE;
    put3(entry->position, here->position);
    put3(entry->normal, n);
    put3(entry->direction, way_along(n, d) * sine - n * sqrt(1.0f - sine * sine));
    entry->wavelength = sample->wavelength;
    entry->sample = slot;
    sample->triangle = from->hit.triangle;
    sample->u = from->hit.u;
    sample->v = from->hit.v;
    put3(sample->skin, here->skin);
    put3(sample->tint, from->tint * shown(s, here, d));
}

// The places of a work-item: those of the samples of PIXELS pixels.
#define EACH_PLACE(slot) \
    for (uint item = get_global_id(0), slot = item * PIXELS * samples, \
         stop = min((item + 1u) * PIXELS, end - begin) * samples; slot < stop; slot++)

// Camera rays for the samples first ... first + samples - 1 of pixels begin ... end - 1.
__kernel void aim(SCENE, uint begin, uint end, uint first, uint samples, __global entry_t *entries,
                  __global sample_t *queue, __global uint *tallies) {
    const scene_t scene = SCENE_HERE, *s = &scene;
    uint tally[TALLIES] = {0};
    EACH_PLACE(slot) {
        const uint pixel = begin + slot / samples, number = first + slot % samples;
        __global sample_t *sample = queue + slot;
        rng_t rng = stream(s, pixel, number, 0);
        start_t from = {{-1, 0, 0, 0}, 0.0f, 1.0f}, mirrored = from;
        float3 light = 0.0f;
        sample->wavelength = number % WAVES;
        sample->share = WAVES;
        sample->bounces = 0;
        entries[slot].sample = EMPTY;
        from.hit = aimed(s, pixel, &rng, &from.direction, tally);
        sample->hit = from.hit.triangle >= 0;
        if (sample->hit) {
            const surface_t here = surface_at(s, from.hit);
            if (dot(here.geometric, from.direction) > 0.0f) tally[BACKS]++;
            light = reflected(s, &here, from.direction, &mirrored, &rng, tally);
            enter(s, &here, &from, slot, entries + slot, sample);
        }
        put3(sample->light, light);
        sample->mirrored_triangle = s->view->bounces ? mirrored.hit.triangle : -1;
        sample->mirrored_u = mirrored.hit.u;
        sample->mirrored_v = mirrored.hit.v;
        put3(sample->mirrored_direction, mirrored.direction);
        put3(sample->mirrored_tint, mirrored.tint);
    }
    for (int i = 0; i < TALLIES; i++) tallies[get_global_id(0) * TALLIES + i] += tally[i];
}

// The real surface at an exit. FLAT: from the offset along the entry's tangent plane; else the exit lies on the surface
// but for what a grid rounds off, so the triangle is looked for within NEAR_MM of it (misses leave where they entered).
inline surface_t left_at(const scene_t *s, const surface_t *here, float3 p, float3 n, uint *tally) {
#ifdef FLAT
    return exit_at(s, here, p - here->position, tally);
#else
    tally[PROBES]++;
    hit_t hit = trace(p + NEAR_MM * n, -n, 0.0f, 2.0f * NEAR_MM, false, TREE_OF(s));
    if (hit.triangle < 0) {
        tally[MISSES]++;
        return *here;
    }
    surface_t there = skin_at(s, hit, false);
    if (dot(there.smooth, n) > 0.0f) return there;
    tally[REJECTED]++;
    return *here;
#endif
}

// Light at the exits of a round; `waiting` counts the walks that go on, by work-item.
__kernel void gather(SCENE, uint begin, uint end, uint first, uint samples, uint round, __global entry_t *entries,
                     __global const exit_t *exits, __global sample_t *queue, __global uint *tallies,
                     __global uint *waiting) {
    const scene_t scene = SCENE_HERE, *s = &scene;
    uint tally[TALLIES] = {0}, go_on = 0;
    EACH_PLACE(slot) {
        __global entry_t *entry = entries + slot;
        __global sample_t *sample = queue + slot;
        if (entry->sample == EMPTY) continue;
        __global const exit_t *left = exits + slot;
        const hit_t hit = {sample->triangle, 0.0f, sample->u, sample->v};
        start_t next = {{-1, 0, 0, 0}, 0.0f, view3(sample->tint)};
        rng_t rng = stream(s, begin + slot / samples, first + slot % samples, round + 1);
        entry->sample = EMPTY;
        if (left->path_dermis_mm >= 0.0f) {
            const surface_t here = surface_at(s, hit);
            const surface_t there = left_at(s, &here, view3(left->position), view3(left->normal), tally);
            const int k = sample->wavelength;
            float2 rate = 0.5f * (absorption(s, k, view3(sample->skin)) + absorption(s, k, there.skin));
            float length = rate.x * left->path_epidermis_mm + rate.y * left->path_dermis_mm;
            sample->share *= ENTRY * exp_lanes(-fmax(length, 0.0f));
            float3 light = gathered(s, &there, next.tint * (sample->share * color_weight(s, k)), &next, &rng, tally);
            put3(sample->light, view3(sample->light) + light);
        }
        if (next.hit.triangle < 0 || sample->bounces >= s->view->bounces) {
            if (sample->mirrored_triangle < 0) continue;
            next.hit.triangle = sample->mirrored_triangle;
            next.hit.u = sample->mirrored_u;
            next.hit.v = sample->mirrored_v;
            next.direction = view3(sample->mirrored_direction);
            next.tint = view3(sample->mirrored_tint);
            sample->mirrored_triangle = -1;
            sample->share = WAVES;
            sample->bounces = 0;
        }
        sample->bounces++;
        tally[BOUNCES]++;
        go_on++;
        const surface_t again = surface_at(s, next.hit);
        start_t unseen;
        float3 color = next.tint * (sample->share * color_weight(s, sample->wavelength));
        put3(sample->light, view3(sample->light) + color * reflected(s, &again, next.direction, &unseen, &rng, tally));
        enter(s, &again, &next, slot, entry, sample);
    }
    waiting[get_global_id(0)] = go_on;
    for (int i = 0; i < TALLIES; i++) tallies[get_global_id(0) * TALLIES + i] += tally[i];
}

// Adds the samples of each pixel, WAVES at a time, to its moments.
__kernel void settle(uint begin, uint end, uint samples, __global const sample_t *queue, __global float *moments,
                     __global uint *tallies) {
    uint tally[TALLIES] = {0};
    float3 light = 0.0f;
    float hits = 0.0f;
    EACH_PLACE(slot) {
        light += view3(queue[slot].light);
        hits += queue[slot].hit;
        if ((slot + 1) % WAVES) continue;
        if (hits > 0.0f)
            add_sample(moments + (begin + slot / samples) * MOMENTS, light / WAVES, hits / WAVES, tally);
        light = 0.0f;
        hits = 0.0f;
    }
    for (int i = 0; i < TALLIES; i++) tallies[get_global_id(0) * TALLIES + i] += tally[i];
}

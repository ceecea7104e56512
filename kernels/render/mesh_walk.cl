// The walk inside a mesh, over a queue of entries: W photons in lock step under the surface that depth.cl describes. In
// the frame of its anchor (anchors.cl) a lane's step is path_table.cl's. It is cut where it would leave the sphere around
// the anchor; there the lane gets a new anchor and, steps being exponential, draws a new step. New anchors cost more than
// a step for few lanes as for many: lanes wait for each other.
#define BATCH min(6u, (uint)(W + 1) / 2u)
enum { X, Y, Z, UX, UY, UZ, MIDDLE, ROOM, LIVES, PATH, PATH_E, FIELDS };

// Starts lane i at an entry; false where the surface does not lie there.
inline bool enter(float (*lanes)[W], float (*anchors)[W], uint i, __global const entry_t *entry, GRID) {
    float3 p = vload3(0, entry->position), d = vload3(0, entry->direction), t, b;
    const float3 normal = onto_surface(&p, 4, GRID_ARGUMENTS);
    if (dot(normal, normal) == 0.0f) return false;
    const float out = fmax(dot(d, normal), 0.0f);  // where the picture's normal is not the grid's
    d -= 2.0f * out * normal;
    across(normal, &t, &b);
    put_lane3(anchors, AT, i, p);
    put_lane3(anchors, T, i, t);
    put_lane3(anchors, B, i, b);
    put_lane3(anchors, NORMAL, i, normal);
    put_lane3(lanes, X, i, 0.0f);
    put_lane3(lanes, UX, i, (float3)(dot(d, t), dot(d, b), -dot(d, normal)));
    lanes[MIDDLE][i] = 0.0f;
    lanes[ROOM][i] = LEAST_TRUST * LEAST_TRUST;
    return true;
}

// Lets a photon leave at x, y of a lane's plane.
inline void leave(const float (*anchors)[W], uint i, float x, float y, float3 u, float middle, float n, float path,
                  float path_e, __global exit_t *out, GRID) {
    const float3 t = lane3(anchors, T, i), b = lane3(anchors, B, i), normal = lane3(anchors, NORMAL, i);
    float3 p = lane3(anchors, AT, i) + x * t + y * b + middle * normal;
    onto_surface(&p, 1, GRID_ARGUMENTS);
    put_exit(out, p, refracted_out(u.x * t + u.y * b, normal, n), normal, path, path_e);
}

__kernel void mesh_walk(__global const job_t *jobs, __global const entry_t *entries, __global exit_t *exits,
                        __global result_t *results, GRID) {
    const uint id = get_global_id(0);
    const job_t job = jobs[id];
    const float n = job.n, thickness = job.epidermis_mm, mean_step = 1.0f / job.mu_s, mean_life = 1.0f / job.nu;
    const float critical = sqrt(fmax(1.0f - 1.0f / (n * n), 0.0f));
    const hg_t hg = hg_constants(job.g);

    rng_t rng = start_streams(job.seed, job.wavelength, job.block);
    uint slots[W], taken = 0, running = 0, escaped = 0, entered = 0, lost = 0;
    float lanes[FIELDS][W], anchors[ANCHOR][W];
    for (uint i = 0; i < W; i++) {
        slots[i] = EMPTY;
        for (int row = 0; row < ANCHOR; row++) anchors[row][i] = 0.0f;
    }
    photon_t at = {0, 0, 0, 0, 0, 1, 0, MAXFLOAT};
    vf L = 0, Le = 0, shallow = 0, life = -1.0f;  // all lanes ask for an entry at the first step
    ulong events = 0;

    for (uint step = 0; step < job.max_steps; step++) {
        events += running;
        vf s = exponential(next_bits(&rng), mean_step), random = next_signed(&rng), p, q, h = at.z - at.middle;
        vf cosine = hg_cosine(hg, random, 1.0f / hg_denominator(hg, random));
        uniform_turn(next_bits(&rng), cosine, &p, &q);
        vf along = fma(at.ux, at.x, fma(at.uy, at.y, at.uz * h));
        vf off = at.room - fma(at.x, at.x, fma(at.y, at.y, h * h));
        vf reach = sqrt(GREATER(fma(along, along, off), (vf)(0.0f))) - along;
        vi cut = MASK(reach < s);
        s = LESSER(reach, s);

        const slope_t slope = slope_of(at.uz);
        vi hit = advance(s, slope, thickness, at.ux, at.uy, &at.uz, &at.x, &at.y, &at.z, &L, &Le, &shallow);
        hit &= MASK(slope.steep > critical);
        vi ended = MASK(L > life);
        if (ANY(hit | ended | cut)) {
            vf beyond = at.z * slope.per_depth;
            vi leaves = hit & ~reflects(next_uniform(&rng), slope.steep, n) & MASK(L - beyond <= life);
            ended |= leaves;
            cut &= ~ended;
            const uint left = bits(leaves);
            const uint waiting = popcount(bits(cut));
            events -= waiting;
            if (waiting && waiting >= min(BATCH, running)) {
                vi off_grid = settle(anchors, &at, cut, thickness, GRID_ARGUMENTS);
                lost += popcount(bits(off_grid));
                ended |= off_grid;
                shallow = SELECT(shallow, LESSER(at.z, (vf)(thickness)), cut);
            }
            uint gone = bits(ended);
            if (gone) {
                const vf zero = 0;
                float exit_x[W], exit_y[W];
                STORE(fma(-at.ux, beyond, at.x), exit_x);
                STORE(fma(-at.uy, beyond, at.y), exit_y);
                STORE(L - beyond, lanes[PATH]);
                STORE(fmax(Le - shallow * slope.per_depth, zero), lanes[PATH_E]);
                STORE(SELECT(life, LIFE, ended), lanes[LIVES]);
                STORE(at.x, lanes[X]);
                STORE(at.y, lanes[Y]);
                STORE(at.z, lanes[Z]);
                STORE(at.ux, lanes[UX]);
                STORE(at.uy, lanes[UY]);
                STORE(at.uz, lanes[UZ]);
                STORE(at.middle, lanes[MIDDLE]);
                STORE(at.room, lanes[ROOM]);
                for (; gone; gone &= gone - 1u) {
                    const uint i = lowest_bit(gone);
                    if (slots[i] != EMPTY) {
                        running--;
                        if (left >> i & 1u) {
                            leave(anchors, i, exit_x[i], exit_y[i], lane3(lanes, UX, i), lanes[MIDDLE][i], n,
                                  lanes[PATH][i], lanes[PATH_E][i], exits + slots[i], GRID_ARGUMENTS);
                            escaped++;
                        } else {
                            no_exit(exits + slots[i]);
                        }
                    }
                    while ((slots[i] = next_entry(&job, entries, exits, &taken)) != EMPTY) {
                        entered++;
                        if (enter(lanes, anchors, i, entries + slots[i], GRID_ARGUMENTS)) break;
                        no_exit(exits + slots[i]);
                        lost++;
                    }
                    if (slots[i] != EMPTY) running++;
                    else lanes[Z][i] = lanes[MIDDLE][i] = 1e30f, lanes[ROOM][i] = lanes[LIVES][i] = MAXFLOAT;  // idle
                }
                if (!running) break;
                photon_t now = {LOAD(lanes[X]), LOAD(lanes[Y]), LOAD(lanes[Z]), LOAD(lanes[UX]), LOAD(lanes[UY]),
                                LOAD(lanes[UZ]), LOAD(lanes[MIDDLE]), LOAD(lanes[ROOM])};
                at = now;
                life = LOAD(lanes[LIVES]);
                L = SELECT(L, zero, ended);
                Le = SELECT(Le, zero, ended);
                shallow = SELECT(shallow, zero, ended);
            }
            vi still = ended | cut;
            cosine = SELECT(cosine, (vf)(1.0f), still);
            p = SELECT(p, (vf)(0.0f), still);
            q = SELECT(q, (vf)(0.0f), still);
        }
        turn(&at.ux, &at.uy, &at.uz, cosine, p, q, 1.0f / (1.0f + fabs(at.uz)));
    }
    end_job(&job, entries, exits, slots, &taken, results + id, escaped, entered, events);
    results[id].lost = lost;
}

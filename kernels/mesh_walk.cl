// The walk inside a mesh, over a queue of entries: W photons in lock step under the surface that depth.cl describes.
//
// A lane has an anchor with a frame of its own: z is the depth, x and y lie along the surface. Around it is a sphere
// of square radius `room` in which one of two things holds. Near the surface, it is the plane z = 0. Deep, the sphere
// holds neither surface nor epidermis, and z need only say so. In both a step is path_table.cl's. It is cut where it
// would leave the sphere; there the lane gets a new anchor and, steps being exponential, draws a new step.
// How far from its anchor a plane is the surface, mm: less near the surface, for a photon between a plane and a surface
// that curves away under it would leave too late. With these, a sphere of 2.5 mm radius reflects .3 % too little or less
// of what an epidermis of 5 /mm leaves, one of 10 mm .1 %; with .125 at every depth it is 1.1 % and .3 %.
#ifndef LEAST_TRUST
#define LEAST_TRUST 0.05f
#define MOST_TRUST 0.125f
#endif
#define FLAT_SLOPE 0.25f  // below, the gradient is no normal: between two surfaces, or on the edge of a fold

enum { X, Y, Z, UX, UY, UZ, MIDDLE, ROOM, BEYOND, PATH, PATH_E, BORN, FIELDS };

// Where a lane's anchor lies, and its frame: two vectors along the surface and the outward normal.
typedef struct {
    float3 at, t, b, normal;
} anchor_t;

// Gives lane i an anchor: at p, `depth` mm under a surface of that normal, for a photon with direction d.
inline void put_anchor(float (*lanes)[W], anchor_t *anchor, uint i, float3 p, float3 d, float3 normal, float depth, float room) {
    float3 t, b;
    tangents(normal, &t, &b);
    lanes[X][i] = lanes[Y][i] = 0.0f;
    lanes[Z][i] = lanes[MIDDLE][i] = depth;
    lanes[UX][i] = dot(d, t);
    lanes[UY][i] = dot(d, b);
    lanes[UZ][i] = -dot(d, normal);
    lanes[ROOM][i] = room * room;
    anchor->at = p;
    anchor->t = t;
    anchor->b = b;
    anchor->normal = normal;
}

// Moves lane i's anchor to where it is; false where that is outside of all bricks.
inline bool settle(float (*lanes)[W], anchor_t *anchor, uint i, float epidermis, GRID) {
    const float x = lanes[X][i], y = lanes[Y][i], up = lanes[MIDDLE][i] - lanes[Z][i];
    float3 p = anchor->at + x * anchor->t + y * anchor->b + up * anchor->normal;
    const float4 depth = depth_at(p, GRID_ARGUMENTS);
    const float square = dot(depth.xyz, depth.xyz), inverse = rsqrt(square), trust = clamp(depth.w, LEAST_TRUST, MOST_TRUST);
    const float clear = depth.w - epidermis - (square > 0.0f ? 0.04f * grid->spacing_mm : 0.0f);
    if (clear < trust && square > FLAT_SLOPE * FLAT_SLOPE) {
        const float3 d = lanes[UX][i] * anchor->t + lanes[UY][i] * anchor->b - lanes[UZ][i] * anchor->normal;
        const float3 normal = -inverse * depth.xyz;
        const float under = depth.w * inverse;
        p += fmin(under, 0.0f) * normal;  // where a plane was not quite the surface: back onto it
        put_anchor(lanes, anchor, i, p, d, normal, fmax(under, 0.0f), trust);
    } else {  // any frame will do, as long as it has no surface nearby
        const float room = fmax(clear, trust);
        anchor->at = p;
        lanes[X][i] = lanes[Y][i] = 0.0f;
        lanes[Z][i] = lanes[MIDDLE][i] = epidermis + 2.0f * room;
        lanes[ROOM][i] = room * room;
    }
    return depth.w > 0.5f * OUTSIDE;
}

// Onto the surface from nearby, by Newton's steps; the normal there, or 0 where there is none.
inline float3 onto_surface(float3 *p, int steps, GRID) {
    float3 normal = 0.0f;
    for (int k = 0; k < steps; k++) {
        const float4 depth = depth_at(*p, GRID_ARGUMENTS);
        const float slope = sqrt(dot(depth.xyz, depth.xyz));
        if (slope < FLAT_SLOPE) return 0.0f;
        normal = -depth.xyz / slope;
        *p += depth.w / slope * normal;
    }
    return normal;
}

// Starts lane i at an entry; false where the surface does not lie there.
inline bool enter(float (*lanes)[W], anchor_t *anchor, uint i, __global const entry_t *entry, GRID) {
    float3 p = vload3(0, entry->position), d = vload3(0, entry->direction);
    const float3 normal = onto_surface(&p, 4, GRID_ARGUMENTS);
    if (dot(normal, normal) == 0.0f) return false;
    const float out = dot(d, normal);  // where the picture's normal is not the grid's
    put_anchor(lanes, anchor, i, p, out < 0.0f ? d : d - 2.0f * out * normal, normal, 0.0f, LEAST_TRUST);
    return true;
}

// Lets lane i leave through its plane: its step is taken back to there.
inline void leave(const float (*lanes)[W], const anchor_t *anchor, uint i, float n, __global exit_t *out, GRID) {
    const float3 along = lanes[UX][i] * anchor->t + lanes[UY][i] * anchor->b;
    float3 p = anchor->at + lanes[X][i] * anchor->t + lanes[Y][i] * anchor->b + lanes[MIDDLE][i] * anchor->normal -
               lanes[BEYOND][i] * along;
    onto_surface(&p, 1, GRID_ARGUMENTS);
    put_exit(out, p, refracted_out(along, anchor->normal, n), anchor->normal, lanes[PATH][i], lanes[PATH_E][i]);
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
    float lanes[FIELDS][W], lives[W], paths[W], paths_e[W];
    anchor_t anchors[W];
    for (uint i = 0; i < W; i++) slots[i] = EMPTY;
    vf x = 0, y = 0, z = 0, ux = 0, uy = 0, uz = 1, L = 0, Le = 0, shallow = 0, middle = 0, room = MAXFLOAT;
    vf life = -1.0f;  // all lanes ask for an entry at the first step
    ulong events = 0;

    for (uint step = 0; step < job.max_steps; step++) {
        events += running;
        vf s = exponential(next_bits(&rng), mean_step), cosine, p, q, h = z - middle;
        draw_turn(&rng, hg, &cosine, &p, &q);
        vf along = fma(ux, x, fma(uy, y, uz * h)), off = room - fma(x, x, fma(y, y, h * h));
        vf reach = sqrt(GREATER(fma(along, along, off), (vf)(0.0f))) - along;
        vi cut = MASK(reach < s);
        s = LESSER(reach, s);

        vf steep = GREATER(fabs(uz), (vf)(1e-9f)), around = 1.0f + steep, inverse = 1.0f / (steep * around);
        vf per_depth = inverse * around;
        vf z1 = fma(uz, s, z), clipped = LESSER(GREATER(z1, (vf)(-thickness)), (vf)(thickness));
        L += s;
        x = fma(ux, s, x);
        y = fma(uy, s, y);
        vf in_epidermis = fabs(clipped - shallow) * per_depth;
        Le += LESSER(in_epidermis, s);
        shallow = fabs(clipped);
        z = fabs(z1);
        uz = AS_VF(AS_VU(uz) ^ (AS_VU(z1) & SIGN_BIT));
        vi hit = MASK(z1 < 0.0f) & MASK(steep > critical), ended = MASK(L > life);
        if (ANY(hit | ended | cut)) {
            vf beyond = z * per_depth;
            vi leaves = hit & ~reflects(next_uniform(&rng), steep, n) & MASK(L - beyond <= life);
            ended |= leaves;
            const uint left = bits(leaves), moved = bits(cut & ~ended);
            uint gone = bits(ended);
            events -= popcount(moved);
            if (gone | moved) {
                STORE(x, lanes[X]);
                STORE(y, lanes[Y]);
                STORE(z, lanes[Z]);
                STORE(ux, lanes[UX]);
                STORE(uy, lanes[UY]);
                STORE(uz, lanes[UZ]);
                STORE(middle, lanes[MIDDLE]);
                STORE(room, lanes[ROOM]);
                for (uint set = moved; set; set &= set - 1u) {
                    const uint i = lowest_bit(set);
                    if (!settle(lanes, anchors + i, i, thickness, GRID_ARGUMENTS)) gone |= 1u << i, lost++;
                }
                if (gone) {
                    STORE(beyond, lanes[BEYOND]);
                    STORE(L - beyond, lanes[PATH]);
                    STORE(fmax(Le - shallow * per_depth, (vf)(0.0f)), lanes[PATH_E]);
                    STORE(LIFE, lanes[BORN]);
                    STORE(life, lives);
                    STORE(L, paths);
                    STORE(Le, paths_e);
                    for (; gone; gone &= gone - 1u) {
                        const uint i = lowest_bit(gone);
                        if (slots[i] != EMPTY) {
                            running--;
                            if (left >> i & 1u) leave(lanes, anchors + i, i, n, exits + slots[i], GRID_ARGUMENTS), escaped++;
                            else no_exit(exits + slots[i]);
                        }
                        paths[i] = paths_e[i] = 0.0f;
                        lives[i] = lanes[BORN][i];
                        while ((slots[i] = next_entry(&job, entries, exits, &taken)) != EMPTY) {
                            entered++;
                            if (enter(lanes, anchors + i, i, entries + slots[i], GRID_ARGUMENTS)) break;
                            no_exit(exits + slots[i]);
                            lost++;
                        }
                        if (slots[i] != EMPTY) running++;
                        else lanes[Z][i] = 1e30f, lanes[MIDDLE][i] = 1e30f, lanes[ROOM][i] = lives[i] = MAXFLOAT;  // idle
                    }
                    if (!running) break;
                    L = LOAD(paths);
                    Le = LOAD(paths_e);
                    life = LOAD(lives);
                }
                x = LOAD(lanes[X]);
                y = LOAD(lanes[Y]);
                z = LOAD(lanes[Z]);
                ux = LOAD(lanes[UX]);
                uy = LOAD(lanes[UY]);
                uz = LOAD(lanes[UZ]);
                middle = LOAD(lanes[MIDDLE]);
                room = LOAD(lanes[ROOM]);
                shallow = LESSER(z, (vf)(thickness));
                vi still = ended | cut;
                cosine = SELECT(cosine, (vf)(1.0f), still);
                p = SELECT(p, (vf)(0.0f), still);
                q = SELECT(q, (vf)(0.0f), still);
                inverse = 1.0f / ((1.0f + fabs(uz)) * GREATER(fabs(uz), (vf)(1e-9f)));
                steep = GREATER(fabs(uz), (vf)(1e-9f));
            }
        }
        turn(&ux, &uy, &uz, cosine, p, q, inverse * steep);
    }
    end_job(&job, entries, exits, slots, &taken, results + id, escaped, entered, events);
    results[id].lost = lost;
}

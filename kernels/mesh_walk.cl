// The walk inside a mesh, over a queue of entries: W photons in lock step under the surface that depth.cl describes.
//
// A lane has an anchor, from which its position counts, and a sphere around it of square radius `room` in which one
// of two things holds. Deep: the sphere holds no surface and no epidermis, and the plane is none (normal 0, depth
// FAR). Near the surface: it is the plane with the depth's gradient at the anchor, and the step is path_table.cl's:
// mirrored at the plane, its epidermis path counted on both sides of it. A step is cut where it would leave the
// sphere; there the lane gets a new anchor and, steps being exponential, draws a new one.
#ifndef TRUST
#define TRUST 0.25f  // cells around an anchor in which its plane is the surface
#endif
#define FAR 1e9f
#define FLAT_SLOPE 0.25f  // below, the gradient is no normal: between two surfaces, or on the edge of a fold

enum { X, Y, Z, UX, UY, UZ, NX, NY, NZ, DEPTH, ROOM, BEYOND, PATH, PATH_E, BORN, FIELDS };

inline float3 three(const float (*lanes)[W], int field, uint i) {
    return (float3)(lanes[field][i], lanes[field + 1][i], lanes[field + 2][i]);
}

inline void put_three(float (*lanes)[W], int field, uint i, float3 v) {
    lanes[field][i] = v.x;
    lanes[field + 1][i] = v.y;
    lanes[field + 2][i] = v.z;
}

// An anchor for lane i at p: which of the two holds around it, and how far. False where p is outside of all bricks.
inline bool settle(float (*lanes)[W], float3 *anchors, uint i, float3 p, float epidermis, GRID) {
    const float4 depth = depth_at(p, GRID_ARGUMENTS);
    const float slope = length(depth.xyz), trust = TRUST * grid->spacing_mm;
    const float clear = depth.w - epidermis - (slope > 0.0f ? 0.04f * grid->spacing_mm : 0.0f);
    float3 normal = 0.0f;
    float under = FAR, room = fmax(clear, trust);
    if (clear < trust && slope > FLAT_SLOPE) {
        normal = -depth.xyz / slope;
        under = depth.w / slope;
        room = trust;
        if (under < 0.0f) {  // a plane was not quite the surface: back onto it
            p += under * normal;
            under = 0.0f;
        }
    }
    put_three(lanes, X, i, 0.0f);
    put_three(lanes, NX, i, normal);
    lanes[DEPTH][i] = under;
    lanes[ROOM][i] = room * room;
    anchors[i] = p;
    return depth.w > 0.5f * OUTSIDE;
}

// Onto the surface from nearby, by Newton's steps; the normal there, or 0 where there is none.
inline float3 onto_surface(float3 *p, int steps, GRID) {
    float3 normal = 0.0f;
    for (int k = 0; k < steps; k++) {
        const float4 depth = depth_at(*p, GRID_ARGUMENTS);
        const float slope = length(depth.xyz);
        if (slope < FLAT_SLOPE) return 0.0f;
        normal = -depth.xyz / slope;
        *p += depth.w / slope * normal;
    }
    return normal;
}

// Starts lane i at an entry; false where the surface does not lie there.
inline bool enter(float (*lanes)[W], float3 *anchors, uint i, __global const entry_t *entry, GRID) {
    float3 p = vload3(0, entry->position), d = vload3(0, entry->direction);
    const float3 normal = onto_surface(&p, 4, GRID_ARGUMENTS);
    if (dot(normal, normal) == 0.0f) return false;
    const float down = -dot(d, normal);
    put_three(lanes, UX, i, down > 0.0f ? d : d + 2.0f * down * normal);
    put_three(lanes, X, i, 0.0f);
    put_three(lanes, NX, i, normal);
    lanes[DEPTH][i] = 0.0f;
    lanes[ROOM][i] = TRUST * TRUST * grid->spacing_mm * grid->spacing_mm;
    anchors[i] = p;
    return true;
}

// Lets lane i leave through its plane: its step is taken back to there.
inline void leave(const float (*lanes)[W], const float3 *anchors, uint i, float n, __global exit_t *out, GRID) {
    const float3 u = three(lanes, UX, i), normal = three(lanes, NX, i);
    float3 p = anchors[i] + three(lanes, X, i) - lanes[BEYOND][i] * u;
    const float3 direction = refracted_out(u - dot(u, normal) * normal, normal, n);
    onto_surface(&p, 1, GRID_ARGUMENTS);
    put_exit(out, p, direction, normal, lanes[PATH][i], lanes[PATH_E][i]);
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
    float lanes[FIELDS][W], lives[W];
    float3 anchors[W];
    for (uint i = 0; i < W; i++) slots[i] = EMPTY;
    vf x = 0, y = 0, z = 0, ux = 0, uy = 0, uz = 1, nx = 0, ny = 0, nz = 0, depth = FAR, room = MAXFLOAT;
    vf L = 0, Le = 0, shallow = 0, life = -1.0f;  // all lanes ask for an entry at the first step
    ulong events = 0;

    for (uint step = 0; step < job.max_steps; step++) {
        events += running;
        vf s = exponential(next_bits(&rng), mean_step), cosine, p, q;
        draw_turn(&rng, hg, &cosine, &p, &q);
        vf along = fma(ux, x, fma(uy, y, uz * z)), off = room - fma(x, x, fma(y, y, z * z));
        vf reach = sqrt(GREATER(fma(along, along, off), (vf)(0.0f))) - along;
        vi cut = MASK(reach < s);
        s = LESSER(reach, s);

        vf down = -fma(ux, nx, fma(uy, ny, uz * nz)), steep = GREATER(fabs(down), (vf)(1e-9f));
        vf aside = 1.0f + fabs(uz), inverse = 1.0f / (steep * aside), per_depth = inverse * aside;
        vf under = fma(down, s, depth), clipped = LESSER(GREATER(under, (vf)(-thickness)), (vf)(thickness));
        L += s;
        vf in_epidermis = fabs(clipped - shallow) * per_depth;
        Le += LESSER(in_epidermis, s);
        shallow = fabs(clipped);
        depth = fabs(under);
        vf outside = LESSER(under, (vf)(0.0f)) * 2.0f, turned = SELECT((vf)(0.0f), 2.0f * down, MASK(under < 0.0f));
        x = fma(outside, nx, fma(ux, s, x));
        y = fma(outside, ny, fma(uy, s, y));
        z = fma(outside, nz, fma(uz, s, z));
        ux = fma(turned, nx, ux);
        uy = fma(turned, ny, uy);
        uz = fma(turned, nz, uz);
        inverse = 1.0f / (1.0f + fabs(uz));
        vi hit = MASK(under < 0.0f) & MASK(steep > critical), ended = MASK(L > life);
        if (ANY(hit | ended | cut)) {
            vf beyond = depth * per_depth;
            vi leaves = hit & ~reflects(next_uniform(&rng), steep, n) & MASK(L - beyond <= life);
            ended |= leaves;
            const uint left = bits(leaves), moved = bits(cut & ~ended);
            uint gone = bits(ended);
            events -= popcount(moved);
            if (gone | moved) {
                const vf zero = 0;
                STORE(x, lanes[X]);
                STORE(y, lanes[Y]);
                STORE(z, lanes[Z]);
                STORE(ux, lanes[UX]);
                STORE(uy, lanes[UY]);
                STORE(uz, lanes[UZ]);
                STORE(nx, lanes[NX]);
                STORE(ny, lanes[NY]);
                STORE(nz, lanes[NZ]);
                STORE(depth, lanes[DEPTH]);
                STORE(room, lanes[ROOM]);
                for (uint set = moved; set; set &= set - 1u) {
                    const uint i = lowest_bit(set);
                    if (!settle(lanes, anchors, i, anchors[i] + three(lanes, X, i), thickness, GRID_ARGUMENTS)) {
                        gone |= 1u << i;
                        lost++;
                    }
                }
                if (gone) {
                    STORE(beyond, lanes[BEYOND]);
                    STORE(L - beyond, lanes[PATH]);
                    STORE(fmax(Le - shallow * per_depth, zero), lanes[PATH_E]);
                    STORE(LIFE, lanes[BORN]);
                    STORE(life, lives);
                    float kept[W], kept_e[W];
                    STORE(L, kept);
                    STORE(Le, kept_e);
                    for (; gone; gone &= gone - 1u) {
                        const uint i = lowest_bit(gone);
                        if (slots[i] != EMPTY) {
                            running--;
                            if (left >> i & 1u) {
                                leave(lanes, anchors, i, n, exits + slots[i], GRID_ARGUMENTS);
                                escaped++;
                            } else {
                                no_exit(exits + slots[i]);
                            }
                        }
                        kept[i] = kept_e[i] = 0.0f;
                        lives[i] = lanes[BORN][i];
                        while ((slots[i] = next_entry(&job, entries, exits, &taken)) != EMPTY) {
                            entered++;
                            if (enter(lanes, anchors, i, entries + slots[i], GRID_ARGUMENTS)) break;
                            no_exit(exits + slots[i]);
                            lost++;
                        }
                        if (slots[i] != EMPTY) {
                            running++;
                        } else {  // in the middle of nowhere, with no end of life
                            put_three(lanes, NX, i, 0.0f);
                            lanes[DEPTH][i] = FAR;
                            lanes[ROOM][i] = lives[i] = MAXFLOAT;
                        }
                    }
                    if (!running) break;
                    L = LOAD(kept);
                    Le = LOAD(kept_e);
                    life = LOAD(lives);
                    ux = LOAD(lanes[UX]);
                    uy = LOAD(lanes[UY]);
                    uz = LOAD(lanes[UZ]);
                }
                x = LOAD(lanes[X]);
                y = LOAD(lanes[Y]);
                z = LOAD(lanes[Z]);
                nx = LOAD(lanes[NX]);
                ny = LOAD(lanes[NY]);
                nz = LOAD(lanes[NZ]);
                depth = LOAD(lanes[DEPTH]);
                room = LOAD(lanes[ROOM]);
                shallow = LESSER(depth, (vf)(thickness));
                vi still = ended | cut;
                cosine = SELECT(cosine, (vf)(1.0f), still);
                p = SELECT(p, zero, still);
                q = SELECT(q, zero, still);
            }
        }
        turn(&ux, &uy, &uz, cosine, p, q, inverse);
    }
    end_job(&job, entries, exits, slots, &taken, results + id, escaped, entered, events);
    results[id].lost = lost;
}

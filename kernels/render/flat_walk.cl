// The walk of path_table.cl over a queue of entries: each starts as its entry's direction says, in the frame of its
// normal, under flat skin; what leaves is put back into the world.

__kernel void flat_walk(__global const job_t *jobs, __global const entry_t *entries, __global exit_t *exits,
                        __global result_t *results) {
    const uint id = get_global_id(0);
    const job_t job = jobs[id];
    const float n = job.n, thickness = job.epidermis_mm, mean_step = 1.0f / job.mu_s, mean_life = 1.0f / job.nu;
    const float critical = sqrt(fmax(1.0f - 1.0f / (n * n), 0.0f));
    const hg_t hg = hg_constants(job.g);

    rng_t rng = start_streams(job.seed, job.wavelength, job.block);
    uint slots[W], taken = 0, running = 0, escaped = 0, entered = 0;
    float radius_x[W], radius_y[W], path[W], path_e[W], to_x[W], to_y[W], to_z[W], depths[W], lives[W];
    for (uint i = 0; i < W; i++) slots[i] = EMPTY;
    vf x = 0, y = 0, z = 0, ux = 0, uy = 0, uz = 1, L = 0, Le = 0, shallow = 0;
    vf life = -1.0f;  // all lanes ask for an entry at the first step
    ulong events = 0;

    for (uint step = 0; step < job.max_steps; step++) {
        events += running;
        vf s = exponential(next_bits(&rng), mean_step), random = next_signed(&rng), p, q;
        vf cosine = hg_cosine(hg, random, 1.0f / hg_denominator(hg, random));
        uniform_turn(next_bits(&rng), cosine, &p, &q);
        const slope_t slope = slope_of(uz);
        vi hit = advance(s, slope, thickness, ux, uy, &uz, &x, &y, &z, &L, &Le, &shallow);
        hit &= MASK(slope.steep > critical);
        vi ended = MASK(L > life);
        if (ANY(hit | ended)) {
            vf beyond = z * slope.per_depth;
            vi leaves = hit & ~reflects(next_uniform(&rng), slope.steep, n) & MASK(L - beyond <= life);
            ended |= leaves;
            const uint left = bits(leaves);
            uint gone = bits(ended);
            life = SELECT(life, LIFE, ended);
            if (gone) {
                STORE(fma(-ux, beyond, x), radius_x);
                STORE(fma(-uy, beyond, y), radius_y);
                STORE(L - beyond, path);
                STORE(fmax(Le - shallow * slope.per_depth, (vf)(0.0f)), path_e);
                STORE(ux, to_x);
                STORE(uy, to_y);
                STORE(uz, to_z);
                vf zero = 0;
                STORE(SELECT(z, zero, ended), depths);
                STORE(life, lives);
                for (; gone; gone &= gone - 1u) {
                    const uint i = lowest_bit(gone);
                    uint slot = slots[i];
                    float3 t, b;
                    if (slot != EMPTY) {
                        running--;
                        if (left >> i & 1u) {
                            const float3 normal = vload3(0, entries[slot].normal);
                            across(normal, &t, &b);
                            put_exit(exits + slot, vload3(0, entries[slot].position) + radius_x[i] * t + radius_y[i] * b,
                                     refracted_out(to_x[i] * t + to_y[i] * b, normal, n), normal, path[i], path_e[i]);
                            escaped++;
                        } else {
                            no_exit(exits + slot);
                        }
                    }
                    slots[i] = slot = next_entry(&job, entries, exits, &taken);
                    if (slot != EMPTY) {
                        const float3 normal = vload3(0, entries[slot].normal), d = vload3(0, entries[slot].direction);
                        across(normal, &t, &b);
                        to_x[i] = dot(d, t);
                        to_y[i] = dot(d, b);
                        to_z[i] = fmax(-dot(d, normal), 1e-4f);
                        running++;
                        entered++;
                    } else {  // below all, with no end of life
                        depths[i] = 1e30f;
                        lives[i] = MAXFLOAT;
                        to_x[i] = to_y[i] = 0.0f;
                        to_z[i] = 1.0f;
                    }
                }
                if (!running) break;
                ux = LOAD(to_x);
                uy = LOAD(to_y);
                uz = LOAD(to_z);
                z = LOAD(depths);
                life = LOAD(lives);
                x = SELECT(x, zero, ended);
                y = SELECT(y, zero, ended);
                L = SELECT(L, zero, ended);
                Le = SELECT(Le, zero, ended);
                shallow = SELECT(shallow, zero, ended);
                cosine = SELECT(cosine, (vf)(1.0f), ended);
                p = SELECT(p, zero, ended);
                q = SELECT(q, zero, ended);
            }
        }
        turn(&ux, &uy, &uz, cosine, p, q, slope.inverse);
    }
    end_job(&job, entries, exits, slots, &taken, results + id, escaped, entered, events);
}

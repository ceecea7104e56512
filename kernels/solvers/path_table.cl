// Absorption-free walk of W photons in lock step per work-item, for skin whose two layers scatter and refract alike.
//
// A photon draws its life -ln(u) / nu at launch, nu being the least absorption any allowed skin has at its
// wavelength, and ends when its path exceeds it: no roulette, no truncation, no cost per event. One that leaves
// sooner puts a record in the bank: exit radius, whole path L and path in the epidermis Le, mm. For any skin it
// weighs exp(-(mu_e - nu) Le - (mu_d - nu) (L - Le)) <= 1. With RECORD 4 the cosine of the exit's azimuth follows,
// counted from the way along the surface that oblique light came in with.
//
// At the surface a step is mirrored into the tissue and its epidermis path counted on both sides of it; an escape
// takes the part beyond the surface back. A lane whose photon ended relaunches in place while its block has photons.
//
// Branches that only chance predicts cost the most here. There is one: taken when a lane's photon may leave (hits
// beyond the critical angle are mirrored without it) or has outlived its life. Random numbers and the scattering
// angle come first, so that the processor has them done when it has mispredicted.

#ifndef RECORD
#define RECORD 3
#endif

// Lanes without a photon wait where nothing happens: far below, with no end of life.
inline void park(vf *z, vf *life, uint set) {
    float depths[W], lives[W];
    STORE(*z, depths);
    STORE(*life, lives);
    for (uint i = 0; i < W; i++)
        if (set >> i & 1u) depths[i] = 1e30f, lives[i] = MAXFLOAT;
    *z = LOAD(depths);
    *life = LOAD(lives);
}

__kernel void walk(__global const job_t *jobs, __global float *bank, __global result_t *results) {
    const uint id = get_global_id(0);
    const job_t job = jobs[id];
    const float n = job.n, thickness = job.epidermis_mm, mean_step = 1.0f / job.mu_s, mean_life = 1.0f / job.nu;
    const float critical = sqrt(fmax(1.0f - 1.0f / (n * n), 0.0f));  // at a smaller cosine all is reflected
    const hg_t hg = hg_constants(job.g);
    __global float *out = bank + (ulong)id * (RECORD * BLOCK_PHOTONS);

    rng_t rng = start_streams(job.seed, job.wavelength, job.block);
    uint launched = min((uint)W, job.photons), running = launched, escaped = 0;
    vf x = 0, y = 0, z = 0, ux = job.sine, uy = 0, uz = job.cosine, L = 0, Le = 0, shallow = 0;  // shallow = min(z, thickness)
    vf life = LIFE;
    park(&z, &life, ~0u << launched);
    ulong events = 0;

    for (uint step = 0; running && step < job.max_steps; step++) {
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
            uint left = bits(leaves), gone = bits(ended), count = popcount(gone);
            float radius[W], path[W], path_e[W], azimuth[W];
            vf xo = fma(-ux, beyond, x), yo = fma(-uy, beyond, y);
            vf r = sqrt(xo * xo + yo * yo);
            STORE(r, radius);
            if (RECORD == 4) STORE(xo / GREATER(r, (vf)(1e-20f)), azimuth);
            STORE(L - beyond, path);
            STORE(fmax(Le - shallow * slope.per_depth, (vf)(0.0f)), path_e);
            do {  // without a test before the first lap: if no lane left, the next record overwrites it
                uint i = lowest_bit(left | SIGN_BIT) % W;
                out[RECORD * escaped] = radius[i];
                out[RECORD * escaped + 1] = path[i];
                out[RECORD * escaped + 2] = path_e[i];
                if (RECORD == 4) out[RECORD * escaped + 3] = azimuth[i];
                escaped += left != 0;
                left &= left - 1u;
            } while (left);
            vf zero = 0;
            x = SELECT(x, zero, ended);
            y = SELECT(y, zero, ended);
            z = SELECT(z, zero, ended);
            L = SELECT(L, zero, ended);
            Le = SELECT(Le, zero, ended);
            shallow = SELECT(shallow, zero, ended);
            ux = SELECT(ux, (vf)(job.sine), ended);
            uy = SELECT(uy, zero, ended);
            uz = SELECT(uz, (vf)(job.cosine), ended);
            cosine = SELECT(cosine, (vf)(1.0f), ended);
            p = SELECT(p, zero, ended);
            q = SELECT(q, zero, ended);
            life = SELECT(life, LIFE, ended);
            uint spare = job.photons - launched;
            if (count > spare) {  // the block's last photons: the lanes left over fall idle
                for (uint i = 0; i < spare; i++) gone &= gone - 1u;
                park(&z, &life, gone);
                running -= count - spare;
                count = spare;
            }
            launched += count;
        }
        turn(&ux, &uy, &uz, cosine, p, q, slope.inverse);
    }
    results[id].escaped = escaped;
    results[id].unfinished = running;
    results[id].events = events;
}

// The walk of Zhang, Human face rendering, steps 1 to 5, through LAYERS layers (as MCML: Wang & Jacques 1992), W photons
// in lock step. Each photon carries a weight; ABSORPTION says how it falls:
//   0 albedo      w (1 - mu_a / mu_t) at each event, steps from mu_t: exact in expectation
//   1 continuous  exp(-mu_a s) along the path, steps from mu_s: exact
//   2 mixed       exp(-mu_a s) along the path, steps from mu_t: that document's section 3, too bright
// A step that meets a surface ends there, is reflected or refracted by Fresnel's law, and goes on with what is left of
// it. Weights under the threshold play roulette. A photon that ends leaves a record: exit radius, weight that left
// above, weight that left below, and what each layer took.

#define RECORD (3 + LAYERS)

// The value of a field in each lane's layer; `outside` where the index is in no layer.
#define IN_LAYER(name, index, field, outside)                                            \
    vf name = (outside);                                                                 \
    for (int k = 0; k < LAYERS; k++) name = SELECT(name, (vf)(layers[k].field), MASK((index) == k));

// hg_cosine for a g of its own in each lane; half_inverse_g is 1 / (2 g), or 0 where g is small.
inline vf hg_cosine_lanes(vf g, vf half_inverse_g, vf random) {
    vf s = random * SIGNED_UNIT, sum = fma(g, g, (vf)(1.0f)), w = 1.0f / fma(g, s, (vf)(1.0f));
    vf t = (1.0f - g * g) * w, large = (sum - t * t) * half_inverse_g;
    vf small = fma(s * sum, fma(0.5f * g, s, (vf)(1.0f)), 0.5f * g * (3.0f - g * g)) * w * w;
    vf cosine = SELECT(large, small, MASK(half_inverse_g == 0.0f));
    return LESSER(GREATER(cosine, (vf)(-1.0f)), (vf)(1.0f));
}

__kernel void direct(__global const job_t *jobs, __constant layer_t *layers, __global float *bank,
                     __global result_t *results) {
    const uint id = get_global_id(0);
    const job_t job = jobs[id];
    const float n_top = layers[0].n, specular = (n_top - 1.0f) * (n_top - 1.0f) / ((n_top + 1.0f) * (n_top + 1.0f));
    __global float *out = bank + (ulong)id * (BLOCK_PHOTONS * RECORD);

    rng_t rng = start_streams(job.seed, job.wavelength, job.block);
    uint launched = min((uint)W, job.photons), running = launched;
    int lanes[W];
    for (uint i = 0; i < W; i++) lanes[i] = i < launched ? -1 : 0;
    vi alive = LOAD(lanes), layer = 0;
    vf x = 0, y = 0, z = 0, ux = 0, uy = 0, uz = 1, left = 0, weight = 1.0f - specular, zero = 0;
    vf absorbed[LAYERS];
    for (int k = 0; k < LAYERS; k++) absorbed[k] = 0;
    ulong events = 0;

    for (uint step = 0; running && step < job.max_steps; step++) {
        events += running;
        IN_LAYER(mu_a, layer, mu_a, 0.0f)
        IN_LAYER(mu_s, layer, mu_s, 0.0f)
        IN_LAYER(top, layer, top_mm, 0.0f)
        IN_LAYER(bottom, layer, bottom_mm, 0.0f)
        vf mu = ABSORPTION == 1 ? mu_s : mu_a + mu_s;
        left = SELECT(left, exponential(next_bits(&rng), 1.0f), MASK(left <= 0.0f));

        vi down = MASK(uz > 0.0f);
        vf surface = SELECT(top, bottom, down), steep = GREATER(fabs(uz), (vf)(1e-9f));
        vf reach = fabs(surface - z) / steep, free = left / GREATER(mu, (vf)(1e-20f));
        vi hit = MASK(reach <= free);
        vf s = LESSER(reach, free);
        x = fma(ux, s, x);
        y = fma(uy, s, y);
        z = SELECT(fma(uz, s, z), surface, hit);
        left = SELECT(zero, fma(-s, mu, left), hit);

#if ABSORPTION == 0
        vf taken = SELECT(weight * mu_a / GREATER(mu, (vf)(1e-20f)), zero, hit);
#else
        vf taken = weight - weight * exp_lanes(-mu_a * s);
#endif
        weight -= taken;
        for (int k = 0; k < LAYERS; k++) absorbed[k] += SELECT(zero, taken, MASK(layer == k));

        IN_LAYER(g, layer, g, 0.0f)
        IN_LAYER(half_inverse_g, layer, half_inverse_g, 0.0f)
        vf random = next_signed(&rng), p, q, around = 1.0f + steep;
        vf cosine = hg_cosine_lanes(g, half_inverse_g, random), sine = sqrt(fma(-cosine, cosine, (vf)(1.0f)));
        uniform_azimuth(next_bits(&rng), &p, &q);
        vf vx = ux, vy = uy, vz = uz;
        turn(&vx, &vy, &vz, cosine, sine * p, sine * q, 1.0f / around);

        vi above = 0, below = 0;
        if (bits(hit)) {
            vi next = layer + SELECT((vi)(-1), (vi)(1), down);
            IN_LAYER(n, layer, n, 1.0f)
            IN_LAYER(n_next, next, n, 1.0f)
            vf ratio = n / n_next, sin2 = ratio * ratio * (1.0f - uz * uz), through = sqrt(GREATER(1.0f - sin2, zero));
            vf a = n * steep, b = n_next * through, c = n * through, d = n_next * steep;
            vf rs = (a - b) / (a + b), rp = (d - c) / (d + c);
            vf reflected = SELECT(0.5f * (rs * rs + rp * rp), (vf)(1.0f), MASK(sin2 >= 1.0f));
            vi back = hit & MASK(next_uniform(&rng) <= reflected), pass = hit & ~back;
            uz = SELECT(uz, -uz, back);
            ux = SELECT(ux, ux * ratio, pass);
            uy = SELECT(uy, uy * ratio, pass);
            uz = SELECT(uz, copysign(through, uz), pass);
            layer = SELECT(layer, next, pass);
            above = pass & MASK(layer < 0);
            below = pass & MASK(layer >= LAYERS);
        }
        ux = SELECT(vx, ux, hit);
        uy = SELECT(vy, uy, hit);
        uz = SELECT(vz, uz, hit);

        vi low = alive & ~above & ~below & MASK(weight < job.threshold), ended = above | below;
        if (bits(low)) {
            vi survives = MASK(next_uniform(&rng) <= job.survival);
            weight = SELECT(weight, weight / job.survival, low & survives);
            ended |= low & ~survives;
        }
        ended &= alive;
        uint gone = bits(ended);
        if (gone) {
            float values[RECORD][W];
            STORE(sqrt(x * x + y * y), values[0]);
            STORE(SELECT(zero, weight, above), values[1]);
            STORE(SELECT(zero, weight, below), values[2]);
            for (int k = 0; k < LAYERS; k++) STORE(absorbed[k], values[3 + k]);
            STORE(alive, lanes);
            for (uint rest = gone; rest; rest &= rest - 1u, out += RECORD) {
                uint i = lowest_bit(rest);
                for (int k = 0; k < RECORD; k++) out[k] = values[k][i];
                if (launched < job.photons) launched++;
                else lanes[i] = 0, running--;
            }
            alive = LOAD(lanes);
            x = SELECT(x, zero, ended);
            y = SELECT(y, zero, ended);
            z = SELECT(z, zero, ended);
            ux = SELECT(ux, zero, ended);
            uy = SELECT(uy, zero, ended);
            uz = SELECT(uz, (vf)(1.0f), ended);
            left = SELECT(left, zero, ended);
            weight = SELECT(weight, (vf)(1.0f - specular), ended);
            layer = SELECT(layer, (vi)(0), ended);
            for (int k = 0; k < LAYERS; k++) absorbed[k] = SELECT(absorbed[k], zero, ended);
        }
    }
    results[id].escaped = job.photons - running;
    results[id].unfinished = running;
    results[id].events = events;
}

// The flat walk by drawing: where light that enters leaves the flat skin, and with how much of each wavelength
// (lutgen/render/exits.py).
#define EXITS __global const float *exit_edges, __global const float *exit_sums, __global const float *exit_energy, \
    __global const uint2 *exit_places, __global const half *exit_records
#define EXITS_HERE {exit_edges, exit_sums, exit_energy, exit_places, exit_records}

typedef struct {
    __global const float *edges;    // of rings, mm
    __global const float *sums;     // of the cells' probabilities [angle, cell]
    __global const float *energy;   // over probability [angle, cell, wavelength]
    __global const uint2 *places;   // first record and how many, likewise
    __global const half *records;   // path in epidermis and dermis, mm
} exits_t;

// Weight of each wavelength of light that enters at cosine `c` (in air) and leaves at (radius, azimuth) from the plane of
// incidence: energy over the probability of the place, chromophores and all.
inline float2 draw_exit(const scene_t *s, const exits_t *exits, float c, rng_t *rng, float2 *paths, float *weight) {
    float inside = sqrt(1.0f - (1.0f - c * c) * (1.0f - LEAST_COSINE * LEAST_COSINE));
    float angle = (inside - LEAST_COSINE) * ((ANGLES - 1) / (1.0f - LEAST_COSINE));
    int a = clamp((int)(angle + next_uniform(rng)), 0, ANGLES - 1);  // one of the two around it, by how near it is
    __global const float *sums = exits->sums + a * CELLS;
    float u = next_uniform(rng);
    int low = 0, high = CELLS - 1;
    while (low < high) {
        int middle = (low + high) / 2;
        if (sums[middle] > u) high = middle;
        else low = middle + 1;
    }
    const int ring = low / SECTORS, sector = low % SECTORS, row = (a * CELLS + low) * WAVES;
    const float inner = exits->edges[ring], outer = exits->edges[ring + 1], along = next_uniform(rng);
    float radius = ring ? inner * exp(log(outer / inner) * along) : outer * sqrt(along);
    float azimuth = (sector + next_uniform(rng)) * (M_PI_F / SECTORS), which = next_uniform(rng);
    if (next_bits(rng) & SIGN_BIT) azimuth = -azimuth;
    for (int k = 0; k < WAVES; k++) {
        uint2 place = exits->places[row + k];
        weight[k] = exits->energy[row + k];
        paths[k] = vload_half2(place.x + min((uint)(which * place.y), max(place.y, 1u) - 1u), exits->records);
    }
    return (float2)(radius, azimuth);
}

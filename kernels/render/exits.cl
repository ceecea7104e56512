// The flat walk by drawing: where light that enters leaves the flat skin, and with how much of each wavelength
// (lutgen/render/flat_exits.py).
#define EXITS __global const float *exit_edges, __global const float *exit_sums, __global const float *exit_energy, \
    __global const half *exit_paths
#define EXITS_HERE {exit_edges, exit_sums, exit_energy, exit_paths}

typedef struct {
    __global const float *edges;    // of rings, mm
    __global const float *sums;     // of the cells' probabilities [angle, cell]
    __global const float *energy;   // over probability [angle, cell, wavelength]
    __global const half *paths;     // in epidermis and dermis, mm [angle, cell, QUANTILES, wavelength, 2]
} exits_t;

// Where light leaves that enters at cosine `c` (in air): radius, and azimuth from the plane of incidence. `row`: of its
// angle and cell in the tables; `u` decides about the cell, from near to far.
inline float2 draw_place(const exits_t *exits, float c, float u, rng_t *rng, int *row) {
    float inside = sqrt(1.0f - (1.0f - c * c) * (1.0f - LEAST_COSINE * LEAST_COSINE));
    float angle = (inside - LEAST_COSINE) * ((ANGLES - 1) / (1.0f - LEAST_COSINE));
    int a = clamp((int)(angle + next_uniform(rng)), 0, ANGLES - 1);  // one of the two around it, by how near it is
    __global const float *sums = exits->sums + a * CELLS;
    int low = 0, high = CELLS - 1;
    while (low < high) {
        int middle = (low + high) / 2;
        if (sums[middle] > u) high = middle;
        else low = middle + 1;
    }
    const int ring = low / SECTORS, sector = low % SECTORS;
    *row = (a * CELLS + low) * WAVES;
    const float inner = exits->edges[ring], outer = exits->edges[ring + 1], along = next_uniform(rng);
    float radius = ring ? inner * exp(log(outer / inner) * along) : outer * sqrt(along);
    float azimuth = (sector + next_uniform(rng)) * (M_PI_F / SECTORS);
    return (float2)(radius, next_bits(rng) & SIGN_BIT ? -azimuth : azimuth);
}

// Share of wavelength k that goes that way, over the way's probability: the mean over DRAWS of the cell's paths, evenly
// apart from `which` on among those sorted by length, so that short and long ones are always among them.
inline float carried(const exits_t *exits, int row, int k, float which, float2 rate) {
    float sum = 0.0f;
    for (int i = 0; i < DRAWS; i++) {
        int quantile = min((int)((which + i) * (QUANTILES / (float)DRAWS)), QUANTILES - 1);
        sum += exp_lanes(-fmax(dot(rate, vload_half2(row * QUANTILES + quantile * WAVES + k, exits->paths)), 0.0f));
    }
    return exits->energy[row + k] * (1.0f / DRAWS) * sum;
}

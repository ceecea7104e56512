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

// Share of wavelength k that goes that way, over the way's probability: the mean over DRAWS of the cell's records, evenly
// apart from `which` on among those sorted by length, so that short and long ones are always among them.
inline float carried(const exits_t *exits, int row, int k, float which, float2 rate) {
    const uint2 place = exits->places[row + k];
    float sum = 0.0f;
    for (int i = 0; i < DRAWS; i++) {
        uint record = min((uint)((which + i) * (1.0f / DRAWS) * place.y), max(place.y, 1u) - 1u);
        float2 path = vload_half2(place.x + record, exits->records);
        sum += exp_lanes(-fmax(dot(rate, path), 0.0f));
    }
    return exits->energy[row + k] * (1.0f / DRAWS) * sum;
}

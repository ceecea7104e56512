// What both walks over a queue share (lutgen/render/mesh_walk.py): where the next entry lies, and what leaves.
// A job walks the entries first, first + stride, ... of one wavelength; an exit lies where its entry lay.
#define EMPTY 0xffffffffu

inline void no_exit(__global exit_t *out) { out->path_epidermis_mm = out->path_dermis_mm = -1.0f; }

// The slot of the job's next entry that is not empty, or EMPTY.
inline uint next_entry(const job_t *job, __global const entry_t *entries, __global exit_t *exits, uint *taken) {
    while (*taken < job->photons) {
        const uint slot = job->first + job->stride * (*taken)++;
        if (entries[slot].sample != EMPTY) return slot;
        no_exit(exits + slot);
    }
    return EMPTY;
}

// Refracted into air: the part of a direction along the surface times n, the rest along the outward normal.
inline float3 refracted_out(float3 along, float3 normal, float n) {
    const float3 out = n * along;
    return normalize(out + normal * sqrt(fmax(1.0f - dot(out, out), 0.0f)));
}

inline void put_exit(__global exit_t *out, float3 position, float3 direction, float3 normal, float path, float path_e) {
    vstore3(position, 0, out->position);
    vstore3(direction, 0, out->direction);
    vstore3(normal, 0, out->normal);
    out->path_epidermis_mm = path_e;
    out->path_dermis_mm = fmax(path - path_e, 0.0f);
}

// Marks what the step budget has left unwalked, and reports.
inline void end_job(const job_t *job, __global const entry_t *entries, __global exit_t *exits, const uint *slots,
                    uint *taken, __global result_t *result, uint escaped, uint entered, ulong events) {
    uint unfinished = 0;
    for (uint i = 0; i < W; i++)
        if (slots[i] != EMPTY) no_exit(exits + slots[i]), unfinished++;
    for (uint slot; (slot = next_entry(job, entries, exits, taken)) != EMPTY; unfinished++) no_exit(exits + slot);
    result->escaped = escaped;
    result->unfinished = unfinished;
    result->entered = entered;
    result->events = events;
}

// Reduces the bank to the Laplace table: sums of exp(-a_e Le - a_d Ld) per wavelength, ring and node pair, where
// a = mu - nu at the node. Sums are 64-bit fixed point (weights are at most 1, unit 2^-30), so they neither stagnate
// nor depend on how blocks were grouped into launches. Work-item (row, column): row = wavelength x slice takes every
// SLICES-th block of its wavelength; columns share the dermis nodes.

__kernel void tabulate(__global const float *bank, __global const result_t *results, __global const uint *first_block,
                       __global const float *nodes, __constant float *edges, __global long *sums) {
    const uint row = get_global_id(0), k = row / SLICES;
    const uint block_end = first_block[k + 1];
    __global const float *a_e = nodes + k * (NODES_E + NODES_D), *a_d = a_e + NODES_E;
    __global long *table = sums + (ulong)row * (RINGS * NODES_E * NODES_D);

    for (uint block = first_block[k] + row % SLICES; block < block_end; block += SLICES) {
        __global const float *record = bank + (ulong)block * (3 * BLOCK_PHOTONS);
        for (uint i = 0; i < results[block].escaped; i++, record += 3) {
            const float radius = record[0], Le = record[2], Ld = fmax(record[1] - Le, 0.0f);
            uint ring = 0;
            for (uint jump = RINGS / 2; jump; jump /= 2) ring += radius >= edges[ring + jump] ? jump : 0u;
            float epidermis[NODES_E];
            for (uint e = 0; e < NODES_E; e += W) STORE(exp_lanes(-Le * LOAD(a_e + e)), epidermis + e);
            for (uint j = get_global_id(1) * W; j < NODES_D; j += get_global_size(1) * W) {
                const vf dermis = exp_lanes(-Ld * LOAD(a_d + j)) * 1073741824.0f;
                __global long *cell = table + ring * (NODES_E * NODES_D) + j;
                for (uint e = 0; e < NODES_E; e++, cell += NODES_D)
                    STORE(LOAD(cell) + TO_VL(TO_VI(fma(dermis, (vf)(epidermis[e]), (vf)(0.5f)))), cell);
            }
        }
    }
}

// The device's multiply-add rate, as a yardstick for the walk: chains long enough to hide each other's latency.
__kernel void peak(__global float *out, uint rounds) {
    vf chain[CHAINS];
    for (int i = 0; i < CHAINS; i++) chain[i] = (vf)((float)(get_global_id(0) + i));
    for (uint k = 0; k < rounds; k++) {
#pragma unroll
        for (int i = 0; i < CHAINS; i++) chain[i] = fma(chain[i], (vf)(0.999f), (vf)(1e-3f));
    }
    vf sum = 0;
    for (int i = 0; i < CHAINS; i++) sum += chain[i];
    float lanes[W];
    STORE(sum, lanes);
    for (int i = 0; i < W; i++) out[get_global_id(0)] += lanes[i];
}

// What is kept of a pixel's samples: sums of R, G, B and of hits, and of the products RR, GG, BB, RG, RB, GB, from which
// the host has mean and covariance. A sample that is not finite, or its square, is counted and left out, so no pixel
// becomes NaN.
#define MOMENTS 10

inline void add_sample(__global float *sums, float3 color, float hits, uint *tally) {
    if (!isfinite(dot(color, color))) {
        tally[BROKEN]++;
        color = 0.0f;
    }
    sums[0] += color.x;
    sums[1] += color.y;
    sums[2] += color.z;
    sums[3] += hits;
    sums[4] += color.x * color.x;
    sums[5] += color.y * color.y;
    sums[6] += color.z * color.z;
    sums[7] += color.x * color.y;
    sums[8] += color.x * color.z;
    sums[9] += color.y * color.z;
}

// Rays one by one, for tests and rates: origin and farthest distance, direction; out: t, u, v and triangle.
__kernel void intersect(__global const float8 *rays, __global float4 *found, int any, TREE) {
    const int i = get_global_id(0);
    const float8 ray = rays[i];
    hit_t hit = trace(ray.s012, ray.s456, 0.0f, ray.s3, any != 0, TREE_ARGUMENTS);
    found[i] = (float4)(hit.t, hit.u, hit.v, as_float(hit.triangle));
}

// Two unit vectors across n (Duff et al. 2017).
inline void across(float3 n, float3 *t, float3 *b) {
    float sign = copysign(1.0f, n.z), a = -1.0f / (sign + n.z), c = n.x * n.y * a;
    *t = (float3)(1.0f + sign * n.x * n.x * a, sign * c, -sign * n.x);
    *b = (float3)(c, sign + n.y * n.y * a, -n.y);
}

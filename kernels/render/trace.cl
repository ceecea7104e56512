// A ray against a tree of WIDTH children a node and WIDTH triangles a leaf (lutgen/render/bvh.py): all boxes of a node,
// all triangles of a leaf at once. Nodes are visited nearest first; what lies beyond the nearest hit is dropped.
#define CONCAT_(a, b) a##b
#define CONCAT(a, b) CONCAT_(a, b)
typedef CONCAT(float, WIDTH) wf;
typedef CONCAT(int, WIDTH) wi;
#define WIDE(p) CONCAT(vload, WIDTH)(0, p)
#define KEEP(value, p) CONCAT(vstore, WIDTH)(value, 0, p)

#if WIDTH == 16
#define EACH_BIT ((int16)(1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, 32768))
inline uint all_bits(int16 m) {
    int8 a = m.lo | m.hi;
    int4 b = a.lo | a.hi;
    return b.x | b.y | b.z | b.w;
}
inline float least(float16 v) {
    float8 a = fmin(v.lo, v.hi);
    float4 b = fmin(a.lo, a.hi);
    return fmin(fmin(b.x, b.y), fmin(b.z, b.w));
}
#elif WIDTH == 8
#define EACH_BIT ((int8)(1, 2, 4, 8, 16, 32, 64, 128))
inline uint all_bits(int8 m) {
    int4 a = m.lo | m.hi;
    return a.x | a.y | a.z | a.w;
}
inline float least(float8 v) {
    float4 a = fmin(v.lo, v.hi);
    return fmin(fmin(a.x, a.y), fmin(a.z, a.w));
}
#else
#define EACH_BIT ((int4)(1, 2, 4, 8))
inline uint all_bits(int4 m) { return m.x | m.y | m.z | m.w; }
inline float least(float4 v) { return fmin(fmin(v.x, v.y), fmin(v.z, v.w)); }
#endif
#define SET(mask) all_bits((mask) & EACH_BIT)

inline uint first_bit(uint set) { return 31u - clz(set & (0u - set)); }

#define STACK 96
#define TREE __global const float *restrict boxes, __global const int *restrict children, \
             __global const float *restrict shapes, __global const int *restrict numbers
#define TREE_ARGUMENTS boxes, children, shapes, numbers

// Triangle (-1: none), distance, and where on it: weights of its second and third corner.
typedef struct {
    int triangle;
    float t, u, v;
} hit_t;

// Of the sign that picks a box's near side below: of -0 that is the positive one.
inline float finite_inverse(float x) { return 1.0f / (fabs(x) < 1e-20f ? (x < 0 ? -1e-20f : 1e-20f) : x); }

// Puts the children whose bits are set onto the stack, all but the nearest, which it returns.
inline int nearest_child(__global const int *restrict child, uint set, const float *at, int *stack, float *reach, int *top) {
    uint i = first_bit(set);
    int nearest = child[i];
    float closest = at[i];
    for (set &= set - 1u; set; set &= set - 1u) {
        i = first_bit(set);
        bool swap = at[i] < closest;
        stack[*top] = swap ? nearest : child[i];
        reach[*top] = swap ? closest : at[i];
        nearest = swap ? child[i] : nearest;
        closest = swap ? at[i] : closest;
        *top = min(*top + 1, STACK - 1);
    }
    return nearest;
}

// The nearest hit between two distances, or with `any` set the first that is found (Moller & Trumbore 1997).
inline hit_t trace(float3 o, float3 d, float nearest, float farthest, bool any, TREE) {
    hit_t hit = {-1, farthest, 0.0f, 0.0f};
    const float ix = finite_inverse(d.x), iy = finite_inverse(d.y), iz = finite_inverse(d.z);
    const int x_low = d.x < 0 ? 3 : 0, y_low = d.y < 0 ? 4 : 1, z_low = d.z < 0 ? 5 : 2;
    const int x_high = 3 - x_low, y_high = 5 - y_low, z_high = 7 - z_low;
    int stack[STACK], top = 0, node = 0;
    float reach[STACK], lane[WIDTH];
    while (true) {
        if (node >= 0) {
            __global const float *b = boxes + node * (6 * WIDTH);
            wf enter = fmax(fmax((WIDE(b + x_low * WIDTH) - o.x) * ix, (WIDE(b + y_low * WIDTH) - o.y) * iy),
                            fmax((WIDE(b + z_low * WIDTH) - o.z) * iz, (wf)(nearest)));
            wf leave = fmin(fmin((WIDE(b + x_high * WIDTH) - o.x) * ix, (WIDE(b + y_high * WIDTH) - o.y) * iy),
                            fmin((WIDE(b + z_high * WIDTH) - o.z) * iz, (wf)(hit.t)));
            uint set = SET(enter <= leave * 1.0000004f);  // no ray slips between boxes that touch
            if (set) {
                KEEP(enter, lane);
                node = nearest_child(children + node * WIDTH, set, lane, stack, reach, &top);
                continue;
            }
        } else {
            __global const float *p = shapes + (~node) * (9 * WIDTH);
            wf ax = WIDE(p + 3 * WIDTH), ay = WIDE(p + 4 * WIDTH), az = WIDE(p + 5 * WIDTH);
            wf bx = WIDE(p + 6 * WIDTH), by = WIDE(p + 7 * WIDTH), bz = WIDE(p + 8 * WIDTH);
            wf px = d.y * bz - d.z * by, py = d.z * bx - d.x * bz, pz = d.x * by - d.y * bx;
            wf volume = ax * px + ay * py + az * pz, inverse = 1.0f / volume;
            wf sx = o.x - WIDE(p), sy = o.y - WIDE(p + WIDTH), sz = o.z - WIDE(p + 2 * WIDTH);
            wf u = (sx * px + sy * py + sz * pz) * inverse;
            wf qx = sy * az - sz * ay, qy = sz * ax - sx * az, qz = sx * ay - sy * ax;
            wf v = (d.x * qx + d.y * qy + d.z * qz) * inverse, t = (bx * qx + by * qy + bz * qz) * inverse;
            wi met = (volume != 0.0f) & (u >= -1e-6f) & (v >= -1e-6f) & (u + v <= 1.000001f) & (t > nearest) & (t < hit.t);
            if (SET(met)) {
                wf times = select((wf)(MAXFLOAT), t, met);
                hit.t = least(times);
                uint i = first_bit(SET(times == hit.t));
                KEEP(u, lane);
                hit.u = lane[i];
                KEEP(v, lane);
                hit.v = lane[i];
                hit.triangle = numbers[(~node) * WIDTH + i];
                if (any) return hit;
            }
        }
        do {
            if (top == 0) return hit;
            top--;
        } while (reach[top] > hit.t);
        node = stack[top];
    }
}

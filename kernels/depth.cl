// How deep a point lies under a closed surface (lutgen/render/distance.py). Space is cut into bricks of 8^3 cells. One
// near the surface has a depth at every corner of its cells, in steps of grid.unit_mm, linear along each axis between
// them; of any other only the depth at its middle is known, from which depth falls by 1 mm per mm at most.
#define CELLS 8
#define CORNERS 9
#define GRID __constant const grid_t *restrict grid, __global const float *restrict middles, \
             __global const int *restrict rows, __global const short *restrict values
#define GRID_ARGUMENTS grid, middles, rows, values
#define OUTSIDE -1e9f

inline float between(float a, float b, float share) { return fma(share, b - a, a); }

// Gradient (mm per mm) and depth in mm; where only a lower bound of the depth is known, it and no gradient.
inline float4 depth_at(float3 p, GRID) {
    const float per_mm = grid->per_mm;
    float x = (p.x - grid->origin[0]) * per_mm, y = (p.y - grid->origin[1]) * per_mm, z = (p.z - grid->origin[2]) * per_mm;
    const int i = (int)x, j = (int)y, k = (int)z, nx = grid->bricks[0], ny = grid->bricks[1];
    if (!(x >= 0 && y >= 0 && z >= 0 && i < nx * CELLS && j < ny * CELLS && k < grid->bricks[2] * CELLS))
        return (float4)(0.0f, 0.0f, 0.0f, OUTSIDE);
    const int number = ((k / CELLS) * ny + j / CELLS) * nx + i / CELLS, row = rows[number];
    if (row < 0) {
        x -= i / CELLS * CELLS + 0.5f * CELLS, y -= j / CELLS * CELLS + 0.5f * CELLS, z -= k / CELLS * CELLS + 0.5f * CELLS;
        return (float4)(0.0f, 0.0f, 0.0f, middles[number] - sqrt(x * x + y * y + z * z) * grid->spacing_mm);
    }
    x -= i, y -= j, z -= k;
    __global const short *v = values + (size_t)row * (CORNERS * CORNERS * CORNERS)
                              + ((k % CELLS) * CORNERS + j % CELLS) * CORNERS + i % CELLS;
    const float a = v[0], b = v[CORNERS], c = v[CORNERS * CORNERS], d = v[CORNERS * CORNERS + CORNERS];
    const float ax = v[1] - a, bx = v[CORNERS + 1] - b, cx = v[CORNERS * CORNERS + 1] - c;
    const float dx = v[CORNERS * CORNERS + CORNERS + 1] - d;
    const float a1 = fma(x, ax, a), b1 = fma(x, bx, b), c1 = fma(x, cx, c), d1 = fma(x, dx, d);
    const float near = between(a1, b1, y), far = between(c1, d1, y), slope = grid->unit_mm * per_mm;
    return (float4)(slope * between(between(ax, bx, y), between(cx, dx, y), z), slope * between(b1 - a1, d1 - c1, z),
                    slope * (far - near), grid->unit_mm * between(near, far, z));
}

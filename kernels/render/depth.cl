// How deep a point lies under a closed surface (lutgen/render/distance.py). Space is cut into bricks of 8^3 cells. One
// near the surface has a depth at every corner of its cells, in steps of grid.unit_mm, linear along each axis between
// them; of any other only the depth at its middle is known, from which depth falls by 1 mm per mm at most.
#define CELLS 8
#define CORNERS 9
#define GRID __constant const grid_t *restrict grid, __global const float *restrict middles, \
             __global const int *restrict rows, __global const short *restrict values
#define GRID_ARGUMENTS grid, middles, rows, values
#define OUTSIDE -1e9f

// Depths at the corners of the cell (i, j, k) that the place (x, y, z) in cells lies in, `stride` apart. Where only a
// lower bound of the depth is known, it at all corners, so that there is no gradient.
inline void cell_depths(int i, int j, int k, float x, float y, float z, float *out, int stride, GRID) {
    const uint nx = grid->bricks[0], ny = grid->bricks[1];
    const uint bx = (uint)i / CELLS, by = (uint)j / CELLS, bz = (uint)k / CELLS;  // huge where negative
    float bound = OUTSIDE;
    if (bx < nx && by < ny && bz < (uint)grid->bricks[2]) {
        const uint number = (bz * ny + by) * nx + bx;
        const int row = rows[number];
        if (row >= 0) {
            const float unit = grid->unit_mm;
            __global const short *v = values + (size_t)row * (CORNERS * CORNERS * CORNERS) +
                                      ((k % CELLS) * CORNERS + j % CELLS) * CORNERS + i % CELLS;
            for (int c = 0; c < 8; c++)
                out[c * stride] = unit * v[(c >> 2) * CORNERS * CORNERS + (c >> 1 & 1) * CORNERS + (c & 1)];
            return;
        }
        x -= bx * CELLS + 0.5f * CELLS, y -= by * CELLS + 0.5f * CELLS, z -= bz * CELLS + 0.5f * CELLS;
        bound = middles[number] - sqrt(x * x + y * y + z * z) * grid->spacing_mm;
    }
    for (int c = 0; c < 8; c++) out[c * stride] = bound;
}

// Depth, and its gradient times a cell's width, between a cell's corners at (x, y, z) of its sides.
#define BETWEEN(a, b, share) fma(share, (b) - (a), a)
#define INTERPOLATE(REAL, CORNER, x, y, z, depth, rise_x, rise_y, rise_z)                                        \
    {                                                                                                            \
        const REAL a = BETWEEN(CORNER(0), CORNER(1), x), b = BETWEEN(CORNER(2), CORNER(3), x);                   \
        const REAL c = BETWEEN(CORNER(4), CORNER(5), x), d = BETWEEN(CORNER(6), CORNER(7), x);                   \
        const REAL near = BETWEEN(a, b, y), far = BETWEEN(c, d, y);                                              \
        depth = BETWEEN(near, far, z);                                                                           \
        rise_x = BETWEEN(BETWEEN(CORNER(1) - CORNER(0), CORNER(3) - CORNER(2), y),                               \
                         BETWEEN(CORNER(5) - CORNER(4), CORNER(7) - CORNER(6), y), z);                           \
        rise_y = BETWEEN(b - a, d - c, z);                                                                       \
        rise_z = far - near;                                                                                     \
    }

// Gradient (mm per mm) and depth in mm; where only a lower bound of the depth is known, it and no gradient.
inline float4 depth_at(float3 p, GRID) {
    const float3 at = (p - vload3(0, grid->origin)) * grid->per_mm;
    const int i = (int)floor(at.x), j = (int)floor(at.y), k = (int)floor(at.z);
    float corner[8], depth, x, y, z;
    cell_depths(i, j, k, at.x, at.y, at.z, corner, 1, GRID_ARGUMENTS);
#define CORNER(c) corner[c]
    INTERPOLATE(float, CORNER, at.x - i, at.y - j, at.z - k, depth, x, y, z)
#undef CORNER
    return (float4)((float3)(x, y, z) * grid->per_mm, depth);
}

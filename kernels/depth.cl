// How deep a point lies under a closed surface (lutgen/render/distance.py). Space is cut into bricks of CELLS^3 cells.
// One near the surface has a depth at every corner of its cells, in steps of grid.unit mm, between which it is linear
// along each axis; of any other only the depth at its middle is known, from which depth falls by 1 mm per mm at most.
#define CORNERS (CELLS + 1)
#define GRID __constant const grid_t *restrict grid, __global const float *restrict middles, \
             __global const int *restrict rows, __global const short *restrict values
#define GRID_ARGUMENTS grid, middles, rows, values
#define OUTSIDE -1e9f

// Gradient (mm per mm) and depth in mm; where only a lower bound of the depth is known, it and no gradient.
inline float4 depth_at(float3 p, GRID) {
    const float3 at = (p - vload3(0, grid->origin)) * grid->per_mm;  // in cells
    const int3 last = vload3(0, grid->bricks) - 1, brick = convert_int3_rtn(at * (1.0f / CELLS));
    if (any(brick < 0) || any(brick > last)) return (float4)(0.0f, 0.0f, 0.0f, OUTSIDE);
    const int number = (brick.z * grid->bricks[1] + brick.y) * grid->bricks[0] + brick.x, row = rows[number];
    float3 inside = at - convert_float3(brick * CELLS);
    if (row < 0)
        return (float4)(0.0f, 0.0f, 0.0f, middles[number] - length(inside - 0.5f * CELLS) * grid->spacing_mm);
    const int3 cell = min(convert_int3(inside), CELLS - 1);
    inside -= convert_float3(cell);
    __global const short *v = values + (size_t)row * (CORNERS * CORNERS * CORNERS) + (cell.z * CORNERS + cell.y) * CORNERS + cell.x;
    const float2 a = convert_float2(vload2(0, v)), b = convert_float2(vload2(0, v + CORNERS));
    v += CORNERS * CORNERS;
    const float2 c = convert_float2(vload2(0, v)), d = convert_float2(vload2(0, v + CORNERS));
    const float2 near = mix(a, b, inside.y), far = mix(c, d, inside.y), across = mix(near, far, inside.z);
    const float2 along_y = mix(b - a, d - c, inside.z), along_z = far - near;
    const float slope = grid->unit_mm * grid->per_mm;
    return (float4)(slope * (across.y - across.x), slope * mix(along_y.x, along_y.y, inside.x),
                    slope * mix(along_z.x, along_z.y, inside.x), grid->unit_mm * mix(across.x, across.y, inside.x));
}

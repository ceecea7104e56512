// Depths under a closed mesh from its tree (trace.cl): distance to the nearest triangle, positive inside.

// The square of the distance from p to the nearest triangle, or `best` where none is nearer (Ericson 2005, 5.1.5: to
// the plane where the foot lies in the triangle, else to the nearest of the edges).
inline float nearest_square(float3 p, float best, TREE) {
    int stack[STACK], top = 0, node = 0;
    float reach[STACK], lane[WIDTH];
    while (true) {
        if (node >= 0) {
            __global const float *b = boxes + node * (6 * WIDTH);
            wf x = fmax(fmax(WIDE(b) - p.x, p.x - WIDE(b + 3 * WIDTH)), (wf)(0.0f));
            wf y = fmax(fmax(WIDE(b + WIDTH) - p.y, p.y - WIDE(b + 4 * WIDTH)), (wf)(0.0f));
            wf z = fmax(fmax(WIDE(b + 2 * WIDTH) - p.z, p.z - WIDE(b + 5 * WIDTH)), (wf)(0.0f));
            wf square = x * x + y * y + z * z;
            uint set = SET(square < best);
            if (set) {
                KEEP(square, lane);
                node = nearest_child(children + node * WIDTH, set, lane, stack, reach, &top);
                continue;
            }
        } else {
            __global const float *t = shapes + (~node) * (9 * WIDTH);
            wf ax = WIDE(t + 3 * WIDTH), ay = WIDE(t + 4 * WIDTH), az = WIDE(t + 5 * WIDTH);
            wf bx = WIDE(t + 6 * WIDTH), by = WIDE(t + 7 * WIDTH), bz = WIDE(t + 8 * WIDTH);
            wf px = p.x - WIDE(t), py = p.y - WIDE(t + WIDTH), pz = p.z - WIDE(t + 2 * WIDTH);
            wf aa = ax * ax + ay * ay + az * az, ab = ax * bx + ay * by + az * bz, bb = bx * bx + by * by + bz * bz;
            wf pa = px * ax + py * ay + pz * az, pb = px * bx + py * by + pz * bz;
            wf area = aa * bb - ab * ab, u = pa * bb - pb * ab, v = pb * aa - pa * ab;
            wf nx = ay * bz - az * by, ny = az * bx - ax * bz, nz = ax * by - ay * bx;
            wf height = px * nx + py * ny + pz * nz, over = height * height / fmax(nx * nx + ny * ny + nz * nz, (wf)(1e-30f));
            wf f = clamp(pa / fmax(aa, (wf)(1e-30f)), 0.0f, 1.0f), g = clamp(pb / fmax(bb, (wf)(1e-30f)), 0.0f, 1.0f);
            wf h = clamp((pb - pa - ab + aa) / fmax(aa + bb - 2.0f * ab, (wf)(1e-30f)), 0.0f, 1.0f);
            wf ex = px - f * ax, ey = py - f * ay, ez = pz - f * az, edge = ex * ex + ey * ey + ez * ez;
            ex = px - g * bx, ey = py - g * by, ez = pz - g * bz;
            edge = fmin(edge, ex * ex + ey * ey + ez * ez);
            ex = px - ax - h * (bx - ax), ey = py - ay - h * (by - ay), ez = pz - az - h * (bz - az);
            edge = fmin(edge, ex * ex + ey * ey + ez * ez);
            wf square = select(edge, over, (area > 0.0f) & (u >= 0.0f) & (v >= 0.0f) & (u + v <= area));
            wi used = CONCAT(vload, WIDTH)(0, numbers + (~node) * WIDTH) >= 0;
            best = fmin(best, least(select((wf)(MAXFLOAT), square, used)));
        }
        do {
            if (top == 0) return best;
            top--;
        } while (reach[top] >= best);
        node = stack[top];
    }
}

// How often the surface leaves p behind it along direction d, less how often it faces p: 1 inside, 0 outside.
inline int crossings(float3 o, float3 d, TREE) {
    const float ix = finite_inverse(d.x), iy = finite_inverse(d.y), iz = finite_inverse(d.z);
    const int x_low = d.x < 0 ? 3 : 0, y_low = d.y < 0 ? 4 : 1, z_low = d.z < 0 ? 5 : 2;
    const int x_high = 3 - x_low, y_high = 5 - y_low, z_high = 7 - z_low;
    int stack[STACK * 2], top = 0, count = 0;
    stack[top++] = 0;
    while (top) {
        const int node = stack[--top];
        if (node >= 0) {
            __global const float *b = boxes + node * (6 * WIDTH);
            wf enter = fmax(fmax((WIDE(b + x_low * WIDTH) - o.x) * ix, (WIDE(b + y_low * WIDTH) - o.y) * iy),
                            fmax((WIDE(b + z_low * WIDTH) - o.z) * iz, (wf)(0.0f)));
            wf leave = fmin(fmin((WIDE(b + x_high * WIDTH) - o.x) * ix, (WIDE(b + y_high * WIDTH) - o.y) * iy),
                            (WIDE(b + z_high * WIDTH) - o.z) * iz);
            for (uint set = SET(enter <= leave * 1.0000004f); set; set &= set - 1u) {
                stack[top] = children[node * WIDTH + first_bit(set)];
                top = min(top + 1, STACK * 2 - 1);
            }
        } else {
            __global const float *p = shapes + (~node) * (9 * WIDTH);
            wf ax = WIDE(p + 3 * WIDTH), ay = WIDE(p + 4 * WIDTH), az = WIDE(p + 5 * WIDTH);
            wf bx = WIDE(p + 6 * WIDTH), by = WIDE(p + 7 * WIDTH), bz = WIDE(p + 8 * WIDTH);
            wf px = d.y * bz - d.z * by, py = d.z * bx - d.x * bz, pz = d.x * by - d.y * bx;
            wf volume = ax * px + ay * py + az * pz;
            wf sx = o.x - WIDE(p), sy = o.y - WIDE(p + WIDTH), sz = o.z - WIDE(p + 2 * WIDTH);
            wf qx = sy * az - sz * ay, qy = sz * ax - sx * az, qz = sx * ay - sy * ax, side = copysign((wf)(1.0f), volume);
            wf u = (sx * px + sy * py + sz * pz) * side, v = (d.x * qx + d.y * qy + d.z * qz) * side;
            wf t = (bx * qx + by * qy + bz * qz) * side;
            wi met = (volume != 0.0f) & (u >= 0.0f) & (v >= 0.0f) & (u + v <= fabs(volume)) & (t > 0.0f);
            count += (int)popcount(SET(met & (volume < 0.0f))) - (int)popcount(SET(met & (volume > 0.0f)));
        }
    }
    return count;
}

// Whether p lies inside, by the winding number along three rays: one may pass through an edge and count it twice.
inline bool inside_of(float3 p, TREE) {
    const int a = crossings(p, (float3)(0.5377f, 0.7123f, 0.4511f), TREE_ARGUMENTS) > 0;
    const int b = crossings(p, (float3)(-0.3481f, 0.2897f, -0.8916f), TREE_ARGUMENTS) > 0;
    if (a == b) return a;
    return crossings(p, (float3)(0.1763f, -0.9427f, 0.2831f), TREE_ARGUMENTS) > 0;
}

// The depth of a neighbor `step` mm from a point of known depth, a lower bound for the search: the sign can change only
// where the surface is nearer than that.
inline float depth_beside(float3 p, float known, float step, TREE) {
    const float limit = (fabs(known) + step) * 1.0001f + 1e-5f;
    const float distance = sqrt(nearest_square(p, limit * limit, TREE_ARGUMENTS));
    const bool inside = fabs(known) > step * 1.0001f ? known > 0.0f : inside_of(p, TREE_ARGUMENTS);
    return inside ? distance : -distance;
}

inline float3 corner_of(__constant const grid_t *grid, int x, int y, int z) {
    return vload3(0, grid->origin) + grid->spacing_mm * (float3)(x, y, z);
}

// Depths of the middles of a row of bricks.
__kernel void brick_middles(__constant const grid_t *restrict grid, __global float *middles, TREE) {
    const int y = get_global_id(0), z = get_global_id(1);
    const float far = 1e5f, size = CELLS * grid->spacing_mm;
    float known = 0.0f;
    for (int x = 0; x < grid->bricks[0]; x++) {
        const float3 p = corner_of(grid, x * CELLS, y * CELLS, z * CELLS) + 0.5f * size;
        known = depth_beside(p, known, x ? size : far, TREE_ARGUMENTS);
        middles[(z * grid->bricks[1] + y) * grid->bricks[0] + x] = known;
    }
}

// Depths of all corners of the cells of one brick, in units.
__kernel void brick_corners(__constant const grid_t *restrict grid, __global const float *middles,
                            __global const int *wanted, __global short *values, TREE) {
    const int number = wanted[get_global_id(0)];
    const int bx = number % grid->bricks[0], by = number / grid->bricks[0] % grid->bricks[1], bz = number / grid->bricks[0] / grid->bricks[1];
    __global short *out = values + (size_t)get_global_id(0) * (CORNERS * CORNERS * CORNERS);
    const float step = grid->spacing_mm, corner = 0.8660254f * CELLS * step;
    float plane = middles[number], row = plane, known = plane;
    for (int z = 0; z < CORNERS; z++)
        for (int y = 0; y < CORNERS; y++)
            for (int x = 0; x < CORNERS; x++) {
                const float from = x ? known : y ? row : plane;
                known = depth_beside(corner_of(grid, bx * CELLS + x, by * CELLS + y, bz * CELLS + z), from,
                                     x || y || z ? step : corner, TREE_ARGUMENTS);
                if (!x) row = known;
                if (!x && !y) plane = known;
                *out++ = convert_short_sat_rte(known / grid->unit_mm);
            }
}

// Depths of points, for tests and reports: exact ones and those the grid gives, with its gradients.
__kernel void depths(__global const float *points, __global float *exact, __global float4 *found, GRID, TREE) {
    const int i = get_global_id(0);
    const float3 p = vload3(i, points);
    exact[i] = depth_beside(p, 0.0f, 1e5f, TREE_ARGUMENTS);
    found[i] = depth_at(p, GRID_ARGUMENTS);
}

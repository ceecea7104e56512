// Where the lanes of mesh_walk.cl stand. A lane has an anchor with a frame of its own: z is the depth, x and y lie along
// the surface. Around it is a sphere of square radius `room` in which one of two things holds. Near the surface, it is
// the plane z = 0. Deep, the sphere holds neither surface nor epidermis, and z need only say so.

// How far from its anchor a plane is the surface, mm: less near the surface, for a photon between a plane and a surface
// that curves away under it would leave too late. With these, what a sphere of 2.5 mm radius reflects under an epidermis
// that absorbs 5 /mm is .3 % off, of one of 10 mm less than .1 %; with .125 at every depth it is 1.5 % and .2 %.
#ifndef LEAST_TRUST
#define LEAST_TRUST 0.05f
#define MOST_TRUST 0.125f
#endif
#define FLAT_SLOPE 0.25f  // below, the gradient is no normal: between two surfaces, or on the edge of a fold

typedef struct {
    vf x, y, z;
} three_t;

enum { AT = 0, T = 3, B = 6, NORMAL = 9, ANCHOR = 12 };  // rows of a lane's anchor: place, frame

inline three_t lanes3(const float (*of)[W], int row) {
    three_t v = {LOAD(of[row]), LOAD(of[row + 1]), LOAD(of[row + 2])};
    return v;
}

inline float3 lane3(const float (*of)[W], int row, uint i) {
    return (float3)(of[row][i], of[row + 1][i], of[row + 2][i]);
}

inline void put_lane3(float (*of)[W], int row, uint i, float3 v) {
    of[row][i] = v.x;
    of[row + 1][i] = v.y;
    of[row + 2][i] = v.z;
}

inline void put_lanes3(float (*of)[W], int row, vi mask, three_t old, vf x, vf y, vf z) {
    STORE(SELECT(old.x, x, mask), of[row]);
    STORE(SELECT(old.y, y, mask), of[row + 1]);
    STORE(SELECT(old.z, z, mask), of[row + 2]);
}

// A lane's photon in its frame, and the sphere.
typedef struct {
    vf x, y, z, ux, uy, uz, middle, room;
} photon_t;

// Moves the anchors of lanes to where they are; the lanes that are outside of all bricks.
inline vi settle(float (*anchors)[W], photon_t *at, vi mask, float epidermis, GRID) {
    const three_t a = lanes3(anchors, AT), t = lanes3(anchors, T), b = lanes3(anchors, B), n = lanes3(anchors, NORMAL);
    const vf up = at->middle - at->z;
    vf px = fma(at->x, t.x, fma(at->y, b.x, fma(up, n.x, a.x)));
    vf py = fma(at->x, t.y, fma(at->y, b.y, fma(up, n.y, a.y)));
    vf pz = fma(at->x, t.z, fma(at->y, b.z, fma(up, n.z, a.z)));
    vf dx = fma(at->ux, t.x, fma(at->uy, b.x, -at->uz * n.x));
    vf dy = fma(at->ux, t.y, fma(at->uy, b.y, -at->uz * n.y));
    vf dz = fma(at->ux, t.z, fma(at->uy, b.z, -at->uz * n.z));

    vf gx = (px - grid->origin[0]) * grid->per_mm, gy = (py - grid->origin[1]) * grid->per_mm;
    vf gz = (pz - grid->origin[2]) * grid->per_mm, wx = floor(gx), wy = floor(gy), wz = floor(gz);
    float corner[8][W], x[W], y[W], z[W];
    int i[W], j[W], k[W];
    STORE(gx, x);
    STORE(gy, y);
    STORE(gz, z);
    STORE(TO_VI(wx), i);
    STORE(TO_VI(wy), j);
    STORE(TO_VI(wz), k);
    for (uint set = bits(mask); set; set &= set - 1u) {
        const uint l = lowest_bit(set);
        cell_depths(i[l], j[l], k[l], x[l], y[l], z[l], &corner[0][l], W, GRID_ARGUMENTS);
    }
    vf depth, rx, ry, rz;
#define CORNER(c) LOAD(corner[c])
    INTERPOLATE(vf, CORNER, gx - wx, gy - wy, gz - wz, depth, rx, ry, rz)
#undef CORNER
    const float per_mm = grid->per_mm;
    vf square = (rx * rx + ry * ry + rz * rz) * (per_mm * per_mm), none = 0;
    vf trust = LESSER(GREATER(depth, (vf)(LEAST_TRUST)), (vf)(MOST_TRUST));
    vf clear = depth - epidermis - SELECT((vf)(0.04f * grid->spacing_mm), none, MASK(square == 0.0f));
    vi near = mask & MASK(clear < trust) & MASK(square > FLAT_SLOPE * FLAT_SLOPE);
    vf inverse = 1.0f / sqrt(GREATER(square, (vf)(1e-6f))), scale = -inverse * per_mm;
    vf nx = rx * scale, ny = ry * scale, nz = rz * scale, under = depth * inverse, out = LESSER(under, none);
    px = fma(SELECT(none, out, near), nx, px);  // where a plane was not quite the surface: back onto it
    py = fma(SELECT(none, out, near), ny, py);
    pz = fma(SELECT(none, out, near), nz, pz);
    // The frame of Duff et al. 2017; away from the surface any will do, so the old one stays.
    vf s = AS_VF((AS_VU(nz) & SIGN_BIT) | 0x3f800000u), r = -1.0f / (s + nz), c = nx * ny * r;
    vf tx = fma(s * nx * nx, r, (vf)(1.0f)), ty = s * c, tz = -s * nx, by = fma(ny * ny, r, s), bz = -ny;
    put_lanes3(anchors, AT, mask, a, px, py, pz);
    put_lanes3(anchors, T, near, t, tx, ty, tz);
    put_lanes3(anchors, B, near, b, c, by, bz);
    put_lanes3(anchors, NORMAL, near, n, nx, ny, nz);

    vf far = GREATER(clear, trust), room = SELECT(far, trust, near);
    vf middle = SELECT(epidermis + 2.0f * far, GREATER(under, none), near);
    at->x = SELECT(at->x, none, mask);
    at->y = SELECT(at->y, none, mask);
    at->ux = SELECT(at->ux, fma(dx, tx, fma(dy, ty, dz * tz)), near);
    at->uy = SELECT(at->uy, fma(dx, c, fma(dy, by, dz * bz)), near);
    at->uz = SELECT(at->uz, -fma(dx, nx, fma(dy, ny, dz * nz)), near);
    at->z = SELECT(at->z, middle, mask);
    at->middle = SELECT(at->middle, middle, mask);
    at->room = SELECT(at->room, room * room, mask);
    return mask & MASK(depth < 0.5f * OUTSIDE);
}

// Onto the surface from nearby, by Newton's steps; the normal there, or 0 where there is none.
inline float3 onto_surface(float3 *p, int steps, GRID) {
    float3 normal = 0.0f;
    for (int k = 0; k < steps; k++) {
        const float4 depth = depth_at(*p, GRID_ARGUMENTS);
        const float square = dot(depth.xyz, depth.xyz), inverse = rsqrt(square);
        if (square < FLAT_SLOPE * FLAT_SLOPE) return 0.0f;
        normal = -inverse * depth.xyz;
        *p += depth.w * inverse * normal;
    }
    return normal;
}

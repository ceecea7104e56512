// A step of W photons in lock step under a surface at z = 0, absorption-free: what path_table.cl and the walks of
// pictures share.

// How long the photon of a lane lives, mm. Charts build the walk with another definition, to compare.
#ifndef LIFE
#define LIFE exponential(next_bits(&rng), mean_life)
#endif

// The sine of a scattering angle times the direction of a uniform azimuth. (With the angle drawn in here as well, one
// lane walks 37 % slower: PoCL no longer takes hg's branch out of the loop.)
inline void uniform_turn(vu random, vf cosine, vf *p, vf *q) {
    vf sine = sqrt(fma(-cosine, cosine, (vf)(1.0f)));
    uniform_azimuth(random, p, q);
    *p *= sine;
    *q *= sine;
}

// Size of a direction's depth cosine, and path per depth. One division serves 1/|uz| and 1/(1 + |uz|): it is the
// slowest unit here.
typedef struct {
    vf steep, per_depth, inverse;
} slope_t;

inline slope_t slope_of(vf uz) {
    slope_t slope;
    slope.steep = GREATER(fabs(uz), (vf)(1e-9f));
    vf around = 1.0f + slope.steep, inverse = 1.0f / (slope.steep * around);
    slope.per_depth = inverse * around;
    slope.inverse = inverse * slope.steep;
    return slope;
}

// Goes s mm on; shallow = min(z, thickness). Beyond the surface the step is mirrored into the tissue, its path in the
// epidermis counted on both sides. Lanes that did are returned.
inline vi advance(vf s, slope_t slope, vf thickness, vf ux, vf uy, vf *uz, vf *x, vf *y, vf *z, vf *L, vf *Le,
                  vf *shallow) {
    vf z1 = fma(*uz, s, *z), clipped = LESSER(GREATER(z1, -thickness), thickness);
    *L += s;
    *x = fma(ux, s, *x);
    *y = fma(uy, s, *y);
    vf in_epidermis = fabs(clipped - *shallow) * slope.per_depth;
    *Le += LESSER(in_epidermis, s);
    *shallow = fabs(clipped);
    *z = fabs(z1);
    *uz = AS_VF(AS_VU(*uz) ^ (AS_VU(z1) & SIGN_BIT));
    return MASK(z1 < 0.0f);
}

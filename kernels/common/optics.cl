// Whether light inside a medium of index n under air, at incidence `cosine`, is reflected, for uniform u in (0, 1).
// Fresnel's reflectance (s^2 + p^2) / 2 in product form, finite at normal incidence (Born & Wolf, section 1.5),
// multiplied out so that it needs no division; all is reflected from the critical angle on.
inline vi reflects(vf u, vf cosine, float n) {
    vf out2 = fma(cosine * cosine, (vf)(n * n), (vf)(1.0f - n * n)), out = sqrt(GREATER(out2, (vf)(0.0f)));
    vf a = n * cosine, b = n * out, s = a + out, p = cosine + b;
    vf share_s = (a - out) * p, share_p = (cosine - b) * s, whole = s * p;
    return MASK(2.0f * u * whole * whole <= fma(share_s, share_s, share_p * share_p));
}

// Constants of Henyey-Greenstein sampling for one g.
typedef struct {
    float g, center, reach, sum;
} hg_t;

inline hg_t hg_constants(float g) {
    float span = 1.0f - g * g, sum = 1.0f + g * g;
    hg_t h = {g, 0.5f * sum / g, -0.5f * span * span / g, sum};
    return h;
}

// Cosine of the scattering angle (Henyey & Greenstein 1941, as inverted by Witt 1977) for 2 xi - 1 = random times
// SIGNED_UNIT and the reciprocal of hg_denominator. The usual form divides a difference by 2 g; for small g the same
// expression multiplied out has no difference and no division, and gives 2 xi - 1 at g = 0.
inline vf hg_denominator(hg_t h, vf random) { return fma((vf)(h.g * SIGNED_UNIT), random, (vf)(1.0f)); }

inline vf hg_cosine(hg_t h, vf random, vf inverse_denominator) {
    vf square = inverse_denominator * inverse_denominator, cosine;
    if (fabs(h.g) > 0.1f) {
        cosine = fma((vf)(h.reach), square, (vf)(h.center));
    } else {
        vf s = random * SIGNED_UNIT;
        cosine = fma(s * h.sum, fma((vf)(0.5f * h.g), s, (vf)(1.0f)), (vf)(0.5f * h.g * (3.0f - h.g * h.g))) * square;
    }
    return LESSER(GREATER(cosine, (vf)(-1.0f)), (vf)(1.0f));
}

// Turn a unit direction by an angle of cosine c; (p, q) is the sine times the direction of a uniform azimuth. The
// frame is that of Duff et al. 2017, finite for uz = +1 and -1 without a branch, multiplied out; its signs are left to
// the azimuth, which is uniform either way. inverse = 1 / (1 + |uz|).
inline void turn(vf *ux, vf *uy, vf *uz, vf c, vf p, vf q, vf inverse) {
    vf across = fma(p, *ux, q * *uy), along = fma(-across, inverse, c);
    *ux = fma(*ux, along, p);
    *uy = fma(*uy, along, q);
    *uz = fma(*uz, c, AS_VF(AS_VU(across) ^ (~AS_VU(*uz) & SIGN_BIT)));
}

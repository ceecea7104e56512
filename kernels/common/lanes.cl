// W lanes in lock step: one work-item walks W photons in the lanes of a vector, or one photon where W is 1.
// Vector comparisons give -1 for true and scalar ones 1; `select` and `any` test the sign bit of vectors only.
// These macros hide the difference: a mask (vi) is 0 or -1 in every lane at every W.
#if W == 1
typedef float vf;
typedef uint vu;
typedef int vi;
#define AS_VF as_float
#define AS_VI as_int
#define AS_VU as_uint
#define TO_VF convert_float
#define TO_VI convert_int
#define TO_VL convert_long
#define MASK(relation) (-(relation))
#define SELECT(no, yes, mask) ((mask) ? (yes) : (no))
#define STORE(value, p) (*(p) = (value))
#define LOAD(p) (*(p))
#define ANY(mask) (mask)
inline uint bits(vi mask) { return mask & 1u; }
#else
#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)
typedef JOIN(float, W) vf;
typedef JOIN(uint, W) vu;
typedef JOIN(int, W) vi;
#define AS_VF JOIN(as_float, W)
#define AS_VI JOIN(as_int, W)
#define AS_VU JOIN(as_uint, W)
#define TO_VF JOIN(convert_float, W)
#define TO_VI JOIN(convert_int, W)
#define TO_VL JOIN(convert_long, W)
#define MASK(relation) (relation)
#define SELECT(no, yes, mask) select(no, yes, mask)
#define STORE(value, p) JOIN(vstore, W)(value, 0, p)
#define LOAD(p) JOIN(vload, W)(0, p)
// One bit per lane. An OR tree: PoCL compiles any(int16) to 16 extracts and branches (measured 29 % slower in all).
#if W == 16
inline uint bits(int16 m) {
    m &= (int16)(1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, 32768);
    int8 a = m.lo | m.hi;
    int4 b = a.lo | a.hi;
    return b.x | b.y | b.z | b.w;
}
#elif W == 8
inline uint bits(int8 m) {
    m &= (int8)(1, 2, 4, 8, 16, 32, 64, 128);
    int4 a = m.lo | m.hi;
    return a.x | a.y | a.z | a.w;
}
#else
inline uint bits(int4 m) {
    m &= (int4)(1, 2, 4, 8);
    return m.x | m.y | m.z | m.w;
}
#endif
// Whether any lane is set. Clang's builtin becomes one test of mask registers (measured 13 % faster in all).
#ifdef __has_builtin
#if __has_builtin(__builtin_reduce_or)
#define ANY(mask) __builtin_reduce_or(mask)
#endif
#endif
#ifndef ANY
#define ANY(mask) bits(mask)
#endif
#endif

// Not fmin, fmax and clamp: with operands unknown at compile time those test for NaN, three instructions more each.
#define LESSER(a, b) SELECT(b, a, MASK((a) < (b)))
#define GREATER(a, b) SELECT(b, a, MASK((a) > (b)))

#define SIGN_BIT 0x80000000u

inline uint lowest_bit(uint set) { return 31u - clz(set & (0u - set)); }

// scale * -ln(u) for uniform u in (0, 1] from 31 random bits. As an integer a float is linear in its logarithm within
// each octave: what remains is (c^2 - 1/4) times a polynomial of the mantissa, below 2e-6 off and exact at octave ends.
inline vf exponential(vu random, float scale) {
    vi x = AS_VI(TO_VF(AS_VI((random & 0x7fffffffu) | 1u)));
    vf c = AS_VF((x & 0x7fffff) | 0x3f800000) - 1.5f;
    vf p = fma(c, (vf)(0.0179119277f * scale), (vf)(-0.0306880941f * scale));
    p = fma(p, c, (vf)(0.0532173225f * scale));
    p = fma(p, c, (vf)(-0.1058422230f * scale));
    p = fma(p, c, (vf)(0.2355678310f * scale));
    vf linear = TO_VF(0x4f000000 - x) * (8.26295829e-8f * scale);
    return fma(fma(c, c, (vf)(-0.25f)), p, linear);
}

// exp(x) for x <= 0, relative error below 3e-7 and a rounding of x; 0 below -87.
inline vf exp_lanes(vf x) {
    vf y = GREATER(x, (vf)(-87.0f)) * 1.44269504f;
    vi e = TO_VI(y - 0.5f);  // rounds: y is negative, and PoCL makes ten instructions of convert_int_rte
    vf f = y - TO_VF(e);
    vf p = fma(f, (vf)(0.0013276472f), (vf)(0.0096755415f));
    p = fma(p, f, (vf)(0.0555071328f));
    p = fma(p, f, (vf)(0.240221197f));
    p = fma(p, f, (vf)(0.693146967f));
    p = fma(p, f, (vf)(1.0f));  // exactly 1 at 0: no weight may grow
    return SELECT(AS_VF(AS_VI(p) + (e << 23)), (vf)(0.0f), MASK(x < -87.0f));
}

// Sine and cosine of a uniform azimuth: a mantissa gives the angle from the middle of a quadrant, in (-pi/4, pi/4),
// whose even and odd parts add up to them; two other bits are their signs. Error below 1e-6.
inline void uniform_azimuth(vu random, vf *s, vf *c) {
    vf t = AS_VF((random & 0x7fffffu) | 0x3f800000u) - 1.5f, a = t * t;
    vf even = fma(a, (vf)(-0.0144308845f), (vf)(0.179321321f));
    even = fma(even, a, (vf)(-0.872355525f));
    even = fma(even, a, (vf)(0.707106762f));
    vf odd = fma(a, (vf)(0.0549191374f), (vf)(-0.456587326f));
    odd = fma(odd, a, (vf)(1.11071518f)) * t;
    *s = AS_VF(AS_VU(even + odd) ^ (random & SIGN_BIT));
    *c = AS_VF(AS_VU(even - odd) ^ ((random << 1) & SIGN_BIT));
}

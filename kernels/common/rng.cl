// xoshiro128+ (Blackman & Vigna 2021), one generator of period 2^128 - 1 per lane. Its lowest bits are
// weak (the last is linear in the state): they only end mantissas.
// A stream starts where a bijection puts its 128-bit key (seed, wavelength, block, lane): two keys never share a
// state. That two of a million streams of 1e7 draws overlap anywhere has probability below 1e-18.
typedef struct {
    vu x, y, z, w;
} rng_t;

inline vu rotate_left(vu x, int k) { return (x << k) | (x >> (32 - k)); }

inline vu next_bits(rng_t *s) {
    vu result = s->x + s->w, t = s->y << 9;
    s->z ^= s->x;
    s->w ^= s->y;
    s->y ^= s->z;
    s->x ^= s->w;
    s->z ^= t;
    s->w = rotate_left(s->w, 11);
    return result;
}

// Uniform in (0, 1): the centers of 2^23 cells, so that log(0) cannot occur.
inline vf uniform_of(vu random) { return AS_VF((random >> 9) | 0x3f800000u) - 0.99999994f; }
inline vf next_uniform(rng_t *s) { return uniform_of(next_bits(s)); }

// Uniform in [-1, 1] before its scale of 2^-31, which the caller folds into a constant.
inline vf next_signed(rng_t *s) { return TO_VF(AS_VI(next_bits(s))); }
#define SIGNED_UNIT 4.6566129e-10f

// A bijection of 32 bits with full avalanche (Wellons 2018, hash-prospector).
inline uint mix(uint x) {
    x ^= x >> 16;
    x *= 0x7feb352du;
    x ^= x >> 15;
    x *= 0x846ca68bu;
    return x ^ (x >> 16);
}

// Each assignment is a bijection of one word given the others, and the rounds spread every bit over all four.
inline void stream_state(uint seed, uint wavelength, uint block, uint lane, uint state[4]) {
    state[0] = seed;
    state[1] = wavelength;
    state[2] = block;
    state[3] = lane + 0x9e3779b9u;
    for (int i = 0; i < 12; i++) state[i & 3] = mix(state[i & 3] + (uint)i) ^ mix(state[(i + 3) & 3] + 0x85ebca6bu);
    if (!(state[0] | state[1] | state[2] | state[3])) state[0] = 1u;  // the one state that xoshiro never leaves
}

inline rng_t start_streams(uint seed, uint wavelength, uint block) {
    uint start[4][W];
    for (uint lane = 0; lane < W; lane++) {
        uint state[4];
        stream_state(seed, wavelength, block, lane, state);
        for (int i = 0; i < 4; i++) start[i][lane] = state[i];
    }
    rng_t s = {LOAD(start[0]), LOAD(start[1]), LOAD(start[2]), LOAD(start[3])};
    return s;
}

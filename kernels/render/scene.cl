// The scene on the device: what lies at a hit, read from the head's vertices and maps as the viewer's shaders read them.
// Lengths in mm, colors in linear ACEScg. `view_t` is made from the host's dtype (lutgen/render/device_scene.py).
// A kernel over a scene takes SCENE; SCENE_HERE is what it took, as a scene_t. Both and the type are made from the host's
// table of buffers (SCENE there).
#define TREE_OF(s) (s)->boxes, (s)->children, (s)->shapes, (s)->numbers

// Columns of `waves`: absorption of eumelanin, pheomelanin, baseline and blood, what absorbs besides in epidermis and
// dermis, the life rate nu (all 1/mm), and the ACEScg weight.
#define WAVE 10

typedef struct {
    float3 position;   // on the triangle
    float3 lifted;     // on the round surface that the normals stand for: where light rays start
    float3 geometric;  // unit, of the triangle
    float3 smooth;     // unit, between the corners' normals
    float3 mapped;     // unit, with the normal map
    float3 relief;     // with pores, not of unit length: per area of the plain skin, relief moves light and adds none
    float3 skin;       // melanin, eumelanin, hemoglobin
    float3 detail;     // painted
    float rough, rough2, gloss;
} surface_t;

inline float3 view3(__global const float *p) { return (float3)(p[0], p[1], p[2]); }

inline float3 unit_or(float3 v, float3 otherwise) {
    float square = dot(v, v);
    return square > 1e-20f ? v * rsqrt(square) : otherwise;
}

// The four texels around a place and how much of each; coordinates wrap.
typedef struct {
    int at[4];
    float share[4];
} texels_t;

inline texels_t texels(int columns, int rows, float u, float v) {
    float x = (u - floor(u)) * columns - 0.5f, y = (v - floor(v)) * rows - 0.5f;
    float fx = x - floor(x), fy = y - floor(y);
    int left = (int)floor(x), low = (int)floor(y);
    int right = left + 1 >= columns ? 0 : left + 1, high = low + 1 >= rows ? 0 : low + 1;
    left = left < 0 ? columns - 1 : left;
    low = low < 0 ? rows - 1 : low;
    texels_t t = {{low * columns + left, low * columns + right, high * columns + left, high * columns + right},
                  {(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy}};
    return t;
}

inline float4 read_map(__global const half *map, __global const int *size, float2 at) {
    if (size[0] * size[1] == 1) return vload_half4(0, map);
    texels_t t = texels(size[0], size[1], at.x, at.y);
    return t.share[0] * vload_half4(t.at[0], map) + t.share[1] * vload_half4(t.at[1], map) +
           t.share[2] * vload_half4(t.at[2], map) + t.share[3] * vload_half4(t.at[3], map);
}

inline float4 read_pores(const scene_t *s, float u, float v) {
    texels_t t = texels(s->view->pore_texels, s->view->pore_texels, u, v);
    return t.share[0] * s->pore_map[t.at[0]] + t.share[1] * s->pore_map[t.at[1]] + t.share[2] * s->pore_map[t.at[2]] +
           t.share[3] * s->pore_map[t.at[3]];
}

// Slope of the pores as a vector in the tangent plane of n, and the variance that reading between texels took
// (viewer/shaders/pores.glsl).
inline float4 pores(const scene_t *s, float3 p, float3 n) {
    float3 w = n * n;
    w *= w;
    w /= w.x + w.y + w.z;
    float3 at = p / s->view->pore_side_mm;
    float4 x = read_pores(s, at.y, at.z), y = read_pores(s, at.z + 0.37f, at.x + 0.37f);
    float4 z = read_pores(s, at.x + 0.71f, at.y + 0.71f);
    float3 slope = (float3)(w.y * y.y + w.z * z.x, w.x * x.x + w.z * z.y, w.x * x.y + w.y * y.x) * rsqrt(dot(w, w));
    float3 seen = (float3)(dot(x.xy, x.xy), dot(y.xy, y.xy), dot(z.xy, z.xy));
    return (float4)(slope - n * dot(n, slope), dot(w, fmax((float3)(x.z, y.z, z.z) - seen, 0.0f)));
}

inline float rougher(float roughness, float variance) {
    float square = roughness * roughness;
    return fmin(sqrt(sqrt(square * square + variance)), 1.0f);
}

// The skin at a hit (viewer/shaders/surface.frag.glsl); without `seen` only what matters where light enters.
inline surface_t skin_at(const scene_t *s, hit_t hit, bool seen) {
    __global const view_t *view = s->view;
    __global const int *corner = s->corners + 3 * hit.triangle;
    const float8 a = s->vertices[corner[0]], b = s->vertices[corner[1]], c = s->vertices[corner[2]];
    const float u = hit.u, v = hit.v, w = 1.0f - u - v;
    const float3 ab = b.s012 - a.s012, ac = c.s012 - a.s012, turned = cross(ab, ac);
    surface_t here;
    here.position = a.s012 + u * ab + v * ac;
    here.geometric = unit_or(turned, a.s345);
    here.smooth = unit_or(w * a.s345 + u * b.s345 + v * c.s345, here.geometric);
    const float3 n = here.smooth, p = here.position;
    here.lifted = p - w * fmin(dot(p - a.s012, a.s345), 0.0f) * a.s345 - u * fmin(dot(p - b.s012, b.s345), 0.0f) * b.s345 -
                  v * fmin(dot(p - c.s012, c.s345), 0.0f) * c.s345;  // Hanika 2021

    const float2 at = w * a.s67 + u * b.s67 + v * c.s67, along_u = b.s67 - a.s67, along_v = c.s67 - a.s67;
    float4 texel = read_map(s->normal_map, view->normal_size, at);
    float3 one = cross(ac, n), two = cross(n, ab), tangent = texel.xyz * 2.0f - 1.0f;
    float3 t = one * along_u.x + two * along_v.x, bitangent = one * along_u.y + two * along_v.y;
    float scale = rsqrt(fmax(fmax(dot(t, t), dot(bitangent, bitangent)), 1e-20f)), even = fmin(length(tangent), 1.0f);
    tangent = normalize((float3)(tangent.xy * view->bumps, fmax(tangent.z, 0.2f)));
    here.mapped = unit_or(t * scale * tangent.x + bitangent * scale * tangent.y + n * tangent.z, n);

    float strength = view->bumps * texel.w, unseen = view->bumps * view->bumps * 2.0f * (1.0f - even);
    here.relief = here.mapped;
    if (strength > 0.0f) {
        float4 slope = pores(s, p, here.mapped);
        here.relief -= strength * slope.xyz;
        unseen += strength * strength * slope.w;
    }
    here.skin = view3(view->chromophores) * read_map(s->chromophore_map, view->chromophore_size, at).xyz;
    here.skin = clamp(here.skin, view3(view->chromophores_low), view3(view->chromophores_high));
    if (!seen) return here;
    float4 made = read_map(s->surface_map, view->surface_size, at);
    here.rough = rougher(clamp(view->roughness * made.x, 0.15f, 1.0f), unseen);
    here.rough2 = rougher(clamp(view->roughness * made.x * SECOND_LOBE, 0.1f, 1.0f), unseen);
    here.gloss = view->specular * made.y;
    here.detail = read_map(s->detail_map, view->detail_size, at).xyz;
    return here;
}

inline surface_t surface_at(const scene_t *s, hit_t hit) { return skin_at(s, hit, true); }

// Absorption of epidermis and dermis above the life rate at wavelength k, 1/mm (lutgen/skin/chromophores.py).
inline float2 absorption(const scene_t *s, int k, float3 skin) {
    __global const float *wave = s->waves + k * WAVE;
    float melanin = mix(wave[1], wave[0], skin.y);
    return (float2)(mix(wave[2], melanin, skin.x) + wave[4], mix(wave[2], wave[3], skin.z) + wave[5]) - wave[6];
}

// ACEScg color of wavelength k.
inline float3 color_weight(const scene_t *s, int k) { return view3(s->waves + k * WAVE + 7); }

// The ray through a place of the picture in pixels, row 0 on top.
inline float3 camera_ray(const scene_t *s, float column, float row) {
    __global const view_t *view = s->view;
    float x = 2.0f * column / view->columns - 1.0f, y = 1.0f - 2.0f * row / view->rows;
    return normalize(view3(view->forward) + x * view3(view->right) + y * view3(view->up));
}

inline hit_t nearest(const scene_t *s, float3 o, float3 d) { return trace(o, d, 1e-3f, 1e9f, false, TREE_OF(s)); }

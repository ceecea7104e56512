// Fine relief of the skin from a tile that repeats (lutgen/head/pores.py), laid on from three sides in mm: any mesh.
uniform sampler2D pore_map;       // slopes along x and y, the sum of their squares, openness
uniform float pore_side_mm;

// xyz: slope as a vector in the tangent plane of n; w: variance of the slopes that the mipmaps averaged away.
vec4 pores(vec3 p, vec3 n) {
    vec3 w = n * n;
    w *= w;
    w /= w.x + w.y + w.z;
    vec3 at = p / pore_side_mm;
    vec4 x = texture(pore_map, at.yz), y = texture(pore_map, at.zx + 0.37), z = texture(pore_map, at.xy + 0.71);
    // Where two sides mix, their slopes average out: what mixing took from the contrast is put back.
    float kept = inversesqrt(dot(w, w));
    vec3 slope = kept * vec3(w.y * y.y + w.z * z.x, w.x * x.x + w.z * z.y, w.x * x.y + w.y * y.x);
    vec3 seen = vec3(dot(x.xy, x.xy), dot(y.xy, y.xy), dot(z.xy, z.xy));
    return vec4(slope - n * dot(n, slope), dot(w, max(vec3(x.z, y.z, z.z) - seen, 0.0)));
}

// Roughness of a lobe that slopes of some variance (the sum of both axes') are added to (Beckmann: alpha^2 is that sum).
float rougher(float roughness, float variance) { return min(pow(pow(roughness, 4.0) + variance, 0.25), 1.0); }

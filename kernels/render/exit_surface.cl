// The surface where light leaves, for an offset along the tangent plane at `here`: the first that a ray along the
// plane's normal meets, from REACH times the offset above the plane to as far below it. Where there is none (a miss:
// beyond an ear's rim), or it faces away (rejected: the far side of a thin part), the light leaves where it entered;
// it is not lost. Offsets under 5 um are no farther than the tree resolves.
inline surface_t exit_at(const scene_t *s, const surface_t *here, float3 offset, uint *tally) {
    float radius = length(offset);
    if (radius < 0.005f) return *here;
    float reach = REACH * radius + 0.05f;
    float3 n = here->smooth;
    tally[PROBES]++;
    hit_t hit = trace(here->position + offset + n * reach, -n, 0.0f, 2.0f * reach, false, TREE_OF(s));
    if (hit.triangle < 0) {
        tally[MISSES]++;
        return *here;
    }
    surface_t there = skin_at(s, hit, false);
    if (dot(there.smooth, n) > 0.0f && dot(there.geometric, n) > 0.0f) return there;
    tally[REJECTED]++;
    return *here;
}

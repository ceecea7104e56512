// The profile of the slider's skin: one texel a quantile, so that a tap costs one fetch and not eight.
uniform sampler2D profile;
uniform vec3 skin;
out vec4 ring;

void main() { ring = lutgen_ring(profile, gl_FragCoord.x / float(QUANTILES), skin); }

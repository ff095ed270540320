#version 430
// Spreads the footprint of each sample over the bins that it covers: one invocation per sample of each beam's columns.
// in: the samples of render/shaders/footprint.frag, tables of the layout and of the assignment.
// out: sums of weight and of weight times strength, in units of 2^-31 of the beam's solid angle. Sums of integers do
//      not depend on the order of the additions, so the same scene gives the same bits. Owner: echo/reduction.py.
layout(local_size_x = 64) in;

struct Entry {
    uint beam;
    uint column;
    float scale;      // share of the column / solid angle of the beam * 2^31 [1/sr]
    uint first_row;   // rows inside the aperture
    uint last_row;
    float first_clip; // part of the first cell below the aperture [-]
    float last_clip;  // part of the last cell above it [-]
    float padding;
};
layout(std430, binding = 1) readonly buffer Entries { Entry entries[]; };
layout(std430, binding = 2) readonly buffer SolidAngles { float solid_angle[]; };  // [sr], column by column
layout(std430, binding = 3) buffer Sums { uint sums[]; };  // weight and energy of each bin, beam by beam

uniform usampler2D samples;
uniform int bin_count;
uniform int lowest_bin;
uniform int rows;
uniform float bins_per_metre;
uniform bool linear;         // strengths are linear in the cosine of incidence

const float LEAST = 2e-6;    // [-], least span of a sample relative to its range, beyond it: edges are of the farther bin
const float MOST = 1.9;      // [-], greatest span in the samples
const float PART = 1e-3;     // [-], least part of a cell that the edge of the aperture leaves

void main() {
    uint row = gl_GlobalInvocationID.x;
    Entry entry = entries[gl_WorkGroupID.y + gl_WorkGroupID.z * gl_NumWorkGroups.y];
    if (entry.scale == 0.0 || row < entry.first_row || row > entry.last_row) return;
    uvec2 texel = texelFetch(samples, ivec2(row, entry.column), 0).xy;
    float range = uintBitsToFloat(texel.x);
    if (!(range > 0.0)) return;
    // Ends of the span as inverse ranges [1/bin], which are linear over a plane: see echo/binning.py.
    float inverse = 1.0 / (range * bins_per_metre);
    float root = float((texel.y >> 16) & 0x7FFFu) / 32767.0;
    float span = root * root * MOST;
    float near = inverse + 0.5 * span * inverse;
    float far = near - max(span, LEAST) * inverse;
    float below = row == entry.first_row ? entry.first_clip : 0.0;
    float above = row == entry.last_row ? entry.last_clip : 0.0;
    bool falling = (texel.y & 0x80000000u) != 0u;
    span = near - far;
    near -= (falling ? above : below) * span;
    far += min(falling ? below : above, 1.0 - PART - (falling ? above : below)) * span;
    float low = 1.0 / near, high = 1.0 / far;
    if (low >= float(bin_count) || high < float(lowest_bin)) return;
    root = float(texel.y & 0xFFFFu) / 65535.0;
    float strength = root * root;  // relative to the greatest
    float density = solid_angle[entry.column * uint(rows) + row] * entry.scale / (near - far);
    int k_last = min(int(high), bin_count - 1);
    for (int k = max(int(low), lowest_bin); k <= k_last; ++k) {
        float begin = k > 0 ? min(near, 1.0 / float(k)) : near, end = max(far, 1.0 / float(k + 1));
        float weight = density * max(begin - end, 0.0);
        float part = linear ? strength * 0.5 * (begin + end) / inverse : strength;
        uint place = 2u * (entry.beam * uint(bin_count) + uint(k));
        atomicAdd(sums[place], uint(weight + 0.5));
        atomicAdd(sums[place + 1u], uint(weight * part + 0.5));
    }
}

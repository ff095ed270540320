#version 430
// Turns the sums of bin.comp into echo strengths and clears them for the next image.
// in: weight and energy of each bin in 2^-31 of the beam. out: echo strength [-]. Owner: echo/reduction.py.
layout(local_size_x = 64) in;

layout(std430, binding = 3) buffer Sums { uint sums[]; };
layout(std430, binding = 4) writeonly buffer Bins { float bins[]; };

uniform uint bin_total;      // beams times bins
uniform uint empty;          // weights up to this count as no surface
uniform float strength_max;  // [-]
uniform bool mean;

void main() {
    uint place = gl_GlobalInvocationID.x + gl_GlobalInvocationID.y * gl_NumWorkGroups.x * gl_WorkGroupSize.x;
    if (place >= bin_total) return;
    uint weight = sums[2u * place], energy = sums[2u * place + 1u];
    sums[2u * place] = 0u;
    sums[2u * place + 1u] = 0u;
    float divisor = mean ? float(weight) : 2147483648.0;
    bins[place] = weight > empty ? float(energy) / divisor * strength_max : 0.0;
}

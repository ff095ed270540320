#version 430
// One sample: range, span of ranges of the surface inside its cell, echo strength.
// in: p_S, n_S of the first surface hit [m, -]. Owner: render/footprints.py.
// out.x: bits of the range as float [m]; 0 where nothing was hit.
// out.y: bits 0-15 square root of echo strength / strength_max, bits 16-30 square root of span / MOST_SPAN,
//        bit 31 set where the range falls with elevation. Square roots keep small values precise.
// out.z (TRUTH): id of the body.
uniform float shear;          // of neighbouring columns [cells]
uniform float strength_max;   // [-], greatest value that the strength can take
#ifdef SIGMOID
uniform float sigmoid_slope;  // [-]
uniform float sigmoid_centre; // [-]
#endif
#ifdef ATTENUATION
uniform float attenuation;    // [Np/m], one way, of the amplitude
#endif

// Of the inverse range between the ends of a cell, relative to its middle: reaches from half to 20 times its range.
const float MOST_SPAN = 1.9;

in vec3 p_S;
in vec3 n_S;
flat in float reflectance;
#ifdef TRUTH
flat in uint body_id;
#endif
#ifdef TEXTURED
in vec2 uv;
#endif
#ifdef REFLECTANCE_MAP
flat in uint reflectance_layer;  // from 1; 0 is none
uniform sampler2DArray reflectance_maps;
#endif
#ifdef NORMAL_MAP
flat in uint normal_layer;  // from 1; 0 is none
uniform sampler2DArray normal_maps;

// Tangent frame from the derivatives of position and texture coordinates: right for mirrored ones too, needs no
// tangents in the mesh, and leaves the normal alone where the coordinates do not span the surface. As MikkTSpace, for
// which tools make their pictures: the tangent runs along u, both are unit and square to the normal.
vec3 perturbed(vec3 normal) {
    if (normal_layer == 0u) return normal;
    vec3 relief = texture(normal_maps, vec3(uv, float(normal_layer) - 1.0)).xyz * (255.0 / 127.0) - 128.0 / 127.0;
    vec3 dx = dFdx(p_S), dy = dFdy(p_S);
    vec2 du = dFdx(uv), dv = dFdy(uv);
    // The target's axes run up and to the right, so away points away from the sonar; the normal is turned towards it.
    // Else bumps would be dents, and which is which would depend on the winding.
    vec3 away = dot(cross(dx, dy), normal) < 0.0 ? -normal : normal;
    normal = -away;
    vec3 across_y = cross(dy, away), across_x = cross(away, dx);
    vec3 grows_u = across_y * du.x + across_x * dv.x;  // gradients of u and v along the surface, times one factor
    vec3 grows_v = across_y * du.y + across_x * dv.y;
    vec3 tangent = cross(grows_v, normal);  // v does not change along it
    float mirrored = dot(tangent, grows_u) < 0.0 ? -1.0 : 1.0;
    float size = dot(tangent, tangent) * dot(grows_u, grows_u);
    if (!(size > 0.0)) return normal;
    tangent *= mirrored * inversesqrt(dot(tangent, tangent));
    return normalize(mat3(tangent, mirrored * cross(normal, tangent), normal) * relief);
}
#endif

#ifdef TRUTH
out uvec4 sample_bits;
#else
out uvec2 sample_bits;
#endif

void main() {
    float range = length(p_S);
    float inverse_range = 1.0 / range;
    // A normal of length zero says nothing: the triangle's own plane then does.
    vec3 plane = cross(dFdx(p_S), dFdy(p_S));
    vec3 normal = dot(n_S, n_S) > 1e-12 ? n_S : plane;
    normal *= inversesqrt(dot(normal, normal));
    float cosine = dot(normal, p_S) * inverse_range;
#ifdef NORMAL_MAP
    normal = perturbed(normal);
#endif
    // Two-sided: a surface answers alike whichever way its triangles are wound.
#ifdef NORMAL_MAP
    float strength = abs(dot(normal, p_S)) * inverse_range * reflectance;
#else
    float strength = abs(cosine) * reflectance;
#endif
#ifdef REFLECTANCE_MAP
    if (reflectance_layer != 0u)
        strength *= texture(reflectance_maps, vec3(uv, float(reflectance_layer) - 1.0)).x;
#endif
#ifdef ATTENUATION
    strength *= exp(-2.0 * attenuation * range);
#endif
#ifdef SIGMOID
    strength = 1.0 / (1.0 + exp(-sigmoid_slope * (strength - sigmoid_centre)));
#endif
    // Over a plane the inverse of the range is linear in the target's coordinates, as depth is: differences of it are
    // exact, those of the range itself would be of the middle between two cells.
    float along = -range * dFdx(inverse_range);  // x of the target is elevation
    float across = -range * dFdy(inverse_range) + shear * along;  // columns are sheared against each other
    // Cells that touch along one direction then abut in range; in between the span keeps its variance.
    float span = sqrt(across * across + along * along);
    // A facet seen on edge would reach far beyond the limb that it is part of. The surface turns away within the cell, so
    // its mean cosine there is some part of that turn. A tenth bounds the reach; more would leave slivers of crests
    // empty (rolling terrain at an energy error of 0.013: 1.1 % of the bins with the whole, 0.6 % with this).
    float facing = abs(dot(plane, p_S)) * inverse_range * inversesqrt(dot(plane, plane));
    float turn = 0.05 * (abs(dFdx(cosine)) + abs(dFdy(cosine)));
    span *= facing / max(max(facing, turn), 1e-9);
    uint strength_bits = uint(sqrt(clamp(strength / strength_max, 0.0, 1.0)) * 65535.0 + 0.5);
    uint span_bits = uint(sqrt(min(span / MOST_SPAN, 1.0)) * 32767.0 + 0.5);
    uint sign_bit = along < 0.0 ? 0x80000000u : 0u;
    uint code = strength_bits | (span_bits << 16) | sign_bit;
#ifdef TRUTH
    sample_bits = uvec4(floatBitsToUint(range), code, body_id, 0u);
#else
    sample_bits = uvec2(floatBitsToUint(range), code);
#endif
}

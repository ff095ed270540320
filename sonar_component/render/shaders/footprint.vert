#version 430
// A vertex of the scene in the sonar's frame S and in the clip space D of one view.
// in: position [m] and unit normal in the part's own frame M; index of the part, one per tile drawn.
// out: p_S, n_S [m, -]. Owner: render/footprints.py.
struct Part {
    vec4 X_SM[3];        // rows of the pose of M in S, rotation and translation [m]
    float reflectance;   // [-]
    uint id;             // position of its body in the world, from 1
    uint texture_layer;  // of its maps
    uint padding;
};
layout(std430, binding = 0) readonly buffer Parts { Part parts[]; };

uniform mat4 X_DS;  // sonar frame to clip space of this view

in vec3 in_position;
in vec3 in_normal;
in uint in_part;

out vec3 p_S;
out vec3 n_S;
flat out float reflectance;
#ifdef TRUTH
flat out uint part_id;
#endif
#ifdef NORMAL_MAP
in vec2 in_uv;
out vec2 uv;
flat out uint texture_layer;
#endif

void main() {
    Part part = parts[in_part];
    vec4 p_M = vec4(in_position, 1.0);
    p_S = vec3(dot(part.X_SM[0], p_M), dot(part.X_SM[1], p_M), dot(part.X_SM[2], p_M));
    n_S = vec3(dot(part.X_SM[0].xyz, in_normal), dot(part.X_SM[1].xyz, in_normal), dot(part.X_SM[2].xyz, in_normal));
    reflectance = part.reflectance;
#ifdef TRUTH
    part_id = part.id;
#endif
#ifdef NORMAL_MAP
    uv = in_uv;
    texture_layer = part.texture_layer;
#endif
    gl_Position = X_DS * vec4(p_S, 1.0);
}

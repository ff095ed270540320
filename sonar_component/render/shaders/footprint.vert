#version 430
// A vertex of the scene in the sonar's frame S and in the clip space D of one view. All views of a wide fan share the
// target, each in its band of columns; clip distances keep them apart, so that one draw call serves them all.
// in: position [m] and unit normal in the part's own frame M; pose and material of the part, one per tile drawn:
//     instanced attributes, since fetching them from a storage buffer took twice as long on llvmpipe.
// out: p_S, n_S [m, -]. Owner: render/footprints.py.
#ifdef WIDE_FAN
uniform float column_count;  // of the whole target
#endif

in vec3 in_position;
in vec3 in_normal;
in vec4 in_X_SM_0;    // rows of the pose of M in S, rotation and translation [m]
in vec4 in_X_SM_1;
in vec4 in_X_SM_2;
in vec4 in_X_DM_0;    // rows of M to the clip space of one view: multiplied beforehand, since a matrix picked from a
in vec4 in_X_DM_1;    // uniform array by index cost half of the vertex time on llvmpipe
in vec4 in_X_DM_2;
in vec4 in_X_DM_3;
#ifdef WIDE_FAN
in vec2 in_band;      // first column of the view, number of its columns
#endif
in float in_reflectance;  // [-]
#ifdef TRUTH
in uint in_id;  // position of its body in the world, from 1
#endif

#ifdef WIDE_FAN
out float gl_ClipDistance[2];
#endif
out vec3 p_S;
out vec3 n_S;
flat out float reflectance;
#ifdef TRUTH
flat out uint body_id;
#endif
#ifdef TEXTURED
in vec2 in_uv;
out vec2 uv;
#endif
#ifdef NORMAL_MAP
in uint in_normal_layer;  // from 1; 0 is none
flat out uint normal_layer;
#endif
#ifdef REFLECTANCE_MAP
in uint in_reflectance_layer;  // from 1; 0 is none
flat out uint reflectance_layer;
#endif

void main() {
    vec4 p_M = vec4(in_position, 1.0);
    p_S = vec3(dot(in_X_SM_0, p_M), dot(in_X_SM_1, p_M), dot(in_X_SM_2, p_M));
    n_S = vec3(dot(in_X_SM_0.xyz, in_normal), dot(in_X_SM_1.xyz, in_normal), dot(in_X_SM_2.xyz, in_normal));
    reflectance = in_reflectance;
#ifdef TRUTH
    body_id = in_id;
#endif
#ifdef TEXTURED
    uv = in_uv;
#endif
#ifdef NORMAL_MAP
    normal_layer = in_normal_layer;
#endif
#ifdef REFLECTANCE_MAP
    reflectance_layer = in_reflectance_layer;
#endif
    gl_Position = vec4(dot(in_X_DM_0, p_M), dot(in_X_DM_1, p_M), dot(in_X_DM_2, p_M), dot(in_X_DM_3, p_M));
#ifdef WIDE_FAN
    float column = (gl_Position.y + gl_Position.w) * 0.5 * column_count - in_band.x * gl_Position.w;
    gl_ClipDistance[0] = column;
    gl_ClipDistance[1] = in_band.y * gl_Position.w - column;
#endif
}

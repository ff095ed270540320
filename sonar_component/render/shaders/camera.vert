#version 430
// A vertex of the scene in the camera's frame C (X forward, Y left, Z up) and in clip space D.
// in: position [m] and unit normal in the part's own frame M; pose of M in C and reflectance of the part, instanced.
// out: p_C, n_C [m, -]. Owner: render/camera.py.
uniform mat4 X_DC;  // camera frame to clip space

in vec3 in_position;
in vec3 in_normal;
in vec4 in_X_SM_0;  // rows of the pose of M in C, as render/geometry.py writes them
in vec4 in_X_SM_1;
in vec4 in_X_SM_2;
in float in_reflectance;  // [-], of sound

out vec3 p_C;
out vec3 n_C;
flat out float reflectance;

void main() {
    vec4 p_M = vec4(in_position, 1.0);
    p_C = vec3(dot(in_X_SM_0, p_M), dot(in_X_SM_1, p_M), dot(in_X_SM_2, p_M));
    n_C = vec3(dot(in_X_SM_0.xyz, in_normal), dot(in_X_SM_1.xyz, in_normal), dot(in_X_SM_2.xyz, in_normal));
    reflectance = in_reflectance;
    gl_Position = X_DC * vec4(p_C, 1.0);
}

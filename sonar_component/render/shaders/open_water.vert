#version 430
// One triangle that covers the picture at the far end of the depth range.
// out: ray_C, line of sight in the camera's frame [-]. Owner: render/camera.py.
uniform vec2 tangent;  // of half the field of view, to the side and up

out vec3 ray_C;

void main() {
    vec2 p = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    ray_C = vec3(1.0, -p.x * tangent.x, p.y * tangent.y);
    gl_Position = vec4(p, 1.0, 1.0);
}

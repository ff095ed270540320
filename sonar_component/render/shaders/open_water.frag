#version 430
// Open water where nothing is hit: the veil of an endless line of sight, brighter towards the surface.
// in: ray_C. out: linear RGB, as camera.frag. Owner: render/camera.py.
uniform vec3 up_C;
uniform float camera_depth;  // [m]
uniform vec3 absorption;     // [1/m]
uniform float scattering;    // [1/m]

in vec3 ray_C;

out vec4 colour;

const float SCATTERED = 0.2;  // as in camera.frag

void main() {
    vec3 beam = absorption + scattering;
    vec3 down = absorption + 0.25 * scattering;
    // The integral of daylight(depth) * exp(-beam s) along the ray; going up, daylight grows and the sum is kept finite.
    vec3 loss = beam - down * clamp(dot(normalize(ray_C), up_C), -1.0, 0.9);
    colour = vec4(exp(-down * camera_depth) * SCATTERED * scattering / loss, 1.0);
}

#version 430
// What a camera under water sees of a surface: daylight from above, absorbed on its way down and on its way to the
// camera, and veiled by what the water between scatters into the line of sight. See render/camera.py for the sources.
// in: p_C, n_C [m, -]. out: linear RGB; 1 is a white surface in daylight above the water. Owner: render/camera.py.
uniform vec3 up_C;            // the world's Z axis in the camera's frame
uniform float camera_depth;   // [m] below the surface
uniform vec3 absorption;      // [1/m], red, green, blue
uniform float scattering;     // [1/m]

in vec3 p_C;
in vec3 n_C;
flat in float reflectance;

out vec4 colour;

const vec3 SAND = vec3(0.62, 0.54, 0.41);   // linear albedo of what answers sound weakly
const vec3 STEEL = vec3(0.50, 0.33, 0.24);  // and of what answers strongly: rust
const float DIFFUSE = 0.4;                  // share of the daylight that comes from all sides, not straight down
const float SCATTERED = 0.2;                // share of the scattered light that goes towards the camera

vec3 daylight(float depth) {
    return exp(-(absorption + 0.25 * scattering) * max(depth, 0.0));  // a quarter of the scattered light turns back
}

void main() {
    float distance = length(p_C);
    vec3 n = normalize(n_C);
    n = dot(n, p_C) > 0.0 ? -n : n;  // meshes are not always wound outward
    float depth = camera_depth - dot(up_C, p_C);
    float lit = DIFFUSE + (1.0 - DIFFUSE) * max(dot(n, up_C), 0.0);
    vec3 albedo = mix(SAND, STEEL, clamp(reflectance - 1.0, 0.0, 1.0));
    vec3 through = exp(-(absorption + scattering) * distance);
    vec3 veil = daylight(camera_depth) * SCATTERED * scattering / (absorption + scattering) * (1.0 - through);
    colour = vec4(albedo * lit * daylight(depth) * through + veil, 1.0);
}

// One step of a min-max reduction of REACH² texels to one. Input: FROM_RECEIVERS, the visible receivers in light space
// (Lauritzen, Salvi and Lefohn 2011); FROM_VALUES, a texture; else the results of the previous step.
layout(location = 0) out vec4 low;
layout(location = 1) out vec4 high;
const float nothing = 3.0e38;

#if defined(FROM_RECEIVERS)
#include "receiver.glsl"
uniform mat4 world_to_light;
uniform float perspective;     // 1: x and y are divided by the distance along the axis
uniform float cos_half_angle;  // of a spot's cone; −1 for other lights

void read(ivec2 at, out vec3 a, out vec3 b) {
    Receiver r = receiver_at(at);
    vec3 p = (world_to_light * vec4(r.position, 1.0)).xyz;
    p = vec3(perspective > 0.5 ? p.xy / -p.z : p.xy, -p.z);
    // The third row of the matrix is the light's axis, pointing back to the light.
    vec3 back = vec3(world_to_light[0].z, world_to_light[1].z, world_to_light[2].z);
    bool receives = r.facing && dot(back, r.to_light) >= cos_half_angle;
    a = receives ? p : vec3(nothing);
    b = receives ? p : vec3(-nothing);
}
#define EXTENT textureSize(surface_position, 0)
#elif defined(FROM_VALUES)
uniform sampler2D values;

void read(ivec2 at, out vec3 a, out vec3 b) { a = b = texelFetch(values, at, 0).xyz; }
#define EXTENT textureSize(values, 0)
#else
uniform sampler2D lows;
uniform sampler2D highs;

void read(ivec2 at, out vec3 a, out vec3 b) {
    a = texelFetch(lows, at, 0).xyz;
    b = texelFetch(highs, at, 0).xyz;
}
#define EXTENT textureSize(lows, 0)
#endif

void main() {
    ivec2 start = ivec2(gl_FragCoord.xy) * REACH;
    ivec2 stop = min(start + REACH, EXTENT);
    low = vec4(nothing);
    high = vec4(-nothing);
    for (int y = start.y; y < stop.y; ++y)
        for (int x = start.x; x < stop.x; ++x) {
            vec3 a, b;
            read(ivec2(x, y), a, b);
            low.xyz = min(low.xyz, a);
            high.xyz = max(high.xyz, b);
        }
}

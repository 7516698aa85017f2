// The receiver of a pixel, from the G-buffer.
uniform sampler2D surface_position;  // w = 1 where a surface is visible
uniform sampler2D surface_normal;    // geometric, towards the camera; w = 1 where the surface receives shadows
uniform vec4 light;                  // w = 0: unit vector towards it; w = 1: its position

struct Receiver {
    vec3 position;
    vec3 normal;
    vec3 to_light;   // unit vector
    float distance;  // to the light; 1 for a directional light
    float cosine;    // N·L
    bool facing;     // a visible surface that receives shadows and faces the light
};

Receiver receiver_at(ivec2 pixel) {
    Receiver r;
    vec4 position = texelFetch(surface_position, pixel, 0);
    vec4 normal = texelFetch(surface_normal, pixel, 0);
    r.position = position.xyz;
    r.normal = normal.xyz;
    vec3 to_light = light.xyz - light.w * r.position;
    r.distance = length(to_light);
    r.to_light = to_light / r.distance;
    r.cosine = dot(r.normal, r.to_light);
    r.facing = position.w * normal.w > 0.5 && r.cosine > 0.0;
    return r;
}

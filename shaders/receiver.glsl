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
    bool receives;   // a visible surface that receives shadows
    bool facing;     // one that faces the light
    vec2 at;         // texture coordinates of the pixel's centre
};

Receiver receiver_of(vec2 at) {
    Receiver r;
    vec4 position = textureLod(surface_position, at, 0.0);  // Mesa's software renderer takes twice as long to texelFetch
    vec4 normal = textureLod(surface_normal, at, 0.0);
    r.position = position.xyz;
    r.normal = normal.xyz;
    vec3 to_light = light.xyz - light.w * r.position;
    r.distance = length(to_light);
    r.to_light = to_light / r.distance;
    r.cosine = dot(r.normal, r.to_light);
    r.receives = position.w * normal.w > 0.5;
    r.facing = r.receives && r.cosine > 0.0;
    r.at = at;
    return r;
}

Receiver receiver_at(ivec2 pixel) { return receiver_of((vec2(pixel) + 0.5) / vec2(textureSize(surface_position, 0))); }

// The receiver of this fragment's own pixel.
Receiver receiver_here() { return receiver_of(gl_FragCoord.xy / vec2(textureSize(surface_position, 0))); }

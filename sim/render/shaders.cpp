#include "sim/render/shaders.h"

namespace kiroku::sim {
namespace {

constexpr const char* kVersion = "#version 450 core\n";

// A camera's numbers, as of camera.h; all lengths in mm.
constexpr const char* kCamera = R"GLSL(
uniform vec4 view;      // half extent, centre
uniform float parallel; // 1 or 0
uniform vec4 depth;     // nearest and farthest distance along the view
vec4 projected(vec3 p) {
  float z = (-p.z - depth.x) / (depth.y - depth.x);
  if (parallel != 0) return vec4((p.xy - view.zw) / view.xy, 2 * z - 1, 1);
  // Linear in 1 / distance, as interpolation on the picture asks for.
  float w = -p.z;
  return vec4((p.xy - view.zw * w) / view.xy, (w * (depth.y + depth.x) - 2 * depth.y * depth.x) / (depth.y - depth.x), w);
}
)GLSL";

// The light at the tip, mm; see tip_lighting.h.
constexpr const char* kTip = R"GLSL(
uniform vec4 tip;   // where it is; its brightness at 1 mm
uniform vec4 film;  // share, a^2, F0
const float kGamma = 2.2;
vec3 decoded(vec3 c) { return pow(max(c, vec3(1e-6)), vec3(kGamma)); }
vec3 encoded(vec3 c) { return pow(clamp(c, vec3(1e-6), vec3(1)), vec3(1 / kGamma)); }
float wet_highlight(vec3 n, vec3 l, vec3 to_eye) {
  vec3 h = normalize(l + to_eye);
  float at_half = max(dot(n, h), 0), light_at_half = max(dot(l, h), 1e-3);
  float spread = 1 + at_half * at_half * (film.y - 1);
  float off = max(1 - light_at_half, 0);
  float fresnel = film.z + (1 - film.z) * (off * off * off * off * off);
  return film.y * fresnel * max(dot(n, l), 0) / (4 * light_at_half * light_at_half * spread * spread);
}
)GLSL";

constexpr const char* kWholePicture = R"GLSL(
void main() { gl_Position = vec4((gl_VertexID & 1) * 4 - 1, (gl_VertexID >> 1) * 4 - 1, 0, 1); }
)GLSL";

constexpr const char* kEntryVertex = R"GLSL(
layout(std430, binding = 0) readonly buffer Positions { vec4 positions[]; };
layout(std430, binding = 1) readonly buffer Surface { uvec4 surface[]; };
flat out uint entry;
void main() {
  uvec4 face = surface[gl_VertexID / 3];
  entry = face.w;
  gl_Position = projected(positions[face[gl_VertexID % 3]].xyz);
}
)GLSL";

constexpr const char* kEntryFragment = R"GLSL(
layout(binding = 0) uniform sampler2D before;
uniform int layer;
flat in uint entry;
layout(location = 0) out uint found;
void main() {
  // The same face has the same depth to the bit in each pass.
  if (layer > 0 && gl_FragCoord.z <= texelFetch(before, ivec2(gl_FragCoord.xy), 0).x) discard;
  found = entry;
}
)GLSL";

constexpr const char* kSolidVertex = R"GLSL(
struct Vertex { vec4 position; vec4 normal; vec4 colour; };
layout(std430, binding = 0) readonly buffer Vertices { Vertex vertices[]; };
out vec3 at;
out vec3 normal;
out vec3 tint;
void main() {
  Vertex vertex = vertices[gl_VertexID];
  at = vertex.position.xyz;
  normal = vertex.normal.xyz;
  tint = vertex.colour.rgb;
  gl_Position = projected(at);
}
)GLSL";

constexpr const char* kSolidFragment = R"GLSL(
uniform vec3 light;
in vec3 at;
in vec3 normal;
in vec3 tint;
layout(location = 0) out vec4 colour;
layout(location = 1) out float distance_mm;
void main() {
  vec3 n = normalize(normal);
  vec3 to_eye = parallel != 0 ? vec3(0, 0, 1) : normalize(-at);
#ifdef TIP
  vec3 towards = tip.xyz - at;
  vec3 l = normalize(towards);
  float gloss = pow(max(dot(n, normalize(l + to_eye)), 0), 40);
  vec3 lit = decoded(tint) * (0.35 + 0.65 * max(dot(n, l), 0)) + 0.35 * gloss;
  colour = vec4(encoded(tip.w / dot(towards, towards) * lit), 1);
#else
  float diffuse = max(dot(n, light), 0);
  float gloss = pow(max(dot(n, normalize(light + to_eye)), 0), 40);
  colour = vec4(tint * (0.35 + 0.65 * diffuse) + 0.35 * gloss, 1);
#endif
  distance_mm = -at.z;
}
)GLSL";

constexpr const char* kMarkedVertex = R"GLSL(
struct Vertex { vec4 position; vec4 normal; vec4 colour; };
layout(std430, binding = 0) readonly buffer Vertices { Vertex vertices[]; };
out vec3 at;
out vec3 normal;
out vec3 tint;
flat out uint mark;
flat out uint ghost;
void main() {
  Vertex vertex = vertices[gl_VertexID];
  at = vertex.position.xyz;
  normal = vertex.normal.xyz;
  tint = vertex.colour.rgb;
  mark = uint(vertex.position.w);
  ghost = uint(vertex.normal.w);
  gl_Position = projected(at);
}
)GLSL";

constexpr const char* kMarkedFragment = R"GLSL(
uniform vec3 light;
in vec3 at;
in vec3 normal;
in vec3 tint;
flat in uint mark;
flat in uint ghost;
layout(location = 0) out vec4 colour;
layout(location = 1) out uint shown;
void main() {
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  if (ghost != 0u && ((pixel.x + pixel.y) & 1) == 0) discard;
  vec3 n = normalize(normal);
  vec3 to_eye = parallel != 0 ? vec3(0, 0, 1) : normalize(-at);
  float diffuse = max(dot(n, light), 0);
  float gloss = pow(max(dot(n, normalize(light + to_eye)), 0), 40);
  colour = vec4(tint * (0.4 + 0.6 * diffuse) + 0.2 * gloss, 1);
  shown = mark;
}
)GLSL";

constexpr const char* kRay = R"GLSL(
struct Cell { vec4 barycentric[3]; vec4 texture[3]; };
struct Links { uvec4 neighbours; uvec4 nodes; };
layout(std430, binding = 0) readonly buffer Cells { Cell cells[]; };
layout(std430, binding = 1) readonly buffer AllLinks { Links links[]; };
layout(std430, binding = 2) readonly buffer Rotations { vec4 rotations[]; };
layout(std430, binding = 3) readonly buffer Stress { float stress[]; };
layout(binding = 0) uniform usampler2DArray entries;
layout(binding = 1) uniform sampler2D solid_colour;
layout(binding = 2) uniform sampler2D solid_distance;
layout(binding = 3) uniform sampler3D volume;
layout(binding = 4) uniform sampler2D segments;  // as preintegration.h has them
layout(binding = 7) uniform usampler1D nodes_of_hu;
layout(binding = 5) uniform sampler1D stress_colours;
#ifdef LENS
layout(binding = 6) uniform sampler2D slopes;
#endif
uniform int layers;
uniform vec4 picture;      // size, and one over it
uniform float spacing;     // of the cross-sections, mm
uniform vec4 lighting;     // ambient, diffuse, specular, shininess
uniform vec4 edge;         // HU per mm from which on tissue is shaded; what a texel's step of a gradient is
uniform vec3 light;
uniform vec4 sheet;        // colour and opacity of the surface
uniform vec4 tint;         // share of the stress in the colour; 1 / largest stress
#ifdef COMPUTE
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, rgba8) writeonly uniform image2D shown;
uniform ivec4 covered;     // the first pixel and the one behind the last
#else
layout(location = 0) out vec4 colour;
#endif

const uint kNone = 0xFFFFFFFFu;
const uint kEmpty = 0x80000000u;
const float kFar = 1e30;
// What still comes through when a ray counts as ended: less than half a step of 8 bits.
#ifdef TIP
const float kEnded = 1e-4;
#else
const float kEnded = 0.0019;
#endif
// No ray meets as many cells as this but one that rounding leads in circles.
const int kMostCells = 4096;

vec3 turned(vec4 q, vec3 v) { return v + 2 * cross(q.xyz, cross(q.xyz, v) + q.w * v); }

void main() {
#ifdef COMPUTE
  ivec2 pixel = covered.xy + ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, covered.zw))) return;
#else
  ivec2 pixel = ivec2(gl_FragCoord.xy);
#endif
#ifdef LENS
  vec2 s = texelFetch(slopes, pixel, 0).xy;
#else
  vec2 s = ((vec2(pixel) + 0.5) * picture.zw * 2 - 1) * view.xy + view.zw;
#endif
  vec3 origin = parallel != 0 ? vec3(s, 0) : vec3(0);
  vec3 along = parallel != 0 ? vec3(0, 0, -1) : vec3(s, -1);
  float length_per_depth = length(along);
  vec3 to_eye = -normalize(along);
  vec3 between = normalize(light + to_eye);
  float end = texelFetch(solid_distance, pixel, 0).x;
  vec3 sum = vec3(0);
  float through = 1;
  float reached = 0;  // depth up to which was gathered
  for (int layer = 0; layer < layers; ++layer) {
    uint face = texelFetch(entries, ivec3(pixel, layer), 0).x;
    if (face == kNone || through <= kEnded) break;
    uint cell = face >> 2;
    uint from = face & 3u;
    bool entering = true;
    bool begins = true;  // the layer's first sample is still to come
    float next = 0;      // the cross-section that comes next, from the eye
    // The last sample.
    vec3 last_gradient = vec3(0);
    float last_at = 0;
    int last_node = 0;
    uvec4 beyond = links[cell].neighbours;
    for (int met = 0; met < kMostCells; ++met) {
      vec4 row1 = cells[cell].barycentric[0], row2 = cells[cell].barycentric[1], row3 = cells[cell].barycentric[2];
      // Barycentric coordinates along the ray: begin + t * slope.
      vec4 begin = vec4(0, dot(row1.xyz, origin) + row1.w, dot(row2.xyz, origin) + row2.w, dot(row3.xyz, origin) + row3.w);
      vec4 slope = vec4(0, dot(row1.xyz, along), dot(row2.xyz, along), dot(row3.xyz, along));
      begin.x = 1 - begin.y - begin.z - begin.w;
      slope.x = -slope.y - slope.z - slope.w;
      vec4 crossing = -begin / slope;
      vec4 leaving = mix(vec4(kFar), crossing, lessThan(slope, vec4(0)));
      uvec4 corner = uvec4(0, 1, 2, 3);
      leaving = mix(leaving, vec4(kFar), equal(corner, uvec4(from)));
      float out_at = min(min(leaving.x, leaving.y), min(leaving.z, leaving.w));
      uint exit = leaving.x == out_at ? 0u : leaving.y == out_at ? 1u : leaving.z == out_at ? 2u : 3u;
      if (out_at >= kFar) break;  // a cell without volume
      uvec4 nodes = links[cell].nodes;
      if (entering) {
        entering = false;
        float in_at = from == 0u ? crossing.x : from == 1u ? crossing.y : from == 2u ? crossing.z : crossing.w;
        reached = max(reached, in_at);
        next = floor(reached / spacing) + 1;
#ifdef SURFACE
        if (in_at < end) {
          vec3 inward = from == 0u ? -row1.xyz - row2.xyz - row3.xyz : from == 1u ? row1.xyz : from == 2u ? row2.xyz : row3.xyz;
          vec3 n = -normalize(inward);
#ifdef TIP
          vec3 towards = tip.xyz - (origin + in_at * along);
          vec3 l = normalize(towards);
          vec3 lit = tip.w / dot(towards, towards) * (sheet.rgb * (0.35 + 0.65 * max(dot(n, l), 0)) + 0.3 * pow(max(dot(n, normalize(l + to_eye)), 0), 40));
#else
          vec3 lit = sheet.rgb * (0.35 + 0.65 * max(dot(n, light), 0)) + 0.3 * pow(max(dot(n, between), 0), 40);
#endif
          sum += through * sheet.a * lit;
          through *= 1 - sheet.a;
        }
#endif
      }
      uint into = exit == 0u ? beyond.x : exit == 1u ? beyond.y : exit == 2u ? beyond.z : beyond.w;
      float stop = min(out_at, end);
      bool closes = into == kNone || out_at >= end;
      // The first and the last sample of what cannot be seen are those that segments beside it need.
      bool empty = (nodes.x & kEmpty) != 0u;
      float at = begins ? reached : next * spacing;
      if ((at < stop || closes) && through > kEnded) {
        vec4 tex1 = cells[cell].texture[0], tex2 = cells[cell].texture[1], tex3 = cells[cell].texture[2];
        vec3 place = vec3(dot(tex1.xyz, origin) + tex1.w, dot(tex2.xyz, origin) + tex2.w, dot(tex3.xyz, origin) + tex3.w);
        vec3 step = vec3(dot(tex1.xyz, along), dot(tex2.xyz, along), dot(tex3.xyz, along));
        // Quaternions of one rotation have two signs: those of the corner 0 decide.
        vec4 q0 = rotations[nodes.x & ~kEmpty], q1 = rotations[nodes.y], q2 = rotations[nodes.z], q3 = rotations[nodes.w];
        q1 *= dot(q0, q1) < 0 ? -1 : 1;
        q2 *= dot(q0, q2) < 0 ? -1 : 1;
        q3 *= dot(q0, q3) < 0 ? -1 : 1;
        vec4 turn = begin.x * q0 + begin.y * q1 + begin.z * q2 + begin.w * q3;
        vec4 turning = slope.x * q0 + slope.y * q1 + slope.z * q2 + slope.w * q3;
#ifdef STRESS
        vec4 numbers = vec4(stress[nodes.x & ~kEmpty], stress[nodes.y], stress[nodes.z], stress[nodes.w]) * tint.y;
        float number = dot(begin, numbers), number_slope = dot(slope, numbers);
#endif
        bool more;
        do {
          bool in_front = at < stop;
          float t = in_front ? at : stop;
          vec4 texel = textureLod(volume, place + t * step, 0);
          int node = int(texelFetch(nodes_of_hu, int(texel.a * 4095 + 0.5), 0).x);
          vec3 here = texel.rgb * edge.z - edge.w;
          float length_mm = begins ? 0 : max(t - last_at, 0) * length_per_depth;
          vec4 tissue = texelFetch(segments, ivec2(node, begins ? node : last_node), 0);
          float share = exp2(-tissue.a * (1.0 / 64) * length_mm);
          if (share < 1) {
            vec4 q = turn + t * turning;
            vec3 gradient = 0.5 * (last_gradient + here);
            float steep = length(gradient);
            float shaded = clamp((steep - edge.x) * edge.y, 0, 1);
            // Towards where there is less: air, fat, outside.
            vec3 n = turned(q * inversesqrt(dot(q, q)), gradient) / -max(steep, 1e-6);
#ifdef TIP
            vec3 towards = tip.xyz - (origin + 0.5 * (last_at + t) * along);
            float square = max(dot(towards, towards), 1e-6);
            vec3 l = towards * inversesqrt(square);
            float diffuse = mix(0.75, max(dot(n, l), 0), shaded);
#else
            float diffuse = mix(0.75, max(dot(n, light), 0), shaded);
            float gloss = exp2(lighting.w * log2(max(dot(n, between), 1e-6)));
#endif
#ifdef STRESS
            vec3 painted = texelFetch(stress_colours, int(clamp(number + t * number_slope, 0, 1) * 255 + 0.5), 0).rgb;
            tissue.rgb = mix(tissue.rgb, painted, tint.x);
#endif
#ifdef TIP
            vec3 lit = tip.w / square * (tissue.rgb * (lighting.x + lighting.y * diffuse) + film.x * shaded * wet_highlight(n, l, to_eye));
#else
            vec3 lit = tissue.rgb * (lighting.x + lighting.y * diffuse) + lighting.z * shaded * gloss;
#endif
            sum += through * (1 - share) * lit;
            through *= share;
          }
          last_gradient = here;
          last_node = node;
          last_at = t;
          if (in_front && !begins) next += 1;
          if (empty && in_front) next = max(next, ceil(stop / spacing) - 1);
          begins = false;
          at = next * spacing;
          more = (at < stop || (closes && in_front)) && through > kEnded;
        } while (more);
        reached = last_at;
      }
      if (out_at >= end || through <= kEnded) { layer = layers; break; }
#ifdef SURFACE
      if (into == kNone) {
        vec3 inward = exit == 0u ? -row1.xyz - row2.xyz - row3.xyz : exit == 1u ? row1.xyz : exit == 2u ? row2.xyz : row3.xyz;
        vec3 n = normalize(inward);
#ifdef TIP
        vec3 towards = tip.xyz - (origin + out_at * along);
        vec3 lit = tip.w / dot(towards, towards) * sheet.rgb * (0.35 + 0.65 * max(dot(n, normalize(towards)), 0));
#else
        vec3 lit = sheet.rgb * (0.35 + 0.65 * max(dot(n, light), 0));
#endif
        sum += through * sheet.a * lit;
        through *= 1 - sheet.a;
      }
#endif
      if (into == kNone) break;
      beyond = links[into].neighbours;
      from = beyond.x == cell ? 0u : beyond.y == cell ? 1u : beyond.z == cell ? 2u : 3u;
      cell = into;
    }
  }
#ifdef TIP
  vec4 gathered = vec4(encoded(sum + through * decoded(texelFetch(solid_colour, pixel, 0).rgb)), 1);
#else
  vec4 gathered = vec4(sum + through * texelFetch(solid_colour, pixel, 0).rgb, 1);
#endif
#ifdef COMPUTE
  imageStore(shown, pixel, gathered);
#else
  colour = gathered;
#endif
}
)GLSL";

constexpr const char* kPack = R"GLSL(
layout(local_size_x = 64) in;
layout(binding = 0) uniform sampler2D shown;
layout(std430, binding = 0) writeonly buffer Packed { uint words[]; };
uint rgb(uint pixel, ivec2 size) {
  ivec2 at = ivec2(pixel % uint(size.x), uint(size.y) - 1u - pixel / uint(size.x));
  return packUnorm4x8(texelFetch(shown, at, 0)) & 0xFFFFFFu;
}
void main() {
  uint word = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
  if (word >= uint(words.length())) return;
  ivec2 size = textureSize(shown, 0);
  uint last = uint(size.x) * uint(size.y) - 1u;
  // A word holds the end of one pixel and the beginning of the next.
  uint pixel = 4u * word / 3u;
  uint gone = 4u * word - 3u * pixel;  // bytes of it that are in the word before
  words[word] = rgb(pixel, size) >> (8u * gone) | rgb(min(pixel + 1u, last), size) << (8u * (3u - gone));
}
)GLSL";

std::string ray_shader(const RayFeatures& features, const char* kind) {
  return std::string(kVersion) + kind + (features.surface ? "#define SURFACE\n" : "") +
         (features.stress ? "#define STRESS\n" : "") + (features.lens ? "#define LENS\n" : "") + kCamera +
         (features.tip ? std::string("#define TIP\n") + kTip : "") + kRay;
}

}  // namespace

std::string whole_picture_vertex_shader() { return std::string(kVersion) + kWholePicture; }
std::string entry_vertex_shader() { return std::string(kVersion) + kCamera + kEntryVertex; }
std::string entry_fragment_shader() { return std::string(kVersion) + kEntryFragment; }
std::string solid_vertex_shader() { return std::string(kVersion) + kCamera + kSolidVertex; }
std::string solid_fragment_shader(bool tip) {
  return std::string(kVersion) + kCamera + (tip ? std::string("#define TIP\n") + kTip : "") + kSolidFragment;
}
std::string marked_vertex_shader() { return std::string(kVersion) + kCamera + kMarkedVertex; }
std::string marked_fragment_shader() { return std::string(kVersion) + kCamera + kMarkedFragment; }
std::string ray_fragment_shader(const RayFeatures& features) { return ray_shader(features, ""); }
std::string ray_compute_shader(const RayFeatures& features) {
  return ray_shader(features, "#define COMPUTE\n");
}
std::string pack_compute_shader() { return std::string(kVersion) + kPack; }

}  // namespace kiroku::sim

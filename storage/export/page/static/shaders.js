// The shader that relights a picture of normals.

export const VERTEX = `#version 300 es
void main() {
  vec2 corner = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
  gl_Position = vec4(corner * 2.0 - 1.0, 0.0, 1.0);
}`;

export const MATERIALS = ["matte", "glossy", "glass", "relief", "normals", "curvature"];

/** The shader of a material, with a lens or a photograph where they are shown: without a graphics card, what is not asked
    for must cost nothing. */
export function fragment(material, hasLens, hasPhotograph) {
  const facts = { MATERIAL: MATERIALS.indexOf(material), LENS: Number(hasLens), PHOTOGRAPH: Number(hasPhotograph) };
  const lines = Object.entries(facts).map(([name, value]) => `#define ${name} ${value}`);
  return ["#version 300 es", ...lines, FRAGMENT].join("\n");
}

/* Normals are in the camera frame: x right, y up, z to the viewer; alpha is 1 on the object. `corner` and `pixel` map a
   pixel of the canvas to the picture, in pixels, y down. */
const FRAGMENT = `precision highp float;
uniform sampler2D normals;
uniform sampler2D lens;
uniform sampler2D photograph;
uniform sampler2D mean;
uniform vec2 meanShare;
uniform vec2 size;
uniform vec2 corner;
uniform float pixel;
uniform float canvasHeight;
uniform vec3 light;
uniform vec3 ground;
uniform float relief;
uniform float lensShare;
uniform float wipe;
uniform float gamma;
out vec4 colour;

const float INDEX = 1.5;

vec3 studio(vec3 d) {
  // A dark room with one large soft light where the light is, a weak one on the other side, and a bright table.
  float key = smoothstep(0.86, 0.985, dot(d, light));
  vec3 opposite = normalize(vec3(-light.xy, light.z + 0.35));
  float fill = smoothstep(0.80, 0.97, dot(d, opposite)) * 0.22;
  float table = smoothstep(0.05, -0.75, d.y) * 0.16;
  float behind = smoothstep(-0.55, -0.95, d.z) * 0.12;
  return vec3(0.035, 0.04, 0.047) + behind + vec3(1.0, 0.985, 0.96) * key * 1.25 + vec3(0.75, 0.85, 1.0) * fill + table;
}

vec3 glass(vec3 n) {
  vec3 v = vec3(0.0, 0.0, 1.0);
  float facing = clamp(n.z, 0.0, 1.0);
  float fresnel = 0.04 + 0.96 * pow(1.0 - facing, 5.0);
  vec3 bent = refract(-v, n, 1.0 / INDEX);
  // What is behind is seen through the glass: a backdrop that is light in the middle and dark at the edges.
  vec2 at = bent.xy / max(-bent.z, 0.2) * 1.9;
  float backdrop = mix(0.62, 0.10, smoothstep(0.15, 1.15, length(at + vec2(0.0, 0.12))));
  vec3 through = vec3(0.93, 1.0, 0.985) * backdrop * (0.55 + 0.45 * facing);
  // The far side of the glass gathers the light opposite to where it comes from.
  float caustic = pow(clamp(dot(normalize(vec3(-bent.xy * 1.7, 0.75)), normalize(vec3(-light.xy, light.z))), 0.0, 1.0), 18.0);
  vec3 mirrored = studio(reflect(-v, n));
  return through + 0.20 * caustic + mirrored * (fresnel * 1.1 + 0.05) + pow(max(dot(n, normalize(light + v)), 0.0), 420.0);
}

vec3 relieved(vec2 uv, vec3 n) {
  // Unsharp masking of the normals: the difference from their mean around the pixel is enlarged.
  return normalize(n + relief * (n - normalize(texture(mean, uv * meanShare).xyz + 1e-6)));
}

vec3 beside(vec2 uv, vec3 n) {
  // The normal at a neighbour; off the object the pixel's own, so that the contour bends nothing.
  vec4 stored = texture(normals, uv);
  return stored.a > 0.9 ? stored.xyz : n;
}

vec3 shade(vec3 n, vec2 uv) {
#if MATERIAL == 0
  return vec3(max(dot(n, light), 0.0));
#elif MATERIAL == 1
  float diffuse = max(dot(n, light), 0.0);
  float gloss = pow(max(dot(n, normalize(light + vec3(0.0, 0.0, 1.0))), 0.0), 90.0);
  float edge = pow(1.0 - clamp(n.z, 0.0, 1.0), 3.0);
  return vec3(0.30, 0.31, 0.33) * (0.12 + diffuse) + vec3(1.0, 0.98, 0.95) * gloss * 0.9 + 0.10 * edge * (0.3 + diffuse);
#elif MATERIAL == 2
  return glass(n);
#elif MATERIAL == 3
  return vec3(0.06 + 0.94 * max(dot(relieved(uv, n), light), 0.0));
#elif MATERIAL == 4
  return n * 0.5 + 0.5;
#else
  // Mean curvature, 1/pixel: half the divergence of the normals over two pixels to each side.
  vec2 e = 2.0 / size;
  float across = beside(uv + vec2(e.x, 0.0), n).x - beside(uv - vec2(e.x, 0.0), n).x;
  float upwards = beside(uv - vec2(0.0, e.y), n).y - beside(uv + vec2(0.0, e.y), n).y;
  float bend = clamp((across + upwards) / 8.0 * max(size.x, size.y) / 12.0, -1.0, 1.0);
  vec3 flat_ = vec3(0.93, 0.92, 0.89);
  return bend > 0.0 ? mix(flat_, vec3(0.70, 0.27, 0.10), bend) : mix(flat_, vec3(0.10, 0.33, 0.58), -bend);
#endif
}

void main() {
  vec2 at = corner + vec2(gl_FragCoord.x, canvasHeight - gl_FragCoord.y) * pixel;
  vec2 uv = at / size;
  vec4 stored = texture(normals, uv);
  // The contour lies where half a pixel belongs to the object, at any magnification as sharp as the screen allows.
  float slope = clamp(max(abs(dFdx(stored.a)), abs(dFdy(stored.a))), 0.02, 1.0);
  float share = clamp((stored.a - 0.5) / slope + 0.5, 0.0, 1.0);
  vec3 n = share > 0.0 ? normalize(stored.xyz) : vec3(0.0, 0.0, 1.0);
  vec3 lit = shade(n, uv);
#if LENS
  vec4 over = texture(lens, uv);
  float shading = MATERIAL >= 4 ? 1.0 : 0.35 + 0.65 * max(dot(n, light), 0.0);
  lit = mix(lit, over.rgb * shading, lensShare * over.a);
#endif
  vec3 shown = mix(ground, lit, share);
#if PHOTOGRAPH
  if (uv.x < wipe) shown = pow(texture(photograph, uv).rgb, vec3(gamma));
#endif
  bool isOutside = uv.x < 0.0 || uv.y < 0.0 || uv.x > 1.0 || uv.y > 1.0;
  colour = vec4(isOutside ? ground : shown, 1.0);
}`;

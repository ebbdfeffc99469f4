/** The few shaders of the viewport. Colours are taken as they are shown: no conversion anywhere. */
import { DoubleSide, GLSL3, ShaderMaterial, Vector3, Vector4 } from "three";

const KEY = new Vector3(-0.35, 0.35, 0.87).normalize();
const FILL = new Vector3(0.7, -0.1, 0.5).normalize();

const VERTEX = /* glsl */ `
in vec4 tint;
out vec3 vNormal;
out vec3 vTint;
out vec3 vPlace;
void main() {
  vec4 place = modelViewMatrix * vec4(position, 1.0);
  vNormal = normalMatrix * normal;
  vTint = tint.rgb;
  vPlace = position;
  gl_Position = projectionMatrix * place;
}`;

const FRAGMENT = /* glsl */ `
precision highp float;
in vec3 vNormal;
in vec3 vTint;
in vec3 vPlace;
out vec4 colour;
uniform vec3 key;
uniform vec3 fill;
uniform vec4 flatTint;
uniform vec4 plane;
uniform float opacity;
void main() {
  vec3 n = normalize(gl_FrontFacing ? vNormal : -vNormal);
  float light = 0.38 + 0.56 * max(dot(n, key), 0.0) + 0.2 * max(dot(n, fill), 0.0);
  vec3 base = mix(vTint, flatTint.rgb, flatTint.a);
  // The inside of the surface is dark and warm, so that a hole shows what it is: unlike the blue
  // of what was not measured.
  if (!gl_FrontFacing) base = base * vec3(0.5, 0.42, 0.36);
  // What a cut would take away is shown faded.
  if (dot(plane.xyz, vPlace) < plane.w) base = mix(base, vec3(0.85, 0.3, 0.2), 0.6);
  colour = vec4(base * light, opacity);
}`;

export interface SurfaceLook {
  tint?: [number, number, number];
  opacity?: number;
  offset?: number;
}

/** Lit surface; with a tint, in one colour instead of that of the vertices. */
export function surfaceMaterial(look: SurfaceLook = {}): ShaderMaterial {
  const [r, g, b] = look.tint ?? [0, 0, 0];
  return new ShaderMaterial({
    glslVersion: GLSL3,
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    side: DoubleSide,
    transparent: (look.opacity ?? 1) < 1,
    depthWrite: (look.opacity ?? 1) === 1,
    polygonOffset: look.offset !== undefined,
    polygonOffsetFactor: look.offset ?? 0,
    polygonOffsetUnits: look.offset ?? 0,
    uniforms: {
      key: { value: KEY },
      fill: { value: FILL },
      flatTint: { value: new Vector4(r, g, b, look.tint ? 1 : 0) },
      plane: { value: new Vector4(0, 0, 0, -1) },
      opacity: { value: look.opacity ?? 1 },
    },
  });
}

const WHOLE_SCREEN = /* glsl */ `
out vec2 at;
void main() {
  at = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
  gl_Position = vec4(at * 2.0 - 1.0, 0.0, 1.0);
}`;

/** Copies the stored picture with its depth, so that overlays can be drawn into it. */
export function copyMaterial(): ShaderMaterial {
  return new ShaderMaterial({
    glslVersion: GLSL3,
    vertexShader: WHOLE_SCREEN,
    fragmentShader: /* glsl */ `
precision highp float;
precision highp sampler2D;
in vec2 at;
out vec4 colour;
uniform sampler2D picture;
uniform sampler2D depth;
void main() {
  colour = texture(picture, at);
  gl_FragDepth = texture(depth, at).r;
}`,
    depthFunc: 1, // AlwaysDepth
    uniforms: { picture: { value: null }, depth: { value: null } },
  });
}

/** Depth along the view as a share of the range, in three bytes; the fourth is 0 where nothing is. */
export function depthMaterial(): ShaderMaterial {
  return new ShaderMaterial({
    glslVersion: GLSL3,
    vertexShader: WHOLE_SCREEN,
    fragmentShader: /* glsl */ `
precision highp float;
precision highp int;
precision highp sampler2D;
in vec2 at;
out vec4 bytes;
uniform sampler2D depth;
uniform vec2 range;
uniform bool orthographic;
void main() {
  float d = texture(depth, at).r;
  float mm = range.x * range.y / (range.y - d * (range.y - range.x));
  float share = orthographic ? d : (mm - range.x) / (range.y - range.x);
  uint n = uint(clamp(share, 0.0, 1.0) * 16777215.0);
  bytes = vec4(float(n >> 16u), float((n >> 8u) & 255u), float(n & 255u), d < 1.0 ? 255.0 : 0.0) / 255.0;
}`,
    depthTest: false,
    depthWrite: false,
    uniforms: { depth: { value: null }, range: { value: [0, 1] }, orthographic: { value: false } },
  });
}

// The programs of the 3D view: points as balls, lines, and colliders as shaded triangles.

const POINTS = `#version 300 es
uniform mat4 view, projection;
uniform float size, low, high;
uniform bool valued;
in vec3 position;
in float value;
in vec4 color;
out vec3 shade;

// Viridis (van der Walt and Smith, CC0), as a polynomial.
vec3 viridis(float t) {
  const vec3 a = vec3(0.2777273, 0.0054073, 0.3340998), b = vec3(0.1050930, 1.4046135, 1.3845902);
  const vec3 c = vec3(-0.3308618, 0.2148476, 0.0950952), d = vec3(-4.6342305, -5.7991010, -19.3324410);
  const vec3 e = vec3(6.2282699, 14.1799334, 56.6905526), f = vec3(4.7763850, -13.7451454, -65.3530326);
  const vec3 g = vec3(-5.4354559, 4.6458526, 26.3124352);
  return a + t * (b + t * (c + t * (d + t * (e + t * (f + t * g)))));
}

void main() {
  vec4 at = view * vec4(position, 1.0);
  gl_Position = projection * at;
  // Half of the height is one.
  gl_PointSize = clamp(0.5 * size * projection[1][1] / gl_Position.w, 1.5, 64.0);
  bool known = !(isnan(value) || isinf(value));
  float t = known ? clamp((value - low) / max(high - low, 1e-30), 0.0, 1.0) : 0.0;
  shade = valued ? (known ? viridis(t) : vec3(0.5)) : color.rgb;
}`;

const BALL = `#version 300 es
precision mediump float;
in vec3 shade;
out vec4 result;

void main() {
  vec2 at = 2.0 * gl_PointCoord - 1.0;
  float r = dot(at, at);
  if (r > 1.0) discard;
  float light = 0.62 + 0.38 * dot(vec3(at.x, -at.y, sqrt(1.0 - r)), normalize(vec3(-0.3, 0.5, 0.8)));
  result = vec4(shade * light, 1.0);
}`;

const LINES = `#version 300 es
uniform mat4 view, projection;
in vec3 position;
void main() { gl_Position = projection * view * vec4(position, 1.0); }`;

const PLAIN = `#version 300 es
precision mediump float;
uniform vec3 ink;
out vec4 result;
void main() { result = vec4(ink, 1.0); }`;

const FACES = `#version 300 es
uniform mat4 view, projection, model;
in vec3 position;
out vec3 seen;
void main() {
  vec4 at = view * model * vec4(position, 1.0);
  seen = at.xyz;
  gl_Position = projection * at;
}`;

const SHADED = `#version 300 es
precision highp float;
uniform vec4 ink;
in vec3 seen;
out vec4 result;

void main() {
  // The normal of the triangle, on the side that is seen.
  vec3 normal = normalize(cross(dFdx(seen), dFdy(seen)));
  float light = 0.5 + 0.5 * max(dot(normal * sign(normal.z), normalize(vec3(-0.3, 0.5, 0.8))), 0.0);
  result = vec4(ink.rgb * light * ink.a, ink.a);
}`;

/** All programs, with the places of their uniforms. Throws where one does not compile. */
export function programs(gl) {
  const compile = (kind, source) => {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    return shader;
  };
  const program = (vertex, fragment, ...names) => {
    const made = gl.createProgram();
    gl.attachShader(made, compile(gl.VERTEX_SHADER, vertex));
    gl.attachShader(made, compile(gl.FRAGMENT_SHADER, fragment));
    ["position", "value", "color"].forEach((name, at) => gl.bindAttribLocation(made, at, name));
    gl.linkProgram(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS) && !gl.isContextLost())
      throw new Error(gl.getProgramInfoLog(made));
    const all = ["view", "projection", ...names];
    return { made, ...Object.fromEntries(all.map((name) => [name, gl.getUniformLocation(made, name)])) };
  };
  return {
    balls: program(POINTS, BALL, "size", "low", "high", "valued"),
    lines: program(LINES, PLAIN, "ink"),
    faces: program(FACES, SHADED, "ink", "model"),
  };
}

/** The colour of a value in [0, 1], as the shader has it. */
export function viridis(t) {
  const k = [
    [0.2777273, 0.105093, -0.3308618, -4.6342305, 6.2282699, 4.776385, -5.4354559],
    [0.0054073, 1.4046135, 0.2148476, -5.799101, 14.1799334, -13.7451454, 4.6458526],
    [0.3340998, 1.3845902, 0.0950952, -19.332441, 56.6905526, -65.3530326, 26.3124352],
  ];
  return k.map((row) =>
    Math.round(
      255 *
        Math.min(
          1,
          Math.max(
            0,
            row.reduceRight((sum, c) => sum * t + c, 0),
          ),
        ),
    ),
  );
}

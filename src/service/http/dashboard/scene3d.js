// Points in a box, drawn with WebGL. The camera turns around a target; everything is relative to the points' origin, so
// that far domains lose no digits.

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
  gl_PointSize = clamp(size * projection[1][1] / gl_Position.w, 1.5, 64.0);
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

/** Half of the angle that the view is high. */
const HALF_ANGLE = (19 * Math.PI) / 180;

const sub = (a, b) => a.map((x, i) => x - b[i]);
const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => a.map((x) => x / Math.hypot(...a));

export class Scene3D {
  points = null;
  bounds = null;
  range = [0, 1];
  size = 1;
  fitted = null;
  /** Degrees above the floor and around it, the distance, and what is looked at (m, absolute). */
  camera = { azimuth: -60, elevation: 22, distance: 3, target: [0, 0, 0] };

  /** Throws where there is no WebGL 2. */
  constructor(canvas) {
    this.canvas = canvas;
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: true, preserveDrawingBuffer: true });
    if (!gl) throw new Error("This browser has no WebGL 2, which the view is drawn with.");
    this.gl = gl;
    const compile = (kind, source) => {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      return shader;
    };
    const program = (vertex, fragment, names) => {
      const made = gl.createProgram();
      gl.attachShader(made, compile(gl.VERTEX_SHADER, vertex));
      gl.attachShader(made, compile(gl.FRAGMENT_SHADER, fragment));
      ["position", "value", "color"].forEach((name, at) => gl.bindAttribLocation(made, at, name));
      gl.linkProgram(made);
      if (!gl.getProgramParameter(made, gl.LINK_STATUS) && !gl.isContextLost())
        throw new Error(gl.getProgramInfoLog(made));
      return { made, ...Object.fromEntries(names.map((name) => [name, gl.getUniformLocation(made, name)])) };
    };
    this.balls = program(POINTS, BALL, ["view", "projection", "size", "low", "high", "valued"]);
    this.lines = program(LINES, PLAIN, ["view", "projection", "ink"]);
    this.buffers = ["position", "value", "color", "box"].map(() => gl.createBuffer());
    gl.enable(gl.DEPTH_TEST);
  }

  /** The domain, whose edges are drawn. 2D scenes are seen from the front. */
  setBounds(min, max, flat) {
    this.bounds = [min, max];
    this.flat = flat;
    this.fit();
  }

  /** Looks at all of the domain, from as near as all of its corners allow. */
  fit(azimuth = this.flat ? -90 : -60, elevation = this.flat ? 90 : 22) {
    const [min, max] = this.bounds;
    const target = min.map((x, i) => (x + max[i]) / 2);
    this.camera = { azimuth, elevation, distance: 1, target };
    const { right, up, back } = this.axes();
    const high = 0.94 * Math.tan(HALF_ANGLE);
    const wide = (high * (this.canvas.clientWidth || 1)) / (this.canvas.clientHeight || 1);
    const needed = Array.from({ length: 8 }, (_, k) => {
      const corner = target.map((x, axis) => (k & (1 << axis) ? max : min)[axis] - x);
      return dot(back, corner) + Math.max(Math.abs(dot(right, corner)) / wide, Math.abs(dot(up, corner)) / high);
    });
    this.camera.distance = Math.max(...needed);
    this.fitted = [azimuth, elevation];
  }

  /** To be called when the canvas has another size: a view of the whole stays one, until the user moves it. */
  resized() {
    if (this.fitted) this.fit(...this.fitted);
  }

  /** Points of a frame ([`frames.js`]). */
  setPoints(points) {
    const { gl } = this;
    this.points = points;
    const upload = (at, data) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[at]);
      gl.bufferData(gl.ARRAY_BUFFER, data, gl.DYNAMIC_DRAW);
    };
    upload(0, points.positions);
    if (points.values) upload(1, points.values);
    if (points.colors) upload(2, points.colors);
  }

  turn(azimuth, elevation) {
    this.fitted = null;
    this.camera.azimuth = (this.camera.azimuth + azimuth) % 360;
    this.camera.elevation = Math.min(90, Math.max(-90, this.camera.elevation + elevation));
  }

  zoom(factor) {
    this.fitted = null;
    const [min, max] = this.bounds ?? [
      [0, 0, 0],
      [1, 1, 1],
    ];
    const whole = Math.hypot(...sub(max, min));
    this.camera.distance = Math.min(50 * whole, Math.max(0.01 * whole, this.camera.distance * factor));
  }

  /** Moves the target by shares of the view's height. */
  pan(right, up) {
    this.fitted = null;
    const { right: r, up: u } = this.axes();
    const far = 0.7 * this.camera.distance;
    this.camera.target = this.camera.target.map((x, i) => x + far * (right * r[i] + up * u[i]));
  }

  /** The camera's axes; `back` points from the target to the camera. */
  axes() {
    const [a, e] = [this.camera.azimuth, this.camera.elevation].map((degrees) => (degrees * Math.PI) / 180);
    const back = [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)];
    const right = [-Math.sin(a), Math.cos(a), 0];
    return { right, up: unit(cross(back, right)), back };
  }

  draw() {
    const { gl, canvas, camera } = this;
    const ratio = Math.min(devicePixelRatio || 1, 2);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((n) => Math.max(1, Math.round(n * ratio)));
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const origin = this.points?.origin ?? this.bounds?.[0] ?? [0, 0, 0];
    const { right, up, back } = this.axes();
    const eye = sub(camera.target, origin).map((x, i) => x + camera.distance * back[i]);
    const view = [right, up, back].map((axis) => [...axis, -dot(axis, eye)]);
    const columns = [0, 1, 2, 3].flatMap((i) => [view[0][i], view[1][i], view[2][i], i === 3 ? 1 : 0]);
    const f = 1 / Math.tan(HALF_ANGLE);
    const [near, far] = [camera.distance * 0.02, camera.distance * 20];
    const depth = [(near + far) / (near - far), (2 * near * far) / (near - far)];
    const projection = [(f * height) / width, 0, 0, 0, 0, f, 0, 0, 0, 0, depth[0], -1, 0, 0, depth[1], 0];
    const use = (program) => {
      gl.useProgram(program.made);
      gl.uniformMatrix4fv(program.view, false, columns);
      gl.uniformMatrix4fv(program.projection, false, projection);
    };
    if (this.bounds) this.drawBox(use, origin);
    if (!this.points?.n) return;
    const { n, values, colors } = this.points;
    use(this.balls);
    gl.uniform1f(this.balls.size, this.size * this.spacing() * height);
    gl.uniform1f(this.balls.low, this.range[0]);
    gl.uniform1f(this.balls.high, this.range[1]);
    gl.uniform1i(this.balls.valued, values ? 1 : 0);
    const attribute = (at, size, kind, on) => {
      if (on) {
        gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[at]);
        gl.enableVertexAttribArray(at);
        gl.vertexAttribPointer(at, size, kind, kind === gl.UNSIGNED_BYTE, 0, 0);
      } else {
        gl.disableVertexAttribArray(at);
      }
    };
    attribute(0, 3, gl.FLOAT, true);
    attribute(1, 1, gl.FLOAT, values);
    attribute(2, 4, gl.UNSIGNED_BYTE, colors);
    if (!values && !colors) gl.vertexAttrib4f(2, 0.35, 0.6, 0.9, 1);
    gl.drawArrays(gl.POINTS, 0, n);
  }

  /** A point's size: about as far as points lie apart when they fill a fifth of the domain. */
  spacing() {
    const [min, max] = this.bounds ?? [
      [0, 0, 0],
      [1, 1, 1],
    ];
    const sides = sub(max, min).filter((side) => side > 0);
    const room = sides.reduce((product, side) => product * side, 1) / 5;
    return 0.75 * (room / Math.max(this.points.n, 50)) ** (1 / sides.length);
  }

  drawBox(use, origin) {
    const { gl } = this;
    const [min, max] = this.bounds.map((corner) => sub(corner, origin));
    const corner = (k) => [0, 1, 2].map((axis) => (k & (1 << axis) ? max : min)[axis]);
    const edges = [];
    for (let k = 0; k < 8; k += 1) {
      for (const bit of [1, 2, 4]) if (!(k & bit)) edges.push(...corner(k), ...corner(k | bit));
    }
    use(this.lines);
    gl.uniform3fv(this.lines.ink, this.ink ?? [0.55, 0.58, 0.64]);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[3]);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(edges), gl.DYNAMIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    [1, 2].forEach((at) => gl.disableVertexAttribArray(at));
    gl.drawArrays(gl.LINES, 0, edges.length / 3);
  }

  /** Frees what the graphics card holds. */
  close() {
    this.buffers.forEach((buffer) => this.gl.deleteBuffer(buffer));
    this.gl.getExtension("WEBGL_lose_context")?.loseContext();
  }
}

/** The corners of a scene's domain, and whether it is 2D. */
export function domain(scene) {
  const flat = scene.dimension === 2;
  const three = (corner) => [0, 1, 2].map((axis) => corner[axis] ?? 0);
  return { min: three(scene.domain.min), max: three(scene.domain.max), flat };
}

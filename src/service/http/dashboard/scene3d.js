// Points and colliders in a box, drawn with WebGL. The camera turns around a target; everything is relative to the
// points' origin, so that far domains lose no digits.

import { programs } from "./shaders.js";

/** Half of the angle that the view is high. */
const HALF_ANGLE = (19 * Math.PI) / 180;

const sub = (a, b) => a.map((x, i) => x - b[i]);
const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

/** The rows of a rotation, of a unit quaternion x, y, z, w. */
const rotation = ([x, y, z, w]) => [
  [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
  [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
  [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
];
const unit = (a) => a.map((x) => x / Math.hypot(...a));

export class Scene3D {
  points = null;
  /** Colliders of the frame ([`solids.js`]), and how they are drawn: `solid`, `through` or `hidden`. */
  solids = [];
  style = "solid";
  meshes = new Map();
  bounds = null;
  range = [0, 1];
  size = 1;
  /** How far particles lie apart at first (m), and how many there are. */
  pitch = 0.01;
  particles = 0;
  fitted = null;
  /** Degrees above the floor and around it, the distance, and what is looked at (m, absolute). */
  camera = { azimuth: -60, elevation: 22, distance: 3, target: [0, 0, 0] };

  /** Throws where there is no WebGL 2. */
  constructor(canvas) {
    this.canvas = canvas;
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: true, preserveDrawingBuffer: true });
    if (!gl) throw new Error("This browser has no WebGL 2, which the view is drawn with.");
    this.gl = gl;
    Object.assign(this, programs(gl));
    this.buffers = ["position", "value", "color", "box"].map(() => gl.createBuffer());
    gl.enable(gl.DEPTH_TEST);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
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
    const shown = this.style === "hidden" ? [] : this.solids;
    const through = (solid) => solid.translucent || this.style === "through";
    this.drawSolids(use, origin, (solid) => !through(solid), shown, 1);
    // What is flat has nothing behind anything.
    if (this.flat) gl.clear(gl.DEPTH_BUFFER_BIT);
    if (this.points?.n) this.drawPoints(use, height);
    gl.enable(gl.BLEND);
    gl.enable(gl.CULL_FACE);
    gl.depthMask(false);
    this.drawSolids(use, origin, through, shown, 0.35);
    gl.depthMask(true);
    gl.disable(gl.CULL_FACE);
    gl.disable(gl.BLEND);
    this.drawn?.({ right, up });
  }

  drawPoints(use, height) {
    const { gl } = this;
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

  /** Draws those of `solids` that are `wanted`. */
  drawSolids(use, origin, wanted, solids, alpha) {
    const { gl } = this;
    const list = solids.filter((solid) => wanted(solid) && solid.mesh.triangles.length);
    if (!list.length) return;
    use(this.faces);
    gl.uniform4f(this.faces.ink, 0.6, 0.64, 0.7, alpha);
    [1, 2].forEach((at) => gl.disableVertexAttribArray(at));
    for (const { mesh, position, orientation } of list) {
      const { corners, faces, base, n } = this.meshOf(mesh);
      const turn = rotation(orientation);
      const at = sub(
        turn.map((row, i) => dot(row, base) + position[i]),
        origin,
      );
      const model = [0, 1, 2].flatMap((i) => [turn[0][i], turn[1][i], turn[2][i], 0]);
      gl.uniformMatrix4fv(this.faces.model, false, [...model, ...at, 1]);
      gl.bindBuffer(gl.ARRAY_BUFFER, corners);
      gl.enableVertexAttribArray(0);
      gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, faces);
      gl.drawElements(gl.TRIANGLES, n, gl.UNSIGNED_INT, 0);
    }
  }

  /** A mesh on the graphics card, relative to its first corner; those that are no longer shown are freed. */
  meshOf(mesh) {
    const { gl } = this;
    let kept = this.meshes.get(mesh);
    if (kept) return kept;
    const shown = new Set(this.solids.map((solid) => solid.mesh));
    for (const [old, buffers] of this.meshes) {
      if (shown.has(old)) continue;
      [buffers.corners, buffers.faces].forEach((buffer) => gl.deleteBuffer(buffer));
      this.meshes.delete(old);
    }
    const base = mesh.vertices.slice(0, 3);
    const upload = (kind, data) => {
      const buffer = gl.createBuffer();
      gl.bindBuffer(kind, buffer);
      gl.bufferData(kind, data, gl.STATIC_DRAW);
      return buffer;
    };
    const corners = upload(gl.ARRAY_BUFFER, new Float32Array(mesh.vertices.map((x, k) => x - base[k % 3])));
    const faces = upload(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(mesh.triangles));
    kept = { corners, faces, base, n: mesh.triangles.length };
    this.meshes.set(mesh, kept);
    return kept;
  }

  /** A point's size: a little more than particles lie apart, if those that are shown stand for all. */
  spacing() {
    const { pitch, particles, flat } = this;
    const share = Math.max(1, (particles || this.points.n) / this.points.n);
    return (flat ? 1.1 : 1.4) * pitch * share ** (1 / (flat ? 2 : 3));
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
    this.meshes.clear();
    this.gl.getExtension("WEBGL_lose_context")?.loseContext();
  }
}

/** The corners of a scene's domain, whether it is 2D, and how far its particles lie apart (m). */
export function domain(scene) {
  const flat = scene.dimension === 2;
  const three = (corner) => [0, 1, 2].map((axis) => corner[axis] ?? 0);
  const perCell = scene.bodies?.[0]?.particles_per_cell ?? (flat ? 4 : 8);
  const pitch = scene.domain.dx / perCell ** (1 / (flat ? 2 : 3));
  return { min: three(scene.domain.min), max: three(scene.domain.max), flat, pitch };
}

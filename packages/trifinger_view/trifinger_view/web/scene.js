// SPDX-License-Identifier: BSD-3-Clause
// Draws bodies with WebGL 2: coloured triangles, a lamp with soft shadows, a sky, bodies that one sees
// through, arrows and handles. Lengths are in metres, z points up, quaternions are w, x, y, z.

const VERTEX = `#version 300 es
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec4 colour;
uniform mat4 model, camera, lamp, zenith;
uniform vec4 middle;
out vec3 place, facing;
out vec4 paint, shade, cover;
void main() {
  vec4 world = model * vec4(position, 1.0);
  place = world.xyz;
  facing = mat3(model) * normal;
  paint = colour;
  shade = lamp * world;
  cover = zenith * (world + vec4(normalize(facing) * 0.03 * middle.w, 0.0));
  gl_Position = camera * world;
}`;

const FRAGMENT = `precision highp float;
precision highp sampler2DShadow;
in vec3 place, facing;
in vec4 paint, shade, cover;
uniform vec3 eye, toLamp, horizon;
uniform vec4 tint;  // a colour instead of the body's own, as far as its last number says
uniform vec4 middle;  // what is much farther from it than its last number fades into the horizon
uniform vec4 cut;  // what lies farther than the last number in this direction is not drawn
uniform float opacity;
uniform float grid;  // between the lines of a floor; 0 without lines
uniform sampler2DShadow shadows, covers;
out vec4 pixel;
float lit(sampler2DShadow map, vec3 at, float bias) {
  if (any(lessThan(at, vec3(0.0))) || any(greaterThan(at, vec3(1.0)))) return 1.0;
  float sum = 0.0;
  vec2 size = 1.0 / vec2(textureSize(map, 0));
  for (float x = -1.5; x < 2.0; ++x)
    for (float y = -1.5; y < 2.0; ++y) sum += texture(map, vec3(at.xy + vec2(x, y) * size, at.z - bias));
  return sum / 16.0;
}
void main() {
  if (dot(place, cut.xyz) > cut.w) discard;
  vec3 normal = normalize(facing), look = normalize(eye - place);
  if (dot(normal, look) < 0.0) normal = -normal;
  vec3 own = mix(paint.rgb, tint.rgb, tint.a);
  own *= own;
  float alpha = paint.a * opacity;
  float away = smoothstep(2.2, 6.0, length(place - middle.xyz) / middle.w);
  if (grid > 0.0) {
    vec2 at = place.xy / grid, wide = max(fwidth(at), 1e-4);
    vec2 line = 1.0 - smoothstep(vec2(0.0), 1.3 * wide, abs(fract(at - 0.5) - 0.5));
    own *= 1.0 - 0.16 * max(line.x, line.y) * (1.0 - smoothstep(0.15, 0.5, max(wide.x, wide.y)));
  }
  float shadow = 1.0, open = 1.0, facesLamp = max(dot(normal, toLamp), 0.0);
#ifdef SHADOWS
  shadow = lit(shadows, shade.xyz * 0.5 + 0.5, 0.0012 + 0.003 * (1.0 - facesLamp));
  open = mix(0.5, 1.0, lit(covers, cover.xyz * 0.5 + 0.5, 0.004));
#endif
  vec3 light = mix(vec3(0.26, 0.25, 0.24), vec3(0.46, 0.48, 0.51), 0.5 + 0.5 * normal.z) * open;
  light += vec3(0.72, 0.70, 0.66) * facesLamp * shadow;
  light += vec3(0.10, 0.11, 0.13) * max(dot(normal, vec3(-0.555, 0.678, 0.482)), 0.0);
  float gloss = 0.14 * pow(max(dot(normal, normalize(toLamp + look)), 0.0), 48.0) * shadow;
  float edge = 1.0 - max(dot(normal, look), 0.0);
  gloss += 0.05 * edge * edge * edge * edge * open;
  vec3 bright = own * light + gloss, much = max(bright - 0.8, 0.0);
  bright = min(bright, 0.8) + much / (1.0 + 5.0 * much);  // nothing is washed out
  pixel = vec4(mix(sqrt(bright), horizon, away), alpha);
}`;

const SHADOW_VERTEX = `#version 300 es
layout(location = 0) in vec3 position;
uniform mat4 model, lamp;
void main() { gl_Position = lamp * model * vec4(position, 1.0); }`;
const SHADOW_FRAGMENT = `#version 300 es
precision mediump float;
void main() {}`;

// The sky behind everything: one triangle that covers the picture.
const SKY_VERTEX = `#version 300 es
uniform vec3 forward, right, up;
out vec3 ray;
void main() {
  vec2 at = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
  ray = forward + at.x * right + at.y * up;
  gl_Position = vec4(at, 1.0, 1.0);
}`;
const SKY_FRAGMENT = `#version 300 es
precision highp float;
in vec3 ray;
uniform vec3 horizon, heaven;
out vec4 pixel;
void main() { pixel = vec4(mix(horizon, heaven, smoothstep(0.0, 0.7, normalize(ray).z)), 1.0); }`;

const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const scaled = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const added = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const unit = (a) => scaled(a, 1 / (Math.hypot(...a) || 1));

// Matrices are in columns, as WebGL has them.
function product(a, b) {
  const c = new Float32Array(16);
  for (let i = 0; i < 4; ++i) {
    for (let j = 0; j < 4; ++j) {
      for (let k = 0; k < 4; ++k) c[4 * i + j] += a[4 * k + j] * b[4 * i + k];
    }
  }
  return c;
}

const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];

function lookAt(eye, target, up) {
  const z = unit(minus(eye, target));
  const x = unit(cross(up, z));
  const y = cross(z, x);
  return new Float32Array([x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0,
    -dot(x, eye), -dot(y, eye), -dot(z, eye), 1]);
}

function perspective(angle, aspect, near, far) {
  const f = 1 / Math.tan(angle / 2);
  return new Float32Array([f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1,
    0, 0, 2 * far * near / (near - far), 0]);
}

function orthographic(size, near, far) {
  return new Float32Array([1 / size, 0, 0, 0, 0, 1 / size, 0, 0, 0, 0, 2 / (near - far), 0,
    0, 0, (far + near) / (near - far), 1]);
}

// The matrix of a pose: x, y, z, then the quaternion.
function matrixOf([px, py, pz, w, x, y, z]) {
  return new Float32Array([
    1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y), 0,
    2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x), 0,
    2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y), 0,
    px, py, pz, 1]);
}

// An arrow of length 1 along z with a thickness of 1.
function arrowMesh() {
  const points = [], normals = [], sides = 16;
  const ring = (r0, z0, r1, z1) => {
    for (let i = 0; i < sides; ++i) {
      const [a, b] = [i, i + 1].map((k) => [Math.cos(2 * Math.PI * k / sides), Math.sin(2 * Math.PI * k / sides)]);
      const corners = [[r0, z0, a], [r0, z0, b], [r1, z1, b], [r0, z0, a], [r1, z1, b], [r1, z1, a]];
      for (const [r, z, at] of corners) {
        points.push(r * at[0], r * at[1], z);
        normals.push(127 * at[0], 127 * at[1], r1 === r0 ? 0 : 64, 0);
      }
    }
  };
  ring(0.5, 0, 0.5, 0.7);
  ring(1.1, 0.7, 0, 1);
  return {positions: new Float32Array(points), normals: Int8Array.from(normals),
    colours: new Uint8Array(points.length / 3 * 4).fill(255),
    triangles: Uint32Array.from({length: points.length / 3}, (_, i) => i)};
}

// A ball with a radius of 1.
function ballMesh() {
  const points = [], normals = [], triangles = [], sides = 16;
  for (let i = 0; i <= sides; ++i) {
    for (let j = 0; j <= sides; ++j) {
      const [a, b] = [Math.PI * i / sides, 2 * Math.PI * j / sides];
      const at = [Math.sin(a) * Math.cos(b), Math.sin(a) * Math.sin(b), Math.cos(a)];
      points.push(...at);
      normals.push(...scaled(at, 127), 0);
      const k = i * (sides + 1) + j;
      if (i < sides && j < sides) triangles.push(k, k + sides + 1, k + 1, k + 1, k + sides + 1, k + sides + 2);
    }
  }
  return {positions: new Float32Array(points), normals: Int8Array.from(normals),
    colours: new Uint8Array(points.length / 3 * 4).fill(255), triangles: Uint32Array.from(triangles)};
}

function squareMesh() {
  return {positions: new Float32Array([-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0]),
    normals: new Int8Array([0, 0, 127, 0, 0, 0, 127, 0, 0, 0, 127, 0, 0, 0, 127, 0]),
    colours: new Uint8Array(16).fill(255), triangles: new Uint32Array([0, 1, 2, 0, 2, 3])};
}

const AXES = [[[1, 0, 0], [0.84, 0.20, 0.22, 1]], [[0, 1, 0], [0.20, 0.65, 0.30, 1]], [[0, 0, 1], [0.16, 0.42, 0.88, 1]]];
const HANDLE = 58;  // length of the arrows of a handle [pixels]
const SOFTWARE = /SwiftShader|llvmpipe|softpipe|Microsoft Basic Render/i;
const HOT = [1, 0.75, 0.1, 1];  // colour of the part of a handle that is under the mouse

class Scene {
  // A plain scene has no shadows. It is meant for browsers without a graphics card, and begins so in them.
  constructor(canvas, isPlain = false) {
    this.canvas = canvas;
    this.bodies = [];
    const trial = document.createElement("canvas").getContext("webgl2");
    if (!trial) throw new Error("this browser has no WebGL 2");
    const names = trial.getExtension("WEBGL_debug_renderer_info");
    const isSlow = SOFTWARE.test(trial.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : trial.RENDERER));
    this.isPlain = isPlain || isSlow;
    this.gl = canvas.getContext("webgl2", {antialias: !isSlow});
    const version = "#version 300 es\n";
    this.plain = this.program(VERTEX, version + FRAGMENT);
    this.lit = this.program(VERTEX, `${version}#define SHADOWS\n${FRAGMENT}`);
    this.shadow = this.program(SHADOW_VERTEX, SHADOW_FRAGMENT);
    this.sky = this.program(SKY_VERTEX, SKY_FRAGMENT);
    this.depth = this.shadowMap(640);
    this.cover = this.shadowMap(64);
    [this.arrow, this.ball, this.square] = [arrowMesh(), ballMesh(), squareMesh()].map((mesh) => this.upload(mesh));
    this.toLamp = unit([0.45, -0.55, 1.1]);
    this.begin({middle: [0, 0, 0.2], radius: 0.5, azimuth: 5.15, elevation: 0.42, fieldOfView: 0.66, floor: 0});
    this.listen();
    new ResizeObserver(() => this.requestDraw()).observe(canvas);
  }

  // Forgets bodies, arrows and handles; onDrag(handle, point) and onDrop(handle) say what the mouse does
  // with a handle. `home` is where the camera begins: a sphere that fills the picture, and the
  // direction from it to the eye; and the height of the floor. If the camera stays, it is as somebody turned it.
  begin(home, cameraStays = false) {
    for (const {mesh} of this.bodies) {
      this.gl.deleteVertexArray(mesh.array);
      for (const buffer of mesh.buffers) this.gl.deleteBuffer(buffer);
    }
    const target = cameraStays ? added(this.target, minus(home.middle, this.middle)) : null;
    Object.assign(this, {bodies: [], arrows: [], handles: [], anchor: null, home, middle: home.middle});
    if (cameraStays) Object.assign(this, {target}); else this.goHome();
    this.requestDraw();
  }

  program(vertex, fragment) {
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    const places = {};
    const count = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS);
    for (let i = 0; i < count; ++i) {
      const {name} = gl.getActiveUniform(program, i);
      places[name] = gl.getUniformLocation(program, name);
    }
    return {program, places};
  }

  shadowMap(size) {
    const gl = this.gl, texture = gl.createTexture(), buffer = gl.createFramebuffer();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.DEPTH_COMPONENT24, size, size);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE);
    for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, side, gl.CLAMP_TO_EDGE);
    for (const way of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, way, gl.LINEAR);
    gl.bindFramebuffer(gl.FRAMEBUFFER, buffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, texture, 0);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return {size, texture, buffer};
  }

  upload({positions, normals, colours, triangles}) {
    const gl = this.gl, array = gl.createVertexArray(), buffers = [];
    gl.bindVertexArray(array);
    const attribute = (place, data, size, type, isNormalised) => {
      buffers.push(gl.createBuffer());
      gl.bindBuffer(gl.ARRAY_BUFFER, buffers.at(-1));
      gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, size, type, isNormalised, 0, 0);
    };
    attribute(0, positions, 3, gl.FLOAT, false);
    attribute(1, normals, 4, gl.BYTE, true);
    attribute(2, colours, 4, gl.UNSIGNED_BYTE, true);
    buffers.push(gl.createBuffer());
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers.at(-1));
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, triangles, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    return {array, buffers, count: triangles.length};
  }

  // A body has these properties; whoever changes them calls requestDraw(). Of a body that surrounds the others,
  // the part in front of them is not drawn.
  add(mesh, more) {
    const body = {mesh, pose: [0, 0, 0, 1, 0, 0, 0], isVisible: true, isFaint: false, isSurround: false,
      opacity: 1, tint: [0, 0, 0, 0], ...more};
    this.bodies.push(body);
    return body;
  }

  // Draws once before the browser's next picture.
  requestDraw() {
    if (this.isDrawRequested) return;
    this.isDrawRequested = true;
    requestAnimationFrame(() => { this.isDrawRequested = false; this.draw(); });
  }

  goHome() {
    Object.assign(this, {azimuth: this.home.azimuth, elevation: this.home.elevation, target: this.middle, zoom: 1});
    this.requestDraw();
  }

  // Goes after bodies that walk away; small movements of their middle do not move the camera.
  follow(middle) {
    this.anchor ??= middle;
    const way = minus(middle, this.anchor), length = Math.hypot(...way), slack = 0.35 * this.home.radius;
    if (length < slack) return;
    const step = scaled(way, 0.1 * (length - slack) / length);
    [this.anchor, this.target, this.middle] = [this.anchor, this.target, this.middle].map((one) => added(one, step));
  }

  // Where the eye is and where it looks: directions of the middle of the picture, its right and its top,
  // as long as the picture is wide and high at a distance of 1.
  get view() {
    const {clientWidth, clientHeight} = this.canvas, aspect = clientWidth / clientHeight || 1;
    const high = Math.tan(this.home.fieldOfView / 2), wide = high * aspect;
    const distance = this.zoom * this.home.radius / Math.sin(Math.atan(Math.min(high, wide)));
    const flat = Math.cos(this.elevation);
    const away = [flat * Math.cos(this.azimuth), flat * Math.sin(this.azimuth), Math.sin(this.elevation)];
    const right = unit(cross([0, 0, 1], away)), up = cross(away, right);
    return {aspect, high, wide, distance, away, right, up, eye: added(this.target, scaled(away, distance))};
  }

  // Where a point is in the picture, from its upper left corner [pixels].
  project(point) {
    const {high, wide, away, right, up, eye} = this.view, way = minus(point, eye), depth = -dot(way, away);
    const {clientWidth, clientHeight} = this.canvas;
    return [(1 + dot(way, right) / depth / wide) / 2 * clientWidth, (1 - dot(way, up) / depth / high) / 2 * clientHeight];
  }

  // The length at a point that one pixel shows [m].
  pixelAt(point) {
    const {high, away, eye} = this.view;
    return 2 * high * -dot(minus(point, eye), away) / this.canvas.clientHeight;
  }

  draw() {
    const gl = this.gl, scale = window.devicePixelRatio || 1;
    const width = Math.round(this.canvas.clientWidth * scale), height = Math.round(this.canvas.clientHeight * scale);
    if (!width || !height) return;
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, {width, height});
    const things = this.bodies.filter((body) => body.isVisible)
      .map((body) => ({...body, matrix: matrixOf(body.pose)}));
    const view = this.view, {radius} = this.home, reach = 1.6 * radius;
    const from = (direction, up) => product(orthographic(reach, 0.1 * radius, 8 * radius),
      lookAt(added(this.middle, scaled(direction, 4 * radius)), this.middle, up));
    const lamp = from(this.toLamp, [0, 1, 0]), zenith = from([0, 0, 1], [0, 1, 0]);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    if (!this.isPlain) {
      gl.useProgram(this.shadow.program);
      for (const [map, matrix] of [[this.depth, lamp], [this.cover, zenith]]) {
        gl.bindFramebuffer(gl.FRAMEBUFFER, map.buffer);
        gl.viewport(0, 0, map.size, map.size);
        gl.clear(gl.DEPTH_BUFFER_BIT);
        gl.uniformMatrix4fv(this.shadow.places.lamp, false, matrix);
        for (const thing of things) {
          if (thing.isFaint || thing.isSurround) continue;
          gl.uniformMatrix4fv(this.shadow.places.model, false, thing.matrix);
          this.drawMesh(thing.mesh);
        }
      }
      gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    }
    gl.viewport(0, 0, width, height);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    const style = getComputedStyle(document.body);
    const colour = (name) => [1, 3, 5].map((at) => parseInt(style.getPropertyValue(name).trim().slice(at, at + 2), 16) / 255);
    const horizon = colour("--horizon");
    gl.disable(gl.DEPTH_TEST);
    gl.useProgram(this.sky.program);
    gl.uniform3fv(this.sky.places.forward, scaled(view.away, -1));
    gl.uniform3fv(this.sky.places.right, scaled(view.right, view.wide));
    gl.uniform3fv(this.sky.places.up, scaled(view.up, view.high));
    gl.uniform3fv(this.sky.places.horizon, horizon);
    gl.uniform3fv(this.sky.places.heaven, colour("--heaven"));
    gl.bindVertexArray(null);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.enable(gl.DEPTH_TEST);
    const lens = perspective(this.home.fieldOfView, view.aspect, 0.02 * view.distance, 20 * view.distance + 20);
    const camera = product(lens, lookAt(view.eye, this.target, [0, 0, 1]));
    let places;
    const use = (one) => {
      places = one.places;
      gl.useProgram(one.program);
      for (const [name, matrix] of Object.entries({camera, lamp, zenith})) gl.uniformMatrix4fv(places[name], false, matrix);
      gl.uniform3fv(places.eye, view.eye);
      gl.uniform3fv(places.toLamp, this.toLamp);
      gl.uniform3fv(places.horizon, horizon);
      gl.uniform4fv(places.middle, [...this.middle, radius]);
      gl.uniform1i(places.covers, 1);
    };
    use(this.isPlain ? this.plain : this.lit);
    for (const [unit, map] of [this.depth, this.cover].entries()) {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, map.texture);
    }
    const flat = unit([view.away[0], view.away[1], 0]), nothing = [0, 0, 0, 1];
    const front = [...flat, dot(flat, this.middle) - 0.05];
    const paint = (thing) => {
      gl.uniform4fv(places.cut, thing.isSurround ? front : nothing);
      gl.uniformMatrix4fv(places.model, false, thing.matrix);
      gl.uniform4fv(places.tint, thing.tint);
      gl.uniform1f(places.opacity, thing.opacity);
      gl.uniform1f(places.grid, thing.grid ?? 0);
      this.drawMesh(thing.mesh);
    };
    const size = 12 * radius, [x, y] = this.middle, grid = 10 ** Math.floor(Math.log10(radius) + 0.3);
    paint({mesh: this.square, opacity: 1, tint: [...colour("--floor"), 1], grid,
      matrix: new Float32Array([size, 0, 0, 0, 0, size, 0, 0, 0, 0, 1, 0, x, y, this.home.floor, 1])});
    things.filter((thing) => !thing.isFaint).forEach(paint);
    // Of a body that one sees through, only the nearest surface is drawn: first its depth, then its colour.
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    const faint = things.filter((thing) => thing.isFaint);
    gl.colorMask(false, false, false, false);
    faint.forEach(paint);
    gl.colorMask(true, true, true, true);
    faint.forEach(paint);
    // Forces act inside of what is touched, so nothing hides their arrows, nor handles, or casts shadows on them.
    gl.clear(gl.DEPTH_BUFFER_BIT);
    use(this.plain);
    const arrow = ({at, along, thickness, tint}) => {
      const length = Math.hypot(...along);
      if (!(length > 1e-4)) return;
      const z = unit(along), x = unit(cross(Math.abs(z[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0], z)), y = cross(z, x);
      paint({mesh: this.arrow, opacity: 1, tint, matrix: new Float32Array([
        ...scaled(x, thickness), 0, ...scaled(y, thickness), 0, ...along, 0, ...at, 1])});
    };
    this.arrows.forEach(arrow);
    for (const handle of this.handles) {
      const size = HANDLE * this.pixelAt(handle.at), isHot = (part) => this.hot?.handle === handle && this.hot.part === part;
      AXES.forEach(([axis, tint], part) => arrow({at: handle.at, along: scaled(axis, size), thickness: 0.075 * size,
        tint: isHot(part) ? HOT : tint}));
      const [r, [x, y, z]] = [0.14 * size, handle.at];
      paint({mesh: this.ball, opacity: 1, tint: isHot(3) ? HOT : [0.95, 0.95, 0.97, 1],
        matrix: new Float32Array([r, 0, 0, 0, 0, r, 0, 0, 0, 0, r, 0, x, y, z, 1])});
    }
    gl.disable(gl.BLEND);
  }

  drawMesh(mesh) {
    this.gl.bindVertexArray(mesh.array);
    this.gl.drawElements(this.gl.TRIANGLES, mesh.count, this.gl.UNSIGNED_INT, 0);
  }

  turn(x, y) {
    this.azimuth -= 0.008 * x;
    this.elevation = Math.min(Math.max(this.elevation + 0.008 * y, -1.5), 1.55);
    this.requestDraw();
  }

  shift(x, y) {
    const step = this.pixelAt(this.target), {right, up} = this.view;
    this.target = added(this.target, added(scaled(right, -x * step), scaled(up, y * step)));
    this.requestDraw();
  }

  closer(factor) {
    this.zoom = Math.min(Math.max(this.zoom * factor, 0.05), 12);
    this.requestDraw();
  }

  // The part of a handle at a pixel: an arrow 0, 1, 2, or 3, the ball, which moves in the plane of the picture.
  pick([x, y], slack) {
    let found = null, least = slack;
    for (const handle of this.handles) {
      if (!(this.pixelAt(handle.at) > 0)) continue;  // behind the eye
      const at = this.project(handle.at), size = HANDLE * this.pixelAt(handle.at);
      const near = (part, distance) => { if (distance < least) [found, least] = [{handle, part}, distance]; };
      near(3, Math.hypot(x - at[0], y - at[1]) - 6);
      for (const [part, [axis]] of AXES.entries()) {
        const end = this.project(added(handle.at, scaled(axis, size))), way = [end[0] - at[0], end[1] - at[1]];
        const share = ((x - at[0]) * way[0] + (y - at[1]) * way[1]) / (way[0] ** 2 + way[1] ** 2 || 1);
        if (share < 0.2) continue;
        const most = Math.min(share, 1);
        near(part, Math.hypot(x - at[0] - most * way[0], y - at[1] - most * way[1]));
      }
    }
    return found;
  }

  // The point to which the mouse at a pixel moves a part of a handle that was at `start`.
  pointOf([x, y], part, start) {
    const {high, wide, away, right, up, eye} = this.view, {clientWidth, clientHeight} = this.canvas;
    const ray = unit(added(scaled(away, -1), added(scaled(right, (2 * x / clientWidth - 1) * wide),
      scaled(up, (1 - 2 * y / clientHeight) * high))));
    const way = minus(start, eye);
    if (part === 3) return added(eye, scaled(ray, dot(way, away) / dot(ray, away)));
    const axis = AXES[part][0], lean = dot(axis, ray);  // the point of the axis that is nearest to the ray
    return 1 - lean * lean < 1e-3 ? start : added(start, scaled(axis, (lean * dot(way, ray) - dot(way, axis)) / (1 - lean * lean)));
  }

  listen() {
    const canvas = this.canvas, fingers = new Map(), held = new Map();  // both by the number of the pointer
    const place = (event) => [event.offsetX, event.offsetY];
    const slackOf = (event) => event.pointerType === "touch" ? 22 : 9;
    const spread = () => {
      const [a, b] = [...fingers.values()];
      return Math.hypot(a[0] - b[0], a[1] - b[1]) || 1;
    };
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("dblclick", () => this.goHome());
    canvas.addEventListener("webglcontextlost", () => location.reload());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.closer(Math.exp(0.0012 * event.deltaY * (event.deltaMode ? 30 : 1)));
    }, {passive: false});
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, place(event));
      const found = event.button === 0 && fingers.size === held.size + 1 ? this.pick(place(event), slackOf(event)) : null;
      if (!found || found.handle.isHeld) return;
      const start = [...found.handle.at], grip = minus(this.pointOf(place(event), found.part, start), start);
      this.hot = {...found, start, grip};
      held.set(event.pointerId, this.hot);
      found.handle.isHeld = true;
      this.requestDraw();
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) {
        this.hot = this.pick(place(event), slackOf(event));
        canvas.classList.toggle("hot", Boolean(this.hot));
        if (this.handles.length) this.requestDraw();
        return;
      }
      const [x, y] = minus(place(event), before);
      const was = fingers.size === 2 ? spread() : 0;
      fingers.set(event.pointerId, place(event));
      if (held.size) {
        const own = held.get(event.pointerId);
        if (!own) return;
        own.handle.at = minus(this.pointOf(place(event), own.part, own.start), own.grip);
        this.onDrag(own.handle, own.handle.at);
        this.requestDraw();
        return;
      }
      if (fingers.size === 2) {
        this.closer(was / spread());
        this.shift(x / 2, y / 2);
      } else if (event.buttons & 6 || event.shiftKey) {
        this.shift(x, y);
      } else {
        this.turn(x, y);
      }
    });
    for (const kind of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(kind, (event) => {
        const own = held.get(event.pointerId);
        fingers.delete(event.pointerId);
        held.delete(event.pointerId);
        if (!own) return;
        own.handle.isHeld = false;
        this.onDrop(own.handle);
        for (const {handle} of held.values()) this.onDrag(handle, handle.at);  // a hand pulls at one alone
        this.hot = null;
        this.requestDraw();
      });
    }
  }
}

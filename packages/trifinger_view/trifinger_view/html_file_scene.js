// SPDX-License-Identifier: BSD-3-Clause
// Draws bodies with WebGL 2: coloured triangles, a lamp with a shadow, bodies that one sees through,
// and arrows. Lengths are in metres, z points up, quaternions are w, x, y, z.

const VERTEX = `#version 300 es
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec4 colour;
uniform mat4 model, camera, lamp;
out vec3 place, facing;
out vec4 paint, shade;
void main() {
  vec4 world = model * vec4(position, 1.0);
  place = world.xyz;
  facing = mat3(model) * normal;
  paint = colour;
  shade = lamp * world;
  gl_Position = camera * world;
}`;

const FRAGMENT = `#version 300 es
precision highp float;
precision highp sampler2DShadow;
in vec3 place, facing;
in vec4 paint, shade;
uniform vec3 eye, toLamp;
uniform vec4 tint;  // a colour instead of the body's own, as far as its last number says
uniform float opacity;
uniform vec4 cut;  // what lies farther than the last number in this direction is not drawn
uniform sampler2DShadow shadows;
out vec4 pixel;
float lit(vec3 normal) {
  vec3 at = shade.xyz / shade.w * 0.5 + 0.5;
  if (any(lessThan(at, vec3(0.0))) || any(greaterThan(at, vec3(1.0)))) return 1.0;
  float bias = 0.0006 + 0.0025 * (1.0 - max(dot(normal, toLamp), 0.0));
  float sum = 0.0;
  vec2 size = 1.0 / vec2(textureSize(shadows, 0));
  for (int x = -1; x <= 1; ++x)
    for (int y = -1; y <= 1; ++y) sum += texture(shadows, vec3(at.xy + vec2(x, y) * 1.3 * size, at.z - bias));
  return sum / 9.0;
}
void main() {
  if (dot(place, cut.xyz) > cut.w) discard;
  vec3 normal = normalize(facing), look = normalize(eye - place);
  if (dot(normal, look) < 0.0) normal = -normal;
  vec3 own = pow(mix(paint.rgb, tint.rgb, tint.a), vec3(2.2));
  float sky = 0.5 + 0.5 * normal.z;
  vec3 light = mix(vec3(0.24, 0.23, 0.22), vec3(0.42, 0.44, 0.47), sky);
  float shadow = lit(normal);
  light += 0.62 * max(dot(normal, toLamp), 0.0) * shadow;
  light += 0.12 * max(dot(normal, normalize(vec3(-toLamp.x, -toLamp.y, 0.4))), 0.0);
  float gloss = 0.10 * pow(max(dot(normal, normalize(toLamp + look)), 0.0), 32.0) * shadow;
  pixel = vec4(pow(own * light + gloss, vec3(1.0 / 2.2)), paint.a * opacity);
}`;

const SHADOW_VERTEX = `#version 300 es
layout(location = 0) in vec3 position;
uniform mat4 model, lamp;
void main() { gl_Position = lamp * model * vec4(position, 1.0); }`;
const SHADOW_FRAGMENT = `#version 300 es
precision mediump float;
void main() {}`;

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

function lookAt(eye, target, up) {
  const z = unit(added(eye, scaled(target, -1)));
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

class Scene {
  // `home` is where the camera begins: {target, distance, azimuth, elevation, fieldOfView}, angles
  // in radians.
  constructor(canvas, home) {
    this.canvas = canvas;
    this.home = home;
    this.bodies = [];
    this.arrows = [];
    const gl = canvas.getContext("webgl2", {antialias: true});
    if (!gl) throw new Error("this browser has no WebGL 2");
    this.gl = gl;
    this.main = this.program(VERTEX, FRAGMENT);
    this.shadow = this.program(SHADOW_VERTEX, SHADOW_FRAGMENT);
    this.depth = this.shadowMap(2048);
    this.arrow = this.upload(arrowMesh());
    const reach = Math.max(home.distance, 0.3);
    this.toLamp = unit([0.45, -0.55, 1.1]);
    const from = added(home.target, scaled(this.toLamp, 2 * reach));
    this.lamp = product(orthographic(0.75 * reach, 0.1 * reach, 4 * reach), lookAt(from, home.target, [0, 1, 0]));
    this.goHome();
    this.listen();
    this.isAsked = false;
    new ResizeObserver(() => this.ask()).observe(canvas);
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
    const gl = this.gl, array = gl.createVertexArray();
    gl.bindVertexArray(array);
    const attribute = (place, data, size, type, isNormalised) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, size, type, isNormalised, 0, 0);
    };
    attribute(0, positions, 3, gl.FLOAT, false);
    attribute(1, normals, 4, gl.BYTE, true);
    attribute(2, colours, 4, gl.UNSIGNED_BYTE, true);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, triangles, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    return {array, count: triangles.length};
  }

  // A body has these properties; whoever changes them calls ask(). Of a body that surrounds the others,
  // the part in front of them is not drawn.
  add(mesh, more) {
    const body = {mesh, pose: [0, 0, 0, 1, 0, 0, 0], isVisible: true, isFaint: false, isSurround: false,
      opacity: 1, tint: [0, 0, 0, 0], ...more};
    this.bodies.push(body);
    return body;
  }

  // Draws once before the browser's next picture.
  ask() {
    if (this.isAsked) return;
    this.isAsked = true;
    requestAnimationFrame(() => { this.isAsked = false; this.draw(); });
  }

  goHome() {
    Object.assign(this, {...this.home, target: [...this.home.target]});
    this.ask();
  }

  get away() {  // from the target to the eye
    const flat = Math.cos(this.elevation);
    return [flat * Math.cos(this.azimuth), flat * Math.sin(this.azimuth), Math.sin(this.elevation)];
  }

  draw() {
    const gl = this.gl, scale = window.devicePixelRatio || 1;
    const width = Math.round(this.canvas.clientWidth * scale), height = Math.round(this.canvas.clientHeight * scale);
    if (!width || !height) return;
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, {width, height});
    const things = this.bodies.filter((body) => body.isVisible)
      .map((body) => ({...body, matrix: matrixOf(body.pose)}));
    const arrows = [];
    for (const {at, along, thickness, tint} of this.arrows) {
      const length = Math.hypot(...along);
      if (!(length > 1e-4)) continue;
      const z = unit(along), x = unit(cross(Math.abs(z[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0], z)), y = cross(z, x);
      arrows.push({mesh: this.arrow, opacity: 1, tint, matrix: new Float32Array([
        ...scaled(x, thickness), 0, ...scaled(y, thickness), 0, ...along, 0, ...at, 1])});
    }
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.depth.buffer);
    gl.viewport(0, 0, this.depth.size, this.depth.size);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.useProgram(this.shadow.program);
    gl.uniformMatrix4fv(this.shadow.places.lamp, false, this.lamp);
    for (const thing of things) {
      if (thing.isFaint || thing.isSurround) continue;
      gl.uniformMatrix4fv(this.shadow.places.model, false, thing.matrix);
      this.drawMesh(thing.mesh);
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, width, height);
    const back = getComputedStyle(document.body).backgroundColor.match(/[\d.]+/g).map(Number);
    gl.clearColor(back[0] / 255, back[1] / 255, back[2] / 255, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const {program, places} = this.main;
    gl.useProgram(program);
    const eye = added(this.target, scaled(this.away, this.distance));
    const lens = perspective(this.home.fieldOfView, width / height, 0.02 * this.distance, 20 * this.distance + 20);
    gl.uniformMatrix4fv(places.camera, false, product(lens, lookAt(eye, this.target, [0, 0, 1])));
    gl.uniformMatrix4fv(places.lamp, false, this.lamp);
    gl.uniform3fv(places.eye, eye);
    gl.uniform3fv(places.toLamp, this.toLamp);
    gl.bindTexture(gl.TEXTURE_2D, this.depth.texture);
    const flat = unit([this.away[0], this.away[1], 0]), nothing = [0, 0, 0, 1];
    const front = [...flat, dot(flat, this.home.target) - 0.05];
    const paint = (thing) => {
      gl.uniform4fv(places.cut, thing.isSurround ? front : nothing);
      gl.uniformMatrix4fv(places.model, false, thing.matrix);
      gl.uniform4fv(places.tint, thing.tint);
      gl.uniform1f(places.opacity, thing.opacity);
      this.drawMesh(thing.mesh);
    };
    things.filter((thing) => !thing.isFaint).forEach(paint);
    // Of a body that one sees through, only the nearest surface is drawn: first its depth, then its colour.
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    const faint = things.filter((thing) => thing.isFaint);
    gl.colorMask(false, false, false, false);
    faint.forEach(paint);
    gl.colorMask(true, true, true, true);
    faint.forEach(paint);
    // Forces act inside of what is touched, so nothing hides their arrows.
    gl.clear(gl.DEPTH_BUFFER_BIT);
    arrows.forEach(paint);
    gl.disable(gl.BLEND);
  }

  drawMesh(mesh) {
    this.gl.bindVertexArray(mesh.array);
    this.gl.drawElements(this.gl.TRIANGLES, mesh.count, this.gl.UNSIGNED_INT, 0);
  }

  turn(x, y) {
    this.azimuth -= 0.008 * x;
    this.elevation = Math.min(Math.max(this.elevation + 0.008 * y, -1.5), 1.55);
    this.ask();
  }

  shift(x, y) {
    const step = this.distance * this.home.fieldOfView / this.canvas.clientHeight;
    const right = unit(cross([0, 0, 1], this.away)), up = cross(this.away, right);
    this.target = added(this.target, added(scaled(right, -x * step), scaled(up, y * step)));
    this.ask();
  }

  zoom(factor) {
    this.distance = Math.min(Math.max(this.distance * factor, 0.03), 30);
    this.ask();
  }

  listen() {
    const canvas = this.canvas, fingers = new Map();
    const spread = () => {
      const [a, b] = [...fingers.values()];
      return Math.hypot(a[0] - b[0], a[1] - b[1]) || 1;
    };
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("dblclick", () => this.goHome());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(0.0012 * event.deltaY * (event.deltaMode ? 30 : 1)));
    }, {passive: false});
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      const [x, y] = [event.clientX - before[0], event.clientY - before[1]];
      const was = fingers.size === 2 ? spread() : 0;
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      if (fingers.size === 2) {
        this.zoom(was / spread());
        this.shift(x / 2, y / 2);
      } else if (event.buttons & 6 || event.shiftKey) {
        this.shift(x, y);
      } else {
        this.turn(x, y);
      }
    });
    for (const kind of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(kind, (event) => fingers.delete(event.pointerId));
    }
  }
}

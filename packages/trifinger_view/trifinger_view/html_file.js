// SPDX-License-Identifier: BSD-3-Clause
// The page of one log: a time line that moves, the scene at its time, the images and the plots.

const index = JSON.parse(document.getElementById("index").textContent);
const find = (name) => document.getElementById(name);
const COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#777777"];

async function unpack(text) {
  const letters = atob(text), bytes = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; ++i) bytes[i] = letters.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

// The number of the last of some ascending times that is not after `time`; 0 if there is none.
function before(times, time) {
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle + 1; else high = middle;
  }
  return Math.max(low - 1, 0);
}

// A position between two times [s]. It moves while it plays; playing.py has the same rules.
class TimeLine {
  constructor(begin, end, fault, clock = () => performance.now() / 1000) {
    Object.assign(this, {begin, end, fault, clock, speed: 1, isLooping: false, isPlaying: false});
    this.at = begin;
    this.since = clock();
  }
  get position() {
    const now = this.clock(), passed = Math.max(now - this.since, 0);
    this.since = now;
    if (!this.isPlaying) return this.at;
    this.at += passed * this.speed;
    if (this.at >= this.end) {
      if (this.isLooping && !passed) return this.at;
      if (this.isLooping) this.at = this.begin + (this.at - this.begin) % (this.end - this.begin);
      else [this.at, this.isPlaying] = [this.end, false];
    }
    return this.at;
  }
  play() {
    if (this.position >= this.end) this.at = this.begin;
    this.isPlaying = this.end > this.begin;
  }
  pause() { void this.position; this.isPlaying = false; }
  toggle() { void this.position; if (this.isPlaying) this.pause(); else this.play(); }
  setSpeed(speed) { void this.position; this.speed = speed; }
  moveTo(time) { void this.position; this.at = Math.min(Math.max(time, this.begin), this.end); }
}

class Page {
  constructor(bytes) {
    this.bytes = bytes;
    this.times = this.floats(index.frames.times, Float64Array);
    this.steps = this.floats(index.frames.steps, Float64Array);
    this.marks = this.floats(index.frames.marks, Uint8Array);
    this.line = new TimeLine(index.begin, index.end, index.fault && index.fault.time);
    this.group = null;
    if (index.bodies.length) this.makeScene();
    else find("scene").classList.add("empty");
    this.makeImages();
    this.makePlots();
    this.makeControls();
    window.addEventListener("resize", () => this.drawPlots());
    window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.drawPlots();
      if (this.scene) this.scene.ask();
    });
    this.show();
  }

  // The numbers of the array that `place`, [offset, count], describes.
  floats(place, type = Float32Array) { return new type(this.bytes, place[0], place[1]); }

  makeScene() {
    this.scene = new Scene(find("view"), index.camera);
    const meshes = index.meshes.map((mesh) => this.scene.upload({
      positions: this.floats(mesh.positions),
      normals: this.floats(mesh.normals, Int8Array),
      colours: this.floats(mesh.colours, Uint8Array),
      triangles: this.floats(mesh.triangles, Uint32Array),
    }));
    this.bodies = new Map();
    for (const body of index.bodies) {
      const looks = body.isGhost ? {isFaint: true, opacity: 0.5, tint: [0.05, 0.3, 0.9, 1]} : {};
      const parts = body.parts.map((part) => this.scene.add(meshes[part.mesh],
        {pose: body.pose, isFaint: part.isTransparent, isSurround: part.isSurround, ...looks}));
      this.bodies.set(body.name, {...body, parts, poses: body.poses && this.floats(body.poses)});
    }
    this.ghostIsThere = index.ghost && this.floats(index.ghost, Uint8Array);
    this.forces = index.forces.map((force) => ({name: force.name, numbers: this.floats(force.numbers)}));
    const toggles = [["ghost", "desired pose", this.ghostIsThere && this.ghostIsThere.some(Boolean)],
      ["force", "tip forces", this.forces.length > 0]];
    for (const [name, text, isThere] of toggles) {
      const label = document.createElement("label");
      label.innerHTML = `<input type="checkbox" id="${name}" checked> ${text}`;
      label.hidden = !isThere;
      find("shown").append(label);
      label.firstChild.addEventListener("change", () => this.show());
    }
  }

  makeImages() {
    this.cameras = index.images.map((camera) => {
      const figure = document.createElement("figure");
      figure.innerHTML = "<img alt=''><figcaption></figcaption>";
      figure.lastChild.textContent = camera.name;
      find("images").append(figure);
      return {...camera, times: camera.times, shown: -1, picture: figure.firstChild};
    });
  }

  makePlots() {
    const choice = find("group");
    const groups = index.groups;
    for (const [number, group] of groups.entries()) choice.add(new Option(group.name, number));
    choice.hidden = groups.length < 2;
    choice.addEventListener("change", () => { this.group = Number(choice.value); this.drawPlots(); });
    this.group = 0;
    this.plots = index.plots.map((plot) => {
      const figure = document.createElement("figure");
      figure.className = "plot";
      figure.innerHTML = "<figcaption><b></b><span></span></figcaption><canvas></canvas>";
      figure.querySelector("b").textContent = plot.unit ? `${plot.name} [${plot.unit}]` : plot.name;
      find("plots").append(figure);
      const canvas = figure.lastChild;
      const scrub = (event) => {
        const share = (event.clientX - canvas.getBoundingClientRect().left) / canvas.clientWidth;
        this.goTo(index.begin + share * (index.end - index.begin));
      };
      canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); scrub(event); });
      canvas.addEventListener("pointermove", (event) => { if (event.buttons) scrub(event); });
      return {
        ...plot, canvas, caption: figure.querySelector("span"), times: this.floats(plot.times, Float64Array),
        lines: plot.lines.map((line) => ({...line, low: this.floats(line.low), high: this.floats(line.high)})),
      };
    });
    this.drawPlots();
  }

  // Draws the plots without the cursor and keeps the pictures; show() adds the cursor.
  drawPlots() {
    const group = index.groups[this.group], style = getComputedStyle(document.body);
    const legend = new Map();
    for (const plot of this.plots) {
      const scale = window.devicePixelRatio || 1;
      const width = plot.canvas.clientWidth * scale, height = plot.canvas.clientHeight * scale;
      if (!width) continue;
      Object.assign(plot.canvas, {width, height});
      plot.still = document.createElement("canvas");
      Object.assign(plot.still, {width, height});
      plot.shown = plot.lines.filter((line) => !group || line.group === null || group.members.includes(line.group));
      let low = Infinity, high = -Infinity;
      for (const {low: least, high: most} of plot.shown) {
        for (let i = 0; i < least.length; ++i) {
          if (least[i] < low) low = least[i];
          if (most[i] > high) high = most[i];
        }
      }
      if (low > high) [low, high] = [0, 1];
      const margin = high > low ? 0.06 * (high - low) : Math.max(Math.abs(high), 1e-3);
      [low, high] = [low - margin, high + margin];
      const pen = plot.still.getContext("2d");
      const x = (time) => (time - index.begin) / (index.end - index.begin || 1) * width;
      const y = (value) => height - (value - low) / (high - low) * height;
      pen.strokeStyle = style.getPropertyValue("--line");
      pen.lineWidth = scale;
      pen.strokeRect(0.5, 0.5, width - 1, height - 1);
      if (low < 0 && high > 0) { pen.beginPath(); pen.moveTo(0, y(0)); pen.lineTo(width, y(0)); pen.stroke(); }
      for (const line of plot.shown) {
        const colour = COLOURS[(group && group.members.length > 1 ? line.group ?? line.number : line.number) % COLOURS.length];
        if (line.group !== null) legend.set(colour, group && group.members.length > 1 ? index.groups[line.group + 1].name : line.label);
        pen.strokeStyle = colour;
        pen.setLineDash(line.isDesired ? [5 * scale, 4 * scale] : []);
        pen.globalAlpha = line.isDesired ? 0.65 : 0.9;
        pen.lineWidth = 1.2 * scale;
        pen.beginPath();
        let isDown = false;
        for (let i = 0; i < plot.times.length; ++i) {
          if (!(line.low[i] <= line.high[i])) { isDown = false; continue; }
          const at = x(plot.times[i]);
          if (isDown) pen.lineTo(at, y(line.low[i])); else pen.moveTo(at, y(line.low[i]));
          pen.lineTo(at, y(line.high[i]));
          isDown = true;
        }
        pen.stroke();
      }
      pen.globalAlpha = 1;
      pen.setLineDash([]);
      pen.fillStyle = style.getPropertyValue("--quiet");
      pen.font = `${10 * scale}px system-ui, sans-serif`;
      pen.fillText(high.toPrecision(3), 4 * scale, 11 * scale);
      pen.fillText(low.toPrecision(3), 4 * scale, height - 4 * scale);
      if (index.fault) {
        pen.fillStyle = style.getPropertyValue("--bad");
        pen.fillRect(x(index.fault.time) - scale, 0, 2 * scale, height);
      }
    }
    find("legend").replaceChildren(...[...legend].map(([colour, text]) => {
      const item = document.createElement("span");
      item.innerHTML = `<i style="background:${colour}"></i>`;
      item.append(text);
      return item;
    }));
    this.drawMarks();
    if (this.frame !== undefined) this.drawCursors(this.line.position);
  }

  // Marks on the time line: the fault, and steps in which something went wrong.
  drawMarks() {
    const canvas = find("marks"), scale = window.devicePixelRatio || 1;
    const style = getComputedStyle(document.body);
    const width = canvas.clientWidth * scale, height = canvas.clientHeight * scale;
    if (!width) return;
    Object.assign(canvas, {width, height});
    const pen = canvas.getContext("2d");
    const mark = (time, colour, thickness) => {
      pen.fillStyle = style.getPropertyValue(colour);
      const margin = 8 * scale;  // half of the knob
      const at = margin + (time - index.begin) / (index.end - index.begin || 1) * (width - 2 * margin);
      pen.fillRect(at - thickness * scale / 2, 0, thickness * scale, height);
    };
    for (let i = 0; i < this.marks.length; ++i) if (this.marks[i]) mark(this.times[i], "--warn", 1.5);
    if (index.fault) mark(index.fault.time, "--bad", 3);
  }

  makeControls() {
    const track = find("time");
    Object.assign(track, {min: index.begin, max: index.end, step: "any", value: index.begin});
    track.addEventListener("input", () => this.goTo(Number(track.value)));
    find("play").addEventListener("click", () => { this.line.toggle(); this.run(); });
    find("back").addEventListener("click", () => this.goToFrame(-1));
    find("forth").addEventListener("click", () => this.goToFrame(1));
    find("speed").addEventListener("change", () => this.line.setSpeed(Number(find("speed").value)));
    find("loop").addEventListener("click", () => {
      void this.line.position;
      this.line.isLooping = !this.line.isLooping;
      find("loop").setAttribute("aria-pressed", this.line.isLooping);
    });
    find("fault").hidden = !index.fault;
    find("fault").addEventListener("click", () => this.goToFault());
    document.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.altKey || event.metaKey || event.target.tagName === "SELECT") return;
      const keys = {
        " ": () => { this.line.toggle(); this.run(); },
        ArrowLeft: () => this.goToFrame(-1), ArrowRight: () => this.goToFrame(1),
        Home: () => this.goTo(index.begin), End: () => this.goTo(index.end), f: () => this.goToFault(),
      };
      if (!(event.key in keys)) return;
      event.preventDefault();
      keys[event.key]();
    });
  }

  goTo(time) { this.line.moveTo(time); this.show(); }

  goToFrame(distance) {
    this.line.pause();
    const frame = before(this.times, this.line.position) + distance;
    this.goTo(this.times[Math.min(Math.max(frame, 0), this.times.length - 1)]);
  }

  goToFault() {
    if (!index.fault) return;
    this.line.pause();
    this.goTo(index.fault.time);
  }

  run() {
    if (this.isRunning) return;
    this.isRunning = true;
    const next = () => {
      this.show();
      if (this.line.isPlaying) requestAnimationFrame(next); else this.isRunning = false;
    };
    next();
  }

  // The pose of a body at a time: x, y, z, quaternion. Between two frames it is interpolated.
  poseOf(name, time) {
    const body = this.bodies.get(name);
    if (!body.poses) return body.pose;
    const count = this.times.length, i = before(this.times, time), j = Math.min(i + 1, count - 1);
    const span = this.times[j] - this.times[i];
    // Over a gap of the log, the pose before it stays.
    const share = span > 0 && span < 3 * index.frames.span ? Math.min(Math.max((time - this.times[i]) / span, 0), 1) : 0;
    const at = (frame) => Array.from({length: 7}, (_, k) => body.poses[k * count + frame]);
    const [a, b] = [at(i), at(j)];
    const sign = a[3] * b[3] + a[4] * b[4] + a[5] * b[5] + a[6] * b[6] < 0 ? -1 : 1;
    const pose = a.map((number, k) => number + share * ((k > 2 ? sign : 1) * b[k] - number));
    const length = Math.hypot(...pose.slice(3));
    return pose.map((number, k) => k > 2 ? number / length : number);
  }

  // Shows the scene, the images, the words and the cursors of the present time.
  show() {
    const time = this.line.position, frame = before(this.times, time), count = this.times.length;
    this.frame = frame;
    if (this.scene) {
      const isGhostly = Boolean(this.ghostIsThere && this.ghostIsThere[frame] && find("ghost").checked);
      for (const [name, body] of this.bodies) {
        const pose = this.poseOf(name, time), isVisible = !body.isGhost || isGhostly;
        for (const part of body.parts) Object.assign(part, {pose, isVisible});
      }
      this.scene.arrows = !find("force").checked ? [] : this.forces.map(({numbers}) => {
        const [x, y, z, fx, fy, fz] = Array.from({length: 6}, (_, k) => numbers[k * count + frame]);
        return {at: [x, y, z], along: scaled([fx, fy, fz], index.metresPerNewton), thickness: 0.006,
          tint: [0.9, 0.25, 0.15, 1]};
      });
      this.scene.ask();
    }
    for (const camera of this.cameras) {
      const number = camera.times.length && camera.times[0] <= time ? before(camera.times, time) : -1;
      if (number === camera.shown) continue;
      camera.shown = number;
      if (camera.url) URL.revokeObjectURL(camera.url);
      camera.url = "";
      if (number >= 0) {
        const [offset, size] = camera.places[number];
        camera.url = URL.createObjectURL(new Blob([new Uint8Array(this.bytes, offset, size)], {type: "image/jpeg"}));
        camera.picture.src = camera.url;
      } else {
        camera.picture.removeAttribute("src");
      }
    }
    this.say(time, frame);
    this.drawCursors(time);
    find("time").value = time;
    find("clock").textContent = `${time.toFixed(2)} / ${index.end.toFixed(2)} s`;
    find("play").textContent = this.line.isPlaying ? "❚❚" : "▶";
    find("play").title = this.line.isPlaying ? "pause (space)" : "play (space)";
  }

  // The state of the session in words.
  say(time, frame) {
    const state = find("state");
    const isLast = frame === this.times.length - 1 && index.ends;
    const marks = index.marks.filter((_, bit) => this.marks[frame] >> bit & 1);
    let text = marks.length ? marks.join(", ") : "running";
    if (isLast) text = index.ends.text;
    if (index.fault && time >= index.fault.time) text = index.fault.text;
    state.className = index.fault && time >= index.fault.time ? "bad" : marks.length ? "warn" : "";
    state.firstElementChild.textContent = text;
    state.lastElementChild.textContent = `step ${this.steps[frame]}`;
  }

  drawCursors(time) {
    const share = (time - index.begin) / (index.end - index.begin || 1);
    const colour = getComputedStyle(document.body).getPropertyValue("--text");
    for (const plot of this.plots) {
      if (!plot.still) continue;
      const pen = plot.canvas.getContext("2d"), scale = window.devicePixelRatio || 1;
      pen.clearRect(0, 0, plot.canvas.width, plot.canvas.height);
      pen.drawImage(plot.still, 0, 0);
      pen.fillStyle = colour;
      pen.fillRect(share * plot.canvas.width - scale / 2, 0, scale, plot.canvas.height);
      const bin = before(plot.times, time);
      const values = plot.shown.filter((line) => !line.isDesired).map((line) => line.high[bin]);
      plot.caption.textContent = values.length > 3 ? "" : values
        .map((value) => Number.isFinite(value) ? String(Number(value.toPrecision(3))) : "-").join("  ");
    }
  }
}

async function main() {
  const holder = find("numbers");
  const bytes = await unpack(holder.textContent.trim());
  holder.remove();
  window.trifingerPage = Object.assign(new Page(bytes), {TimeLine});
  document.body.dataset.isReady = "true";
}

main().catch((error) => {
  find("error").textContent = `This page could not be shown: ${error.message ?? error}. A newer browser can.`;
  document.body.dataset.isReady = "false";
});

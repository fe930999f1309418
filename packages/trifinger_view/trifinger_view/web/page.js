// SPDX-License-Identifier: BSD-3-Clause
// What all pages share: the scene with its options, the state in words, images, plots and a time line.

const find = (name) => document.getElementById(name);
const COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#777777"];
const CANVAS = {willReadFrequently: true};  // the processor draws lines sooner than a slow graphics card

function make(tag, properties = {}, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
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

// Arrays in bytes; a place is the offset of an array and how many numbers it has.
class Numbers {
  constructor(bytes, start = 0) { Object.assign(this, {bytes, start}); }
  floats([offset, count], type = Float32Array) { return new type(this.bytes, this.start + offset, count); }
}

class Page {
  constructor() {
    this.bodies = [];
    this.images = new Map();
    this.plots = [];
    this.groups = [];
    try {
      this.scene = new Scene(find("view"), document.body.dataset.parts.includes("plain"));
      find("shadows").checked = !this.scene.isPlain;
    } catch (error) {
      this.failure = `There is no picture: ${error.message}. A newer browser can show it.`;
      find("error").textContent = this.failure;
    }
    for (const name of ["ghost", "force", "wall", "frame", "shadows"]) find(name).addEventListener("change", () => this.redraw());
    find("group").addEventListener("change", () => this.drawPlots());
    const draw = () => { this.drawPlots(); this.scene?.requestDraw(); };
    window.addEventListener("resize", draw);
    window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  }

  // Shows other bodies, whose meshes are in `numbers`.
  begin(told, numbers) {
    this.told = told;
    this.placed = null;
    this.bodies = [];
    document.title = find("scene").ariaLabel = document.querySelector("h1").textContent = told.title;
    find("facts").textContent = told.facts;
    document.body.classList.toggle("empty", !told.bodies.length);
    const parts = told.bodies.flatMap((body) => body.parts);
    find("ghost").parentElement.hidden = !told.hasGhost;
    find("force").parentElement.hidden = !told.hasForces;
    find("wall").parentElement.hidden = !parts.some((part) => part.isSurround && part.isTransparent);
    find("frame").parentElement.hidden = !parts.some((part) => part.isSurround && !part.isTransparent);
    find("shadows").parentElement.hidden = !parts.length;
    if (!this.scene) return;
    const robot = told.bodies.length ? JSON.stringify([told.title, told.bodies.map(({name}) => name)]) : this.robot;
    this.scene.begin(told.home ?? this.scene.home, robot === this.robot);
    this.robot = robot;
    const upload = (part) => this.scene.upload({
      positions: numbers.floats(part.positions),
      normals: numbers.floats(part.normals, Int8Array),
      colours: numbers.floats(part.colours, Uint8Array),
      triangles: numbers.floats(part.triangles, Uint32Array),
    });
    this.ink = told.ink && {...this.scene.add(upload(told.ink)), steps: numbers.floats(told.ink.steps, Float64Array)};
    this.bodies = told.bodies.map(({name, parts, isMoving}) => {
      const meshes = parts.map(upload);
      const own = parts.map((part, i) => this.scene.add(meshes[i], {isVisible: false, isFaint: part.isTransparent, isSurround: part.isSurround}));
      const ghosts = told.hasGhost && isMoving ? own.flatMap((part) => part.isSurround ? [] : [this.scene.add(part.mesh,
        {isVisible: false, isFaint: true, opacity: 0.5, tint: [0.1, 0.36, 0.95, 1]})]) : [];
      return {name, parts: own, ghosts, isMoving};
    });
  }

  // Moves the bodies: seven numbers for each, not numbers for a body that was never seen; the same for the
  // desired pose, or null; and for each tip where it is and its force.
  place(poses, ghosts, forces, step) {
    this.placed = [poses, ghosts, forces, step];
    if (!this.scene) return;
    const at = (numbers, i) => numbers.subarray(7 * i, 7 * i + 7);
    for (const [i, body] of this.bodies.entries()) {
      const pose = at(poses, i), isSeen = !Number.isNaN(pose[0]);
      for (const part of body.parts) {
        const isChosen = !part.isSurround || find(part.isFaint ? "wall" : "frame").checked;
        Object.assign(part, {pose, isVisible: isSeen && isChosen});
      }
      const isGhostly = Boolean(ghosts) && find("ghost").checked;
      for (const part of body.ghosts) Object.assign(part, {pose: isGhostly ? at(ghosts, i) : pose, isVisible: isGhostly});
    }
    this.scene.arrows = !find("force").checked ? [] : Array.from({length: forces.length / 6}, (_, k) => ({
      at: [...forces.subarray(6 * k, 6 * k + 3)], thickness: 0.006, tint: [0.9, 0.25, 0.15, 1],
      along: scaled(forces.subarray(6 * k + 3, 6 * k + 6), this.told.metresPerNewton)}));
    if (this.told.follows) {
      const moving = this.bodies.flatMap((body, i) => body.isMoving ? [[...at(poses, i).subarray(0, 3)]] : []);
      if (moving.length) this.scene.follow(scaled(moving.reduce(added), 1 / moving.length));
    }
    // Two triangles for each line that had been written by then.
    if (this.ink) this.ink.mesh.count = this.ink.steps[0] <= step ? 6 * (before(this.ink.steps, step) + 1) : 0;
    this.scene.isPlain = !find("shadows").checked;
    this.scene.requestDraw();
  }

  redraw() { if (this.placed) this.place(...this.placed); }

  // The state in words: lines with a label, a text and a level, "good", "warning", "bad" or "".
  say(lines) {
    const [first, ...others] = lines;
    const words = (tag, line) => make(tag, {className: `says-${line.label.replaceAll(" ", "-")} ${line.level}`, textContent: line.text});
    const state = make("div", {}, words("b", first), make("dl", {}, ...others.flatMap((line) =>
      [make("dt", {textContent: line.label}), words("dd", line)])));
    if (find("state").innerHTML !== state.innerHTML) find("state").replaceChildren(...state.childNodes);
    find("state").className = first.level;
  }

  // What cameras see: files of pictures by the name of the camera.
  showImages(images) {
    for (const [name, {figure, url}] of this.images) {
      if (images.has(name)) continue;
      figure.remove();
      URL.revokeObjectURL(url);
      this.images.delete(name);
    }
    for (const [name, bytes] of images) {
      let shown = this.images.get(name);
      if (!shown) {
        shown = {figure: make("figure", {}, make("img", {alt: ""}), make("figcaption", {textContent: name}))};
        this.images.set(name, shown);
        find("images").append(shown.figure);
      }
      URL.revokeObjectURL(shown.url);
      shown.url = URL.createObjectURL(new Blob([bytes], {type: "image/jpeg"}));
      shown.figure.firstChild.src = shown.url;
    }
  }

  // Shows other plots of the times from `begin` to `end`. Lines have smallest and largest numbers; those
  // with a group, such as a finger, are shown if it is chosen.
  showPlots(plots, groups, begin, end) {
    const choice = find("group");
    if (groups.join() !== this.groups.join()) {
      choice.replaceChildren(...["all", ...groups].map((name, number) => make("option", {value: number - 1, textContent: name})));
      choice.hidden = groups.length < 2;
    }
    const figures = new Map(this.plots.map((plot) => [plot.title, plot]));
    this.plots = plots.map((plot) => ({...(figures.get(plot.title) ?? this.makePlot(plot.title)), ...plot}));
    if (this.plots.some((plot, i) => plot.figure !== find("plots").children[i]) || find("plots").children.length !== plots.length) {
      find("plots").replaceChildren(...this.plots.map((plot) => plot.figure));
    }
    Object.assign(this, {groups, range: [begin, end]});
    this.drawPlots();
  }

  makePlot(title) {
    const canvas = make("canvas"), caption = make("span");
    const figure = make("figure", {className: "plot"}, make("figcaption", {}, make("b", {textContent: title}), caption), canvas);
    const scrub = (event) => {
      const share = (event.clientX - canvas.getBoundingClientRect().left) / canvas.clientWidth;
      this.controls?.line.moveTo(this.range[0] + share * (this.range[1] - this.range[0]));
    };
    canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); scrub(event); });
    canvas.addEventListener("pointermove", (event) => { if (event.buttons) scrub(event); });
    return {figure, canvas, caption};
  }

  // Draws the plots without the cursor and keeps the pictures; drawCursors() adds the cursor.
  drawPlots() {
    const chosen = Number(find("group").value || -1), style = getComputedStyle(document.body);
    const [begin, end] = this.range ?? [0, 1], legend = new Map(), isAll = chosen < 0 && this.groups.length > 1;
    for (const plot of this.plots) {
      const scale = window.devicePixelRatio || 1;
      const width = plot.canvas.clientWidth * scale, height = plot.canvas.clientHeight * scale;
      if (!width) continue;
      Object.assign(plot.canvas, {width, height});
      plot.still = make("canvas", {width, height});
      plot.shown = plot.lines.filter((line) => chosen < 0 || line.group === null || line.group === chosen);
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
      const pen = plot.still.getContext("2d", CANVAS);
      const x = (time) => (time - begin) / (end - begin || 1) * width;
      const y = (value) => height - (value - low) / (high - low) * height;
      pen.strokeStyle = style.getPropertyValue("--line");
      pen.lineWidth = scale;
      pen.strokeRect(0.5, 0.5, width - 1, height - 1);
      if (low < 0 && high > 0) { pen.beginPath(); pen.moveTo(0, y(0)); pen.lineTo(width, y(0)); pen.stroke(); }
      for (const line of plot.shown) {
        const colour = COLOURS[(isAll ? line.group ?? line.number : line.number) % COLOURS.length];
        if (line.group !== null) legend.set(colour, isAll ? this.groups[line.group] : String(line.number));
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
      Object.assign(pen, {fillStyle: style.getPropertyValue("--quiet"), strokeStyle: style.getPropertyValue("--panel"),
        lineWidth: 3 * scale, font: `${10 * scale}px system-ui, sans-serif`});
      for (const [value, at] of [[high, 11 * scale], [low, height - 4 * scale]]) {
        pen.strokeText(value.toPrecision(3), 4 * scale, at);
        pen.fillText(value.toPrecision(3), 4 * scale, at);
      }
      const fault = this.controls?.line.fault ?? null;
      if (fault !== null) {
        pen.fillStyle = style.getPropertyValue("--bad");
        pen.fillRect(x(fault) - scale, 0, 2 * scale, height);
      }
    }
    find("legend").replaceChildren(...[...legend].map(([colour, text]) => {
      const item = make("span", {}, make("i"), text);
      item.firstChild.style.background = colour;
      return item;
    }));
    this.controls?.drawMarks();
    this.drawCursors(this.controls ? this.controls.line.position : null);
  }

  drawCursors(time) {
    const colour = getComputedStyle(document.body).getPropertyValue("--text");
    for (const plot of this.plots) {
      if (!plot.still) continue;
      const pen = plot.canvas.getContext("2d", CANVAS), scale = window.devicePixelRatio || 1;
      pen.clearRect(0, 0, plot.canvas.width, plot.canvas.height);
      pen.drawImage(plot.still, 0, 0);
      const bin = time === null ? plot.times.length - 1 : before(plot.times, time);
      if (time !== null) {
        const share = (time - this.range[0]) / (this.range[1] - this.range[0] || 1);
        pen.fillStyle = colour;
        pen.fillRect(share * plot.canvas.width - scale / 2, 0, scale, plot.canvas.height);
      }
      const values = plot.shown.filter((line) => !line.isDesired).map((line) => line.high[bin]);
      plot.caption.textContent = values.length > 3 ? "" : values
        .map((value) => Number.isFinite(value) ? String(Number(value.toPrecision(3))) : "-").join("  ");
    }
  }
}

// The buttons and keys of a time line. The line has begin, end and fault [s], position, isPlaying and
// isLooping, and does what is asked for; `marks` are times of what went wrong.
class Controls {
  constructor(line, marks = []) {
    Object.assign(this, {line, marks});
    const track = find("time");
    document.querySelector("footer").hidden = false;
    Object.assign(track, {min: line.begin, max: line.end, step: "any", value: line.begin});
    const does = {
      play: () => line.toggle(), back: () => line.step(-1), forth: () => line.step(1), fault: () => line.goToFault(),
      sooner: () => line.skip(-1), later: () => line.skip(1), loop: () => line.setLooping(!line.isLooping),
    };
    for (const [name, act] of Object.entries(does)) find(name).addEventListener("click", act);
    track.addEventListener("input", () => line.moveTo(Number(track.value)));
    find("speed").addEventListener("change", () => line.setSpeed(Number(find("speed").value)));
    find("fault").hidden = line.fault === null;
    const keys = {
      " ": does.play, ArrowLeft: does.back, ArrowRight: does.forth, f: does.fault, "shift ArrowLeft": does.sooner,
      "shift ArrowRight": does.later, Home: () => line.moveTo(line.begin), End: () => line.moveTo(line.end),
    };
    document.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.altKey || event.metaKey || event.target.tagName === "SELECT") return;
      const key = `${event.shiftKey ? "shift " : ""}${event.key}`;
      if (!(key in keys)) return;
      event.preventDefault();
      keys[key]();
    });
  }

  show() {
    const {position, end, isPlaying, isLooping, speed} = this.line;
    find("time").value = position;
    find("clock").textContent = `${position.toFixed(2)} / ${end.toFixed(2)} s`;
    Object.assign(find("play"), {textContent: isPlaying ? "❚❚" : "▶", title: isPlaying ? "pause (space)" : "play (space)"});
    find("loop").setAttribute("aria-pressed", isLooping);
    find("speed").value = speed;
  }

  // Marks on the time line: the fault, and steps in which something went wrong.
  drawMarks() {
    const canvas = find("marks"), scale = window.devicePixelRatio || 1, style = getComputedStyle(document.body);
    const width = canvas.clientWidth * scale, height = canvas.clientHeight * scale;
    if (!width) return;
    Object.assign(canvas, {width, height});
    const pen = canvas.getContext("2d"), {begin, end, fault} = this.line;
    const mark = (time, colour, thickness) => {
      pen.fillStyle = style.getPropertyValue(colour);
      const margin = 8 * scale;  // half of the knob
      const at = margin + (time - begin) / (end - begin || 1) * (width - 2 * margin);
      pen.fillRect(at - thickness * scale / 2, 0, thickness * scale, height);
    };
    for (const time of this.marks) mark(time, "--warn", 1.5);
    if (fault !== null) mark(fault, "--bad", 3);
  }
}

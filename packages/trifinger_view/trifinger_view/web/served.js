// SPDX-License-Identifier: BSD-3-Clause
// The page of a robot that runs, or of a log that a server reads. The server sends what has changed; the
// page sends what somebody asks for.

const TOUCHED = 1000;  // for so long after a touch a slider does not follow [ms]

// The time line of a log, which is the server's: pages of all browsers share it.
class ServedLine {
  constructor(told, send) {
    Object.assign(this, told, {begin: 0, touched: -Infinity, send});
  }
  toggle() { this.send({do: "toggle"}); }
  step(steps) { this.send({do: "step", steps}); }
  skip(seconds) { this.send({do: "skip", seconds}); }
  setSpeed(speed) { this.send({do: "speed", speed}); }
  setLooping(isLooping) { this.send({do: "loop", isLooping}); }
  goToFault() { this.send({do: "fault"}); }
  moveTo(time) {
    Object.assign(this, {position: time, touched: performance.now()});
    this.send({do: "move", time});
  }
  // Takes what the server says, but does not move the slider under a hand.
  take(told) {
    const isTouched = performance.now() - this.touched < TOUCHED / 2;
    Object.assign(this, told, isTouched ? {position: this.position} : {});
  }
}

class ServedPage extends Page {
  constructor() {
    super();
    this.sliders = [];
    const asks = {take: "take", release: "release", recover: "recover", home: "mode", hold: "mode", float: "mode"};
    for (const [name, what] of Object.entries(asks)) {
      find(name).addEventListener("click", () => this.send(what === "mode" ? {do: "mode", mode: name} : {do: what}));
    }
    if (this.scene) {
      const [robot, camera] = JSON.parse(sessionStorage.getItem("camera") ?? "[]");
      sessionStorage.removeItem("camera");
      Object.assign(this.scene, camera);
      this.robot = robot;
      this.scene.onDrag = (handle, point) => {
        handle.point = point;
        handle.next ??= requestAnimationFrame(() => this.drag(handle));
      };
      this.scene.onDrop = (handle) => { this.drag(handle); this.send({do: "drop"}); };
    }
    this.connect();
  }

  connect() {
    const socket = this.socket = new WebSocket(`ws://${location.host}/`);
    socket.binaryType = "arraybuffer";
    socket.onmessage = (event) => this.hear(event.data);
    socket.onopen = () => { find("error").textContent = this.failure ?? ""; };
    socket.onclose = () => {
      this.on_seat(null);
      find("error").textContent = "The program of this page does not answer: it has ended, has begun anew with another address, has "
        + "too many pages already, or the network is broken. 'trifinger view' in a terminal starts it again.";
      setTimeout(() => this.connect(), 1000);
    };
  }

  send(what) { if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(what)); }

  drag(handle) {
    cancelAnimationFrame(handle.next);
    handle.next = null;
    if (handle.point) this.send({do: "drag", ...handle.name, point: handle.point});
    handle.point = null;
  }

  // A message: the size of its text, the text, and numbers.
  hear(bytes) {
    const size = new DataView(bytes).getUint32(0, true);
    const told = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, size)));
    this[`on_${told.kind}`](told, new Numbers(bytes, 4 + size));
  }

  on_session(told, numbers) {
    if ((this.server ??= told.server) !== told.server) {  // it may show something else, by other scripts
      const {azimuth, elevation, target, zoom, middle} = this.scene ?? {};
      sessionStorage.setItem("camera", JSON.stringify([this.robot, {azimuth, elevation, target, zoom, middle}]));
      this.socket.onmessage = null;
      location.reload();
      return;
    }
    this.begin(told, numbers);
    this.session = told.session;
    if (told.line && !this.controls) this.controls = new Controls(new ServedLine(told.line, (what) => this.send(what)));
  }

  on_frame(told, numbers) {
    if (told.session !== this.session) return;
    this.place(numbers.floats(told.poses), told.ghosts && numbers.floats(told.ghosts), numbers.floats(told.forces), told.step);
    document.body.dataset.step = told.step;
  }

  on_line(told) {
    this.controls.line.take(told);
    this.controls.show();
    this.drawCursors(this.controls.line.position);
  }

  on_state(told) { this.say(told.lines); }

  on_images(told, numbers) {
    this.showImages(new Map(told.images.map(([name, place]) => [name, numbers.floats(place, Uint8Array)])));
  }

  on_curves(told, numbers) {
    const times = numbers.floats(told.times, Float64Array);
    this.showPlots(told.plots.map(({title, lines}) => ({title, times, lines: lines.map((line) => {
      const values = numbers.floats(line.values);
      return {...line, low: values, high: values};
    })})), told.groups, told.begin, told.end);
  }

  // Who drives, and what the robot does or why it does not.
  on_control(told) {
    find("control").hidden = false;
    document.querySelector("#control h2").textContent = told.title;
    find("words").textContent = told.words;
    Object.assign(find("others"), {textContent: told.others, hidden: !told.isTaken});
    Object.assign(find("take"), {textContent: `Take ${told.what}`, hidden: told.recovers, disabled: told.isTaken});
    find("release").textContent = `Release ${told.what}`;
    find("recover").hidden = !told.recovers;
  }

  // Sliders and handles, of the browser that drives alone; null takes them away.
  on_seat(told) {
    this.sliders = [];
    if (this.scene) Object.assign(this.scene, {handles: [], hot: null});
    find("seat").hidden = !told?.isDriver;
    find("control").classList.toggle("mine", Boolean(told?.isDriver));
    if (!told?.isDriver) { this.scene?.requestDraw(); return; }
    find("seat").firstElementChild.textContent = told.words;
    for (const name of ["home", "hold", "float"]) find(name).hidden = !told.joints;
    find("seat").lastElementChild.hidden = !told.joints?.length;
    this.sliders = (told.joints ?? []).map(({name, unit, low, high}, joint) => {
      const slider = make("input", {type: "range", min: low, max: high, step: "any", title: name}), value = make("output");
      slider.addEventListener("input", () => {
        slider.touched = performance.now();
        value.textContent = slider.valueAsNumber.toFixed(3);
        this.send({do: "joint", joint, position: slider.valueAsNumber});
      });
      return {slider, value, row: make("label", {}, make("span", {textContent: `${name} [${unit}]`}), slider, value)};
    });
    find("joints").replaceChildren(...this.sliders.map(({row}) => row));
    this.handles = told.handles.map((name) => ({name, at: null}));
  }

  // Where the robot is: sliders and handles that nobody holds go there.
  on_targets(told) {
    for (const [i, {slider, value}] of this.sliders.entries()) {
      if (performance.now() - (slider.touched ?? -TOUCHED) < TOUCHED || told.joints[i] === undefined) continue;
      slider.value = told.joints[i];
      value.textContent = slider.valueAsNumber.toFixed(3);
    }
    if (!this.scene || find("seat").hidden) return;
    for (const [i, handle] of this.handles.entries()) if (!handle.isHeld) handle.at = told.points[i];
    this.scene.handles = this.handles.filter((handle) => handle.at);
    this.scene.requestDraw();
  }
}

window.trifingerPage = new ServedPage();

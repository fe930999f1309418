// SPDX-License-Identifier: BSD-3-Clause
// The page of many robots: a card for each. It sends nothing to the server.

const MANY = 8;  // cards; more of them are small
const SHOWN = new Set(["fault", "end", "remedy", "start one", "timing", "safety", "learning", "faults"]);  // labels of lines

// A duration in words.
function spoken(seconds) {
  const [days, hours, minutes] = [86400, 3600, 60].map((unit) => Math.floor(seconds / unit));
  if (days) return `${days} d ${hours % 24} h`;
  if (hours) return `${hours} h ${minutes % 60} min`;
  return minutes ? `${minutes} min` : `${Math.floor(seconds)} s`;
}

class Card {
  constructor() {
    this.name = make("a", {target: "_blank", rel: "noreferrer"});
    this.host = make("span", {className: "host"});
    this.facts = make("div", {className: "facts"});
    this.canvas = make("canvas", {width: 640, height: 360});
    this.photo = make("img", {alt: "", hidden: true});
    this.caption = make("figcaption");
    this.state = make("b");
    this.age = make("span", {className: "age"});
    this.lines = make("dl");
    this.figure = make("figure", {hidden: true}, this.canvas, this.photo, this.caption);
    this.element = make("article", {}, make("div", {}, make("h2", {}, this.name), this.host), this.facts, this.figure,
      make("div", {className: "state"}, this.state, this.age), this.lines);
  }

  // Shows the host and the newest glance at the robot, or why there is none.
  show() {
    const {told, glance} = this, isLost = Boolean(told?.reason);
    if (!told || !(glance || isLost)) return;
    this.host.textContent = told.host;
    if (told.link && !isLost) this.name.href = told.link; else this.name.removeAttribute("href");
    this.name.textContent = this.element.ariaLabel = glance?.title ?? told.host;
    this.facts.textContent = glance?.facts ?? "";
    const [first, ...others] = glance?.lines ?? [];
    const isLate = others.some(({label, level}) => SHOWN.has(label) && level === "warning");
    this.level = isLost ? "lost" : first.level === "bad" ? "bad" : isLate ? "warning" : first.level;
    this.element.className = this.level;
    this.state.textContent = isLost ? "cannot be reached" : first.text;
    this.age.textContent = isLost ? `since ${told.since}; it is tried again by itself` : `for ${glance.isAgeKnown ? "" : "at least "}${spoken(glance.age)}`;
    this.caption.textContent = isLost && glance ? `last seen ${told.since}` : "";
    const rows = isLost ? [["why", told.reason]] : others.filter(({label}) => SHOWN.has(label)).map(({label, text, level}) => [label, text, level]);
    if (!isLost && glance.rate !== null) rows.push(["rate", `${Math.round(glance.rate)} Hz`]);
    if (glance?.lastFault) rows.push(["last fault", `${glance.lastFault}${isLost ? "" : ` (over for ${spoken(glance.faultAge)})`}`]);
    this.lines.replaceChildren(...rows.flatMap(([label, text, level = ""]) => [make("dt", {textContent: label}),
      make("dd", {className: `says-${label.replaceAll(" ", "-")} ${level}`, textContent: text})]));
  }
}

class FleetPage {
  constructor() {
    this.cards = new Map();  // by the numbers of robots
    this.waiting = new Set();  // cards whose newest frame is not drawn yet
    this.models = new Map();  // meshes by the names of models, and the parts that were uploaded
    try {
      this.scene = new Scene(find("view"), document.body.dataset.parts.includes("plain"));
    } catch (error) {
      this.failure = `There are no pictures: ${error.message}. A newer browser can show them.`;
    }
    this.connect();
  }

  connect() {
    const socket = new WebSocket(`ws://${location.host}/`);
    socket.binaryType = "arraybuffer";
    socket.onmessage = (event) => this.hear(event.data);
    socket.onopen = () => {  // the server tells all again, perhaps of other robots
      this.cards.clear();
      this.waiting.clear();
      find("cards").replaceChildren();
      find("error").textContent = this.failure ?? "";
    };
    socket.onclose = () => {
      find("error").textContent = "The program of this page does not answer, so all of this is old. 'trifinger view --fleet' starts it again.";
      for (const card of this.cards.values()) card.element.className = "lost";
      setTimeout(() => this.connect(), 1000);
    };
  }

  hear(bytes) {
    const size = new DataView(bytes).getUint32(0, true), told = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, size)));
    const numbers = new Numbers(bytes, 4 + size);
    if (told.kind === "none") Object.assign(find("none"), {textContent: told.text, hidden: this.cards.size > 0});
    if (told.kind === "model") this.models.set(told.model, {numbers, meshes: new Map()});
    if (told.robot === undefined) return;
    if (!this.cards.has(told.robot)) {
      this.cards.set(told.robot, new Card());
      find("cards").replaceChildren(...[...this.cards].sort(([a], [b]) => a - b).map(([, card]) => card.element));
      find("none").hidden = true;
    }
    this[`on_${told.kind}`](this.cards.get(told.robot), told, numbers);
  }

  on_host(card, told) {
    card.told = told;
    this.show(card);
  }

  on_glance(card, told) {
    card.glance = told;
    this.show(card);
  }

  on_images(card, told, numbers) {
    URL.revokeObjectURL(card.photo.src);
    card.photo.hidden = !told.images.length;
    card.canvas.hidden = !card.photo.hidden;
    if (!told.images.length) return;
    card.figure.hidden = false;
    card.photo.src = URL.createObjectURL(new Blob([numbers.floats(told.images[0][1], Uint8Array)], {type: "image/jpeg"}));
  }

  on_session(card, told) { Object.assign(card, {session: told, bodies: null}); }

  on_frame(card, told, numbers) {
    card.frame = {told, numbers};
    this.waiting.add(card);
    if (this.scene && this.waiting.size === 1) requestAnimationFrame(() => this.drawNext());
  }

  // Draws one robot in each picture of the browser, so a slow one draws less often and stays quick to answer.
  drawNext() {
    const [card] = this.waiting;
    if (!card) return;
    this.waiting.delete(card);
    this.draw(card);
    if (this.waiting.size) requestAnimationFrame(() => this.drawNext());
  }

  // Draws a robot into its card; one scene does it for all cards, since browsers have few.
  draw(card) {
    const {session, frame: {told, numbers}} = card, model = this.models.get(session?.model);
    if (!model || told.session !== session.session || !session.bodies.length || card.canvas.hidden) return;
    const upload = (part) => this.scene.upload({positions: model.numbers.floats(part.positions), normals: model.numbers.floats(part.normals, Int8Array),
      colours: model.numbers.floats(part.colours, Uint8Array), triangles: model.numbers.floats(part.triangles, Uint32Array)});
    const meshOf = (part) => model.meshes.get(part.positions[0]) ?? model.meshes.set(part.positions[0], upload(part)).get(part.positions[0]);
    const poses = numbers.floats(told.poses), {home} = session;
    Object.assign(this.scene, {bodies: [], arrows: [], handles: [], home, middle: home.middle, target: home.middle,
      zoom: session.bodies.some(({parts}) => parts.some((part) => part.isSurround)) ? 0.7 : 1, azimuth: home.azimuth, elevation: home.elevation});
    for (const [i, {parts}] of session.bodies.entries()) {
      const pose = poses.subarray(7 * i, 7 * i + 7);
      if (Number.isNaN(pose[0])) continue;
      for (const part of parts) if (!part.isSurround) this.scene.add(meshOf(part), {pose, isFaint: part.isTransparent});
    }
    this.scene.draw();
    card.figure.hidden = false;
    card.canvas.getContext("2d").drawImage(find("view"), 0, 0, card.canvas.width, card.canvas.height);
  }

  show(card) {
    card.show();
    const count = (level) => [...this.cards.values()].filter((one) => one.level === level).length;
    const bad = count("bad"), lost = count("lost"), all = this.cards.size;
    const words = [bad && `${bad} with a fault`, lost && `${lost} cannot be reached`].filter(Boolean).join(" · ");
    find("counts").replaceChildren(`${all} robot${all === 1 ? "" : "s"}`, ...words ? [" · ", make("b", {textContent: words})] : [" · no fault"]);
    document.body.classList.toggle("small", all > MANY || window.matchMedia("(max-width: 520px)").matches);
    document.title = `${words ? `${words} · ` : ""}${document.querySelector("h1").textContent}`;
  }
}

window.trifingerPage = new FleetPage();

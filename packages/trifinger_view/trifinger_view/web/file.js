// SPDX-License-Identifier: BSD-3-Clause
// The page of one log in one file: all that it shows is in the file, and the time line moves here.

async function unpack(text) {
  const letters = atob(text), bytes = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; ++i) bytes[i] = letters.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

// A position between two times [s]. It moves while it plays; playing.py has the same rules.
class TimeLine {
  constructor(begin, end, fault, clock = () => performance.now() / 1000) {
    Object.assign(this, {begin, end, fault, clock, speed: 1, isLooping: false, isPlaying: false, onMove: () => {}});
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
    this.onMove();
  }
  pause() { void this.position; this.isPlaying = false; this.onMove(); }
  toggle() { void this.position; if (this.isPlaying) this.pause(); else this.play(); }
  setSpeed(speed) { void this.position; this.speed = speed; this.onMove(); }
  setLooping(isLooping) { void this.position; this.isLooping = isLooping; this.onMove(); }
  moveTo(time) { void this.position; this.at = Math.min(Math.max(time, this.begin), this.end); this.onMove(); }
  skip(seconds) { this.pause(); this.moveTo(this.at + seconds); }
  goToFault() { if (this.fault !== null) { this.pause(); this.moveTo(this.fault); } }
}

class FilePage extends Page {
  constructor(index, bytes) {
    super();
    this.index = index;
    const numbers = this.numbers = new Numbers(bytes);
    this.times = numbers.floats(index.frames.times, Float64Array);
    this.steps = numbers.floats(index.frames.steps, Float64Array);
    this.marks = numbers.floats(index.frames.marks, Uint8Array);
    this.line = new TimeLine(index.begin, index.end, index.fault && index.fault.time);
    this.line.step = (distance) => {
      this.line.pause();
      const frame = before(this.times, this.line.position) + distance;
      this.line.moveTo(this.times[Math.min(Math.max(frame, 0), this.times.length - 1)]);
    };
    this.begin(index, numbers);
    this.courses = index.bodies.map((body) => numbers.floats(body.poses));
    this.ghosts = index.bodies.map((body) => body.ghosts && numbers.floats(body.ghosts));
    this.ghostIsThere = numbers.floats(index.ghost, Uint8Array);
    this.forces = index.forces.map((place) => numbers.floats(place));
    this.cameras = index.images.map((camera) => ({...camera, shown: -1}));
    this.controls = new Controls(this.line, [...this.times].filter((_, i) => this.marks[i] & index.warnings));
    this.showPlots(index.plots.map((plot) => ({
      ...plot, times: numbers.floats(plot.times, Float64Array),
      lines: plot.lines.map((line) => ({...line, low: numbers.floats(line.low), high: numbers.floats(line.high)})),
    })), index.groups, index.begin, index.end);
    this.line.onMove = () => this.run();
    this.show();
  }

  // Shows what the time line shows, as long as that moves.
  run() {
    this.show();
    if (this.isRunning || !this.line.isPlaying) return;
    this.isRunning = true;
    const next = () => {
      this.show();
      this.isRunning = this.line.isPlaying;
      if (this.isRunning) requestAnimationFrame(next);
    };
    requestAnimationFrame(next);
  }

  // The pose at a time: x, y, z, quaternion. Between two frames it is interpolated.
  poseAt(course, time) {
    const count = this.times.length;
    if (course.length === 7) return course;
    const i = before(this.times, time), j = Math.min(i + 1, count - 1), span = this.times[j] - this.times[i];
    // Over a gap of the log, the pose before it stays.
    const share = span > 0 && span < 3 * this.index.frames.span ? Math.min(Math.max((time - this.times[i]) / span, 0), 1) : 0;
    const at = (frame) => Array.from({length: 7}, (_, k) => course[k * count + frame]);
    const [a, b] = [at(i), at(j)];
    if (Number.isNaN(b[0])) return a;
    const sign = a[3] * b[3] + a[4] * b[4] + a[5] * b[5] + a[6] * b[6] < 0 ? -1 : 1;
    const pose = a.map((number, k) => number + share * ((k > 2 ? sign : 1) * b[k] - number));
    const length = Math.hypot(...pose.slice(3));
    return pose.map((number, k) => k > 2 ? number / length : number);
  }

  // Shows the scene, the images, the words and the cursors of the present time.
  show() {
    const time = this.line.position, frame = before(this.times, time), count = this.times.length;
    this.frame = frame;
    const poses = (courses) => Float32Array.from(this.courses.flatMap((course, i) => [...this.poseAt(courses[i] ?? course, time)]));
    const forces = this.forces.flatMap((numbers) => Array.from({length: 6}, (_, k) => numbers[k * count + frame]));
    this.place(poses(this.courses), this.ghostIsThere[frame] ? poses(this.ghosts) : null, Float32Array.from(forces), this.steps[frame]);
    const images = new Map();
    for (const camera of this.cameras) {
      const number = camera.times[0] <= time ? before(camera.times, time) : -1;
      if (number >= 0) images.set(camera.name, this.numbers.floats(camera.places[number], Uint8Array));
      camera.isNew = number !== camera.shown;
      camera.shown = number;
    }
    if (this.cameras.some((camera) => camera.isNew)) this.showImages(images);
    this.tell(time, frame);
    this.drawCursors(time);
    this.controls.show();
  }

  // The state of the session in words.
  tell(time, frame) {
    const {index} = this, isFault = Boolean(index.fault) && time >= index.fault.time;
    const marks = index.marks.filter((_, bit) => this.marks[frame] >> bit & 1);
    let text = marks.length ? marks.join(", ") : "running";
    if (frame === this.times.length - 1 && index.ends) text = index.ends.text;
    if (isFault) text = index.fault.text;
    this.say([{label: "state", text, level: isFault ? "bad" : this.marks[frame] & index.warnings ? "warning" : ""},
      {label: "step", text: String(this.steps[frame]), level: ""}]);
  }
}

async function main() {
  const holder = find("numbers"), index = JSON.parse(find("index").textContent);
  const bytes = await unpack(holder.textContent.trim());
  holder.remove();
  window.trifingerPage = Object.assign(new FilePage(index, bytes), {TimeLine});
  document.body.dataset.isReady = "true";
}

main().catch((error) => {
  find("error").textContent = `This page could not be shown: ${error.message ?? error}. A newer browser can.`;
  document.body.dataset.isReady = "false";
});

// SPDX-License-Identifier: BSD-3-Clause
// Fills the lines with as many numbers as a screen shows, at the start and after each zoom.
const page = document.getElementById("{plot_id}");
const STRETCHES = 900;  // of a line on the screen

async function unpack(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

// The place of the first of some ascending times that is not before `time`.
function place(times, time) {
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < time) low = middle + 1; else high = middle;
  }
  return low;
}

// From the smallest to the largest number of each stretch between two times; null at gaps.
function seen(line, begin, end) {
  const first = Math.max(place(line.times, begin) - 1, 0);
  const last = Math.min(place(line.times, end) + 1, line.times.length);
  const size = Math.max(1, Math.ceil((last - first) / STRETCHES));
  const x = [], y = [];
  for (let i = first; i < last; i += size) {
    let low = Infinity, high = -Infinity;
    for (let j = i; j < Math.min(i + size, last); ++j) {
      if (line.low[j] < low) low = line.low[j];
      if (line.high[j] > high) high = line.high[j];
    }
    if (low > high) { x.push(line.times[i]); y.push(null); continue; }
    x.push(line.times[i]); y.push(low);
    if (high > low) { x.push(line.times[i]); y.push(high); }
  }
  return [x, y];
}

async function main() {
  const index = JSON.parse(document.getElementById("index").textContent);
  const bytes = await unpack(document.getElementById("numbers").textContent.trim());
  const lines = index.lines.map(([trace, times, low, high, count]) => ({
    trace: trace,
    times: new Float64Array(bytes, times, count),
    low: new Float32Array(bytes, low, count),
    high: new Float32Array(bytes, high, count),
  }));
  const chosen = new Set();  // axes whose range is the reader's
  const show = (begin, end) => {
    const found = lines.map((line) => seen(line, begin, end));
    const change = {x: found.map((line) => line[0]), y: found.map((line) => line[1])};
    // Plotly does not fit axes that share their range to numbers that come later.
    const ranges = {};
    for (const [axes, least] of index.shared.filter(([axes]) => !axes.some((axis) => chosen.has(axis)))) {
      const numbers = found.filter((_, i) => axes.includes(index.axes[i]))
        .flatMap((line) => line[1]).filter((number) => number !== null);
      const low = numbers.reduce((a, b) => Math.min(a, b), Infinity);
      const high = numbers.reduce((a, b) => Math.max(a, b), -Infinity);
      if (high < low) continue;
      const shown = Math.max(least, index.share * Math.max(Math.abs(low), Math.abs(high))) || 1;
      const margin = Math.max(shown - (high - low), 0) / 2 + index.margin * (high - low);
      for (const axis of axes) ranges[axis + ".range"] = [low - margin, high + margin];
    }
    return Plotly.update(page, change, ranges, lines.map((line) => line.trace));
  };
  await show(-Infinity, Infinity);
  page.setAttribute("data-is-drawn", "true");
  page.on("plotly_relayout", (change) => {
    const keys = Object.keys(change);
    for (const key of keys) {
      const [axis, what] = key.split(".");
      if (axis.startsWith("yaxis") && what === "autorange") chosen.delete(axis);
      if (axis.startsWith("yaxis") && what === "range[0]") chosen.add(axis);
    }
    if (!keys.some((key) => /^[xy]axis/.test(key))) return;
    const axis = page._fullLayout.xaxis;
    if (axis.autorange || keys.some((key) => /^xaxis.*autorange$/.test(key))) {
      show(-Infinity, Infinity);
    } else {
      show(axis.range[0], axis.range[1]);
    }
  });
}

main().catch((error) => {
  document.getElementById("error").textContent =
    "The numbers of this page could not be unpacked: " + error + ". A newer browser can.";
});

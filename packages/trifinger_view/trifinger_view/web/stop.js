// SPDX-License-Identifier: BSD-3-Clause
// The stop of a page. It uses nothing of the page around it, and works whatever that does.
(() => {
  "use strict";
  const HEADERS = {"X-TriFinger": "stop"};  // no page of another site can send it
  const TIMEOUT = 2000;  // for an answer to a new connection [ms]
  const LINE_TIMEOUT = 1000;  // over the open one [ms]
  const place = document.getElementById("stop"), [button, output] = place.children;
  place.hidden = false;
  let order = 0;
  const say = (text, isBad) => {
    output.textContent = text;
    output.className = isBad ? "bad" : "";
  };
  // It is open before the button is pressed: a new connection might have to wait for other clients.
  let line = null;
  let number = 0;
  const waiting = new Map();
  const openLine = () => {
    const socket = new WebSocket(`ws://${location.host}/actions`);
    socket.onopen = () => { line = socket; };
    socket.onclose = () => {
      if (line === socket) line = null;
      setTimeout(openLine, 1000);
    };
    socket.onmessage = (event) => {
      const answer = JSON.parse(event.data);
      const done = waiting.get(answer.number);
      waiting.delete(answer.number);
      if (done) done(answer);
    };
  };
  openLine();
  const askLine = (path) => new Promise((done, failed) => {
    const own = String(++number);
    const timer = setTimeout(() => { waiting.delete(own); failed(); }, LINE_TIMEOUT);
    waiting.set(own, (answer) => { clearTimeout(timer); done(answer); });
    line.send(`${own} ${path}`);
  });
  const askAnew = (path) => {
    const end = new AbortController();
    const timer = setTimeout(() => end.abort(), TIMEOUT);
    return fetch(path, {headers: HEADERS, cache: "no-store", signal: end.signal})
      .then((answer) => answer.text().then((text) => ({status: answer.status, text})))
      .finally(() => clearTimeout(timer));
  };
  const ask = (path) => (line ? askLine(path).catch(() => askAnew(path)) : askAnew(path));
  // Asks until it has an answer: the back-end is told once, however often it is asked for that.
  const stop = async () => {
    const own = ++order;
    let path = "/stop";
    say("Stopping");
    while (own === order) {
      try {
        const answer = await ask(path);
        if (own !== order) return;
        say(answer.text, answer.status >= 400);
        if (answer.status !== 202) return;
        path = "/stopped";
      } catch {
        if (own !== order) return;
        say(`NOT stopped: this page's server does not answer. Run in a terminal: trifinger stop ${document.body.dataset.robot}`, true);
      }
      await new Promise((done) => setTimeout(done, 200));
    }
  };
  button.addEventListener("click", stop);
  window.addEventListener("keydown", (event) => {
    if (event.key === "Escape" && !event.repeat) stop();
  }, true);
})();

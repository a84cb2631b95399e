/** The time of a delivery: a line with marks, play and speed, steps to the neighbouring events, a link to the moment. */
import { el, number, say, svg } from "./dom.js";
import { MARKS } from "./replay.js";

const ICONS = {
  play: "M4 2l9 6-9 6z",
  pause: "M4 2h3v12H4zM9 2h3v12H9z",
  back: "M3 2h2v12H3zM13 2v12L6 8z",
  on: "M11 2h2v12h-2zM3 2v12l7-6z",
};
const icon = (name) =>
  svg("svg", { viewBox: "0 0 16 16", class: "icon", "aria-hidden": "true" }, svg("path", { d: ICONS[name] }));
const SPEEDS = [0.5, 1, 2, 5, 10, 30];

/** `seek(time)` is called when somebody goes elsewhere; `live()` when they want to follow what happens. */
export function makeTimeline({ seek, live, linkOf }) {
  const play = el("button", { type: "button", class: "icon", onclick: toggle }, icon("play"));
  const back = el(
    "button",
    {
      type: "button",
      class: "icon",
      "aria-label": "Previous event",
      title: "Previous event (←)",
      onclick: () => step(-1),
    },
    icon("back"),
  );
  const on = el(
    "button",
    { type: "button", class: "icon", "aria-label": "Next event", title: "Next event (→)", onclick: () => step(1) },
    icon("on"),
  );
  const speed = el(
    "select",
    { "aria-label": "Speed" },
    ...SPEEDS.map((s) => el("option", { value: s, selected: s === 1 }, `${s}×`)),
  );
  const line = el("input", {
    type: "range",
    min: 0,
    max: 1,
    step: "any",
    value: 0,
    "aria-label": "Time",
    oninput: () => go(Number(line.value)),
  });
  const marks = svg("svg", {
    class: "marks",
    viewBox: "0 0 1000 14",
    preserveAspectRatio: "none",
    "aria-hidden": "true",
  });
  const label = el("span", { class: "time" }),
    follow = el(
      "button",
      {
        type: "button",
        onclick: () => {
          stop();
          live();
        },
      },
      "live",
    );
  const link = el("button", { type: "button", title: "Copies a link to this moment", onclick: copy }, "copy link");
  const key = el("ul", { class: "legend" });
  let replay = null,
    time = 0,
    playing = false,
    before = 0,
    drawn = -1;

  function toggle() {
    if (playing) stop();
    else start();
  }
  function start() {
    if (!replay?.events.length) return;
    if (time >= replay.duration - 0.01) seek(0);
    playing = true;
    before = performance.now();
    requestAnimationFrame(tick);
    face();
  }
  function stop() {
    playing = false;
    face();
  }
  function tick(now) {
    if (!playing || !line.isConnected) return;
    const at = time + ((now - before) / 1000) * Number(speed.value);
    before = now;
    if (at >= replay.duration) stop();
    seek(Math.min(at, replay.duration));
    if (playing) requestAnimationFrame(tick);
  }
  function go(at) {
    stop();
    seek(at);
  }
  function step(by) {
    // events of one moment are passed together, or a step back would stay where it is
    const there =
      by < 0
        ? replay.events.findLast((event) => event.time_s < time)
        : replay.events.find((event) => event.time_s > time);
    if (there) go(there.time_s);
  }
  function face() {
    play.replaceChildren(icon(playing ? "pause" : "play"));
    play.setAttribute("aria-label", playing ? "Pause" : "Play");
    play.title = playing ? "Pause (space)" : "Play (space)";
  }
  async function copy() {
    const address = linkOf(time);
    try {
      await navigator.clipboard.writeText(address);
      say(link, "copied");
    } catch {
      prompt("The link to this moment", address);
    }
    setTimeout(() => say(link, "copy link"), 1500);
  }

  function draw(model) {
    ({ replay, time } = model);
    line.max = Math.max(replay.duration, 0.01);
    line.value = time;
    line.setAttribute("aria-valuetext", `${number(time)} of ${number(replay.duration)} seconds`);
    say(label, `${number(time)} / ${number(replay.duration)} s`);
    follow.hidden = !model.running;
    follow.setAttribute("aria-pressed", String(model.following));
    follow.className = model.following ? "live" : "";
    if (drawn !== replay.events.length) {
      drawn = replay.events.length;
      const marked = replay.events.filter((e) => MARKS[e.kind]);
      marks.replaceChildren(
        ...marked.map((e) =>
          svg("rect", { class: `mark ${e.kind}`, x: (e.time_s / line.max) * 998, y: 1, width: 3, height: 12 }),
        ),
      );
      const kinds = [...new Set(marked.map((e) => e.kind))];
      key.replaceChildren(
        ...kinds.map((kind) =>
          el(
            "li",
            {},
            svg(
              "svg",
              { viewBox: "0 0 12 12", class: "marks sign", "aria-hidden": "true" },
              svg("rect", { class: `mark ${kind}`, x: 4, y: 0, width: 4, height: 12 }),
            ),
            MARKS[kind],
          ),
        ),
      );
    }
  }

  face();
  const node = el(
    "div",
    { class: "timeline" },
    el("div", { class: "row" }, back, play, on, speed, label, follow, link),
    el("div", { class: "line" }, marks, line),
    key,
  );
  return { node, draw, toggle, step, stop };
}

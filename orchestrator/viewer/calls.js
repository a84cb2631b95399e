/** The questions to models: what was asked, what was answered, how long it took, what it cost. */
import { el, keyed, number, say } from "./dom.js";

export function makeCalls(seek) {
  const body = el("tbody"),
    sum = el("span", { class: "soft" });
  const head = el(
    "thead",
    {},
    el(
      "tr",
      {},
      ...["When", "Role", "Asked", "Answered", "Took", "Tokens"].map((name, i) =>
        el("th", { scope: "col", class: i > 3 ? "figure" : null }, name),
      ),
    ),
  );
  const node = el(
    "section",
    { class: "card" },
    el("h2", {}, "Questions to models ", sum),
    el(
      "div",
      { class: "scroll", tabindex: 0, role: "region", "aria-label": "Questions to models" },
      el("table", {}, head, body),
    ),
  );

  function row(call) {
    const when = el(
      "button",
      { type: "button", class: "link", onclick: () => seek(call.event.time_s) },
      `${number(call.event.time_s)} s`,
    );
    const who = [call.backend, call.model].filter(Boolean).join(", ");
    return el(
      "tr",
      {},
      el("td", {}, when),
      el("td", { title: who }, call.role),
      el("td", {}, call.asked),
      el("td", { title: call.words }, call.answered),
      el("td", { class: "figure" }, call.cached ? "cached" : `${number(call.seconds, 2)} s`),
      el("td", { class: "figure" }, call.tokens ? String(call.tokens) : "–"),
    );
  }
  return {
    node,
    draw({ replay, index }) {
      const calls = replay.calls(index);
      keyed(
        body,
        calls,
        (call) => call.event.number,
        row,
        () => {},
      );
      const seconds = calls.reduce((all, call) => all + (call.cached ? 0 : call.seconds), 0);
      const tokens = calls.reduce((all, call) => all + call.tokens, 0);
      const cost = tokens ? `, ${tokens} tokens` : calls.length ? ", no tokens: models of this machine" : "";
      say(sum, calls.length ? `${calls.length} asked, ${number(seconds)} s${cost}` : "none yet");
    },
  };
}

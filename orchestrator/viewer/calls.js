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
      ...["When", "Role", "Asked", "Answered", "Took", "Tokens", "Cost"].map((name, i) =>
        el("th", { scope: "col", class: i > 3 ? `figure ${name.toLowerCase()}` : null }, name),
      ),
    ),
  );
  const node = el(
    "section",
    { class: "card calls" },
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
      el("td", { class: "figure cost" }, call.usd === null ? "–" : dollars(call.usd)),
    );
  }
  return {
    node,
    draw({ replay, index }) {
      const calls = replay.calls(index);
      keyed(body, calls, (call) => call.event.number, row);
      node.classList.toggle("priced", calls.some((call) => call.usd !== null));
      say(sum, calls.length ? sumOf(calls) : "none yet");
    },
  };
}

/** How many were asked, how long they took, and what is known of tokens and cost: nothing is said of what is not. */
function sumOf(calls) {
  const seconds = calls.reduce((all, call) => all + (call.cached ? 0 : call.seconds), 0);
  const tokens = calls.reduce((all, call) => all + call.tokens, 0);
  const cost = costWords(calls);
  return `${calls.length} asked, ${number(seconds)} s${tokens ? `, ${tokens} tokens` : ""}${cost ? `, ${cost}` : ""}`;
}

/** What the calls cost that a price is known of; null where it is of none. */
export function costWords(calls) {
  const priced = calls.filter((call) => call.usd !== null);
  if (!priced.length) return null;
  const paid = calls.filter((call) => !call.cached).length;
  const whole = dollars(priced.reduce((all, call) => all + call.usd, 0));
  return priced.length === paid ? whole : `${whole} for ${priced.length} of ${paid} with a price`;
}

const dollars = (usd) => `$ ${usd < 1 ? usd.toFixed(5) : usd.toFixed(2)}`;

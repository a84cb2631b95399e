/** What is known of a delivery at a moment, its log, and its state as steps. */
import { el, keyed, number, say } from "./dom.js";
import { STEPS, STEP_NAMES } from "./wording.js";

/** Pairs of a name and a text. */
export function factsOf(delivery, replay, index) {
  const rows = [];
  const messages = [
    ["understood", "parsed"],
    ["floor", "floor_count"],
    ["last look", "look"],
    ["direction", "direction"],
    ["guard", "refused"],
  ];
  for (const [name, kind] of messages) {
    const event = replay.lastOf(index, kind);
    if (event) rows.push([name, event.message]);
  }
  const search = replay.last(index, (e) => e.kind === "search" && e.data.inspected_share !== null);
  if (search) rows.push(["facade looked at", `${number(100 * search.data.inspected_share, 0)} %`]);
  const placed = replay.lastOf(index, "placed");
  if (placed) rows.push(["drone", `${placed.data.vehicle_kind}, cameras ${placed.data.cameras.join(", ")}`]);
  if (delivery?.vehicle)
    rows.push(["vehicle", delivery.vehicle + (delivery.flights > 1 ? `, flight ${delivery.flights}` : "")]);
  if (delivery?.scene) rows.push(["street", delivery.scene]);
  if (delivery?.priority) rows.push(["priority", String(delivery.priority)]);
  const ended = replay.lastOf(index, "result");
  if (ended) rows.push(...resultFacts(ended.data));
  return rows;
}

export function resultFacts(result) {
  const rows = [
    ["outcome", result.message],
    ["stops", `${result.steps} with a question to a model, ${result.exploration_steps} searching`],
    ["flown", `${number(result.path_m)} m in ${number(result.flight_s, 0)} s of flight`],
    ["took", `${number(result.timings_s.total)} s`],
  ];
  if (result.verdict?.judged && result.verdict.distance_m !== undefined)
    rows.push(["from the window", `${number(result.verdict.distance_m)} m`]);
  if (result.search_policy) rows.push(["search", result.search_policy]);
  if (result.renderer) rows.push(["pictures by", result.renderer]);
  return rows;
}

export function makeFacts(title = "What is known") {
  const list = el("dl");
  const node = el("section", { class: "card" }, el("h2", {}, title), list);
  return {
    node,
    draw(rows) {
      list.replaceChildren(...rows.flatMap(([name, value]) => [el("dt", {}, name), el("dd", {}, value)]));
    },
  };
}

/** The steps of a delivery: those that were, the one now. */
export function makeSteps() {
  const items = STEPS.map((phase) => el("li", {}, STEP_NAMES[phase]));
  const node = el("ol", { class: "steps", "aria-label": "Steps of the delivery" }, ...items);
  return {
    node,
    draw({ replay, index }) {
      const been = new Set(replay.events.slice(0, index + 1).map((e) => e.phase));
      const now = replay.events[index]?.phase;
      items.forEach((item, i) => {
        const state = STEPS[i] === now ? "now" : been.has(STEPS[i]) ? "was" : "";
        item.className = state;
        item.title = state === "now" ? "now" : state === "was" ? "done" : "to come";
        if (state === "now") item.setAttribute("aria-current", "step");
        else item.removeAttribute("aria-current");
      });
    },
  };
}

export function makeLog(seek) {
  const body = el("tbody"),
    count = el("span", { class: "soft" });
  const box = el(
    "div",
    { class: "scroll", tabindex: 0, role: "region", "aria-label": "Log" },
    el("table", { class: "log" }, body),
  );
  const node = el("section", { class: "card" }, el("h2", {}, "Log ", count), box);
  const row = (e) =>
    el(
      "tr",
      {},
      el(
        "td",
        { class: "figure" },
        el("button", { type: "button", class: "link", onclick: () => seek(e.time_s) }, `${number(e.time_s, 2)} s`),
      ),
      el("td", {}, STEP_NAMES[e.phase] ?? e.phase),
      el("td", {}, e.message),
    );
  let lit = null;
  return {
    node,
    draw({ replay, index, following }) {
      say(count, `${replay.events.length} events`);
      if (body.childElementCount !== replay.events.length)
        keyed(body, replay.events, (e) => e.number, row);
      lit?.classList.remove("on");
      lit = body.children[index] ?? null;
      lit?.classList.add("on");
      if (lit && following) box.scrollTop = box.scrollHeight;
      else if (lit && (lit.offsetTop < box.scrollTop || lit.offsetTop > box.scrollTop + box.clientHeight - 30))
        box.scrollTop = lit.offsetTop - box.clientHeight / 2;
    },
  };
}

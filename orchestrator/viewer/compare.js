/** Two deliveries side by side: both ways in one plan, both fronts at the same share of their time, figures beside. */
import { costWords } from "./calls.js";
import { el, keyed, moment, number, onFrame, say, show } from "./dom.js";
import { makePlan } from "./plan.js";
import { Replay } from "./replay.js";
import { get, stream } from "./server.js";
import { makePicture, pictureOf } from "./views.js";
import { resultFacts } from "./facts.js";
import { stateWords } from "./wording.js";

export function makeCompare(first, second) {
  if (!second) return makeChoice(first);
  const sides = [makeSide(first, () => redraw()), makeSide(second, () => redraw())];
  const plan = makePlan("Both ways from above"),
    share = el("input", {
      type: "range",
      min: 0,
      max: 1,
      step: 0.001,
      value: 1,
      "aria-label": "Share of both deliveries",
      oninput: () => redraw(),
    });
  const body = el("tbody"),
    said = el("span", { class: "time" });
  let street = null;
  const heads = ["figure", "first", "second"].map((name) => el("th", { scope: "col" }, name));
  const node = el(
    "article",
    { class: "compare" },
    el(
      "header",
      {},
      el(
        "div",
        {},
        el("a", { href: `#/delivery/${first}`, class: "back" }, "← the first one"),
        el("h1", {}, "Two deliveries"),
      ),
    ),
    el("section", { class: "card" }, el("div", { class: "row" }, el("label", {}, "Share of the time ", share), said)),
    el("div", { class: "pair" }, ...sides.map((side) => side.node)),
    el(
      "div",
      { class: "pair" },
      el(
        "section",
        { class: "card" },
        el("h2", {}, "Both ways"),
        el("p", { class: "soft" }, "The second one is dashed."),
        plan.node,
      ),
      el(
        "section",
        { class: "card" },
        el("h2", {}, "Figures"),
        el("table", {}, el("thead", {}, el("tr", {}, ...heads)), body),
      ),
    ),
  );
  const redraw = onFrame(draw);

  function draw() {
    const part = Number(share.value),
      [a, b] = sides;
    say(
      said,
      `${number(100 * part, 0)} %: ${number(part * a.replay.duration)} s and ${number(part * b.replay.duration)} s`,
    );
    for (const side of sides) side.draw(part * side.replay.duration);
    plan.draw({ replay: a.replay, index: a.replay.indexAt(part * a.replay.duration), street, others: [b.replay] });
    plan.move(a.replay.poseAt(part * a.replay.duration), "live");
    const [left, right] = sides.map((side) => new Map(figures(side)));
    const names = [...new Set([...left.keys(), ...right.keys()])];
    keyed(
      body,
      names,
      (name) => name,
      (name) => el("tr", {}, el("th", { scope: "row" }, name), el("td"), el("td")),
      (row, name) => {
        say(row.children[1], left.get(name) ?? "–");
        say(row.children[2], right.get(name) ?? "–");
        row.className = left.get(name) === right.get(name) ? "" : "differs";
      },
    );
  }

  get(`/v1/deliveries/${first}/street`).then(
    (found) => {
      street = found;
      redraw();
    },
    () => {},
  );
  return { node, title: () => "Compare", stop: () => sides.forEach((side) => side.stop()) };
}

function figures({ delivery, replay }) {
  if (!delivery) return [];
  const rows = [
    ["request", delivery.request],
    ["street", delivery.scene ?? "–"],
    ["state", stateWords(delivery).text],
  ];
  if (delivery.result) rows.push(...resultFacts(delivery.result));
  const calls = replay.calls(replay.events.length - 1);
  rows.push(
    ["questions to models", String(calls.length)],
    ["models", [...new Set(calls.map((c) => c.model))].join(", ")],
  );
  const cost = costWords(calls);
  if (cost) rows.push(["cost", cost]);
  return rows;
}

function makeSide(id, changed) {
  const replay = new Replay(),
    picture = makePicture("the front camera's last picture"),
    title = el("h2"),
    badge = el("span", { class: "badge" }),
    said = el("p", { class: "soft" });
  const side = {
    replay,
    delivery: null,
    node: el("section", { class: "card" }, title, badge, el("div", { class: "frame square" }, ...picture.nodes), said),
    draw,
    stop,
  };
  const close = stream(
    `/v1/deliveries/${id}/events`,
    {
      step(event) {
        replay.add(event);
        changed();
      },
      end() {
        refresh();
      },
    },
    (error) => say(said, error.status === 404 ? "This delivery is no longer kept." : error.message),
  );
  async function refresh() {
    side.delivery = await get(`/v1/deliveries/${id}`).catch(() => null);
    changed();
  }
  refresh();

  function draw(time) {
    const index = replay.indexAt(time),
      event = replay.last(index, (e) => pictureOf(e, "view"));
    title.replaceChildren(el("a", { href: `#/delivery/${id}` }, side.delivery?.request ?? id));
    if (side.delivery) {
      const { text, tone } = stateWords(side.delivery);
      say(badge, text);
      badge.className = `badge ${tone}`;
    }
    picture.set(event ? `/v1/deliveries/${id}/files/${pictureOf(event, "view")}` : null);
    say(said, replay.events[index]?.message ?? "");
  }
  function stop() {
    close();
  }
  return side;
}

/** With which one? Those of the same request first. */
function makeChoice(first) {
  const list = el("ul", { class: "list" }),
    none = el("p", { class: "soft", hidden: true }, "There is no other delivery yet.");
  const node = el(
    "div",
    { class: "narrow" },
    el(
      "section",
      { class: "card" },
      el("h1", {}, "Compare with which one?"),
      el("p", { class: "soft" }, "Those of the same street and request come first."),
      list,
      none,
    ),
  );
  Promise.all([get(`/v1/deliveries/${first}`), get("/v1/overview?limit=300")]).then(
    ([own, overview]) => {
      const like = (line) => (line.scene === own.scene) + (line.request === own.request);
      const others = overview.deliveries.filter((line) => line.id !== first).sort((a, b) => like(b) - like(a));
      show(none, !others.length);
      list.append(
        ...others.slice(0, 60).map((line) => {
          const { text, tone } = stateWords(line);
          return el(
            "li",
            {},
            el(
              "a",
              { href: `#/compare/${first}/${line.id}` },
              el("span", { class: "top" }, el("span", { class: `badge ${tone}` }, text), moment(line.created)),
              el("span", { class: "text" }, line.request),
            ),
          );
        }),
      );
    },
    (error) => say(none, error.message) && show(none, true),
  );
  return { node, title: () => "Compare", stop() {} };
}

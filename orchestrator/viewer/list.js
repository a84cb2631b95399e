/** The list of deliveries: newest first, by state, by words, as far back as one likes. */
import { el, keyed, moment, say, show, timeZone } from "./dom.js";
import { OUTCOME_NAMES, outcomeWords, stateWords } from "./wording.js";

const PAGE = 100;
const FILTERS = [
  ["", "all"],
  ["status=flying", "flying"],
  ["status=needs_answer", "asking"],
  ["status=waiting", "waiting"],
  ["outcome=delivered", "delivered"],
];
const COUNTED = { "status=flying": "flying", "status=needs_answer": "needs_answer", "status=waiting": "waiting" };

/** `changed()` is called when other deliveries are wanted. */
export function makeList(changed) {
  let filter = "",
    text = "",
    pages = 1,
    timer = null;
  const search = el("input", {
    type: "search",
    placeholder: "Search words or number",
    "aria-label": "Search deliveries",
    oninput: () => {
      clearTimeout(timer);
      timer = setTimeout(() => {
        text = search.value.trim();
        pages = 1;
        changed();
      }, 250);
    },
  });
  const chips = FILTERS.map(([query, name]) =>
    el("button", { type: "button", "aria-pressed": String(query === ""), onclick: () => choose(query) }, name),
  );
  const others = el(
    "select",
    { "aria-label": "Other ways it ended", onchange: () => choose(others.value) },
    el("option", { value: "" }, "ended otherwise…"),
    ...OUTCOME_NAMES.filter((name) => name !== "delivered").map((name) =>
      el("option", { value: `outcome=${name}` }, outcomeWords(name).text),
    ),
  );
  const rows = el("ul", { class: "list" }),
    none = el("p", { class: "soft", hidden: true }),
    first = el("a", { href: "#/order", class: "button for-operators", hidden: true }, "Start a first delivery");
  const more = el(
    "button",
    {
      type: "button",
      hidden: true,
      onclick: () => {
        pages += 1;
        changed();
      },
    },
    "Show older ones",
  );
  const node = el(
    "section",
    { class: "card deliveries", "aria-label": "Deliveries" },
    el("h2", {}, "Deliveries ", el("span", { class: "soft" }, `times in ${timeZone()}`)),
    search,
    el("div", { class: "chips", role: "group", "aria-label": "Which deliveries" }, ...chips, others),
    rows,
    none,
    first,
    more,
  );

  function choose(query) {
    filter = query;
    pages = 1;
    FILTERS.forEach(([one], i) => chips[i].setAttribute("aria-pressed", String(one === query)));
    if (others.value !== query) others.value = "";
    changed();
  }

  function row(line) {
    const badge = el("span", { class: "badge" }),
      words = el("span", { class: "text" }),
      note = el("span", { class: "note" }),
      time = el("span", { class: "soft" }, moment(line.created));
    const node = el(
      "li",
      {},
      el("a", { href: `#/delivery/${line.id}` }, el("span", { class: "top" }, badge, time), words, note),
    );
    node.parts = { badge, words, note };
    return node;
  }
  function update(node, line) {
    const told = JSON.stringify(line);
    if (node.told === told) return;
    node.told = told;
    const { text, tone } = stateWords(line);
    say(node.parts.badge, text);
    node.parts.badge.className = `badge ${tone}`;
    say(node.parts.words, line.request);
    node.parts.note.className = line.question ? "note" : "note soft";
    say(node.parts.note, line.question ?? (line.vehicle && line.status !== "done" ? `flown by ${line.vehicle}` : ""));
  }

  return {
    node,
    /** The query of what is wanted now. */
    query: () =>
      new URLSearchParams({
        limit: Math.min(1000, PAGE * pages),
        ...(text ? { text } : {}),
        ...Object.fromEntries(new URLSearchParams(filter)),
      }),
    draw(overview) {
      keyed(rows, overview.deliveries, (line) => line.id, row, update);
      show(first, !overview.deliveries.length && !text && !filter);
      show(more, !!overview.next && PAGE * pages < 1000);
      show(none, !overview.deliveries.length || (!!overview.next && PAGE * pages >= 1000));
      say(
        none,
        overview.deliveries.length
          ? "There are older ones: search for their words or number."
          : text || filter
            ? "No delivery is like that."
            : "There is no delivery yet.",
      );
      FILTERS.forEach(([query, name], i) => {
        const counted =
          query === "" ? Object.values(overview.counts).reduce((a, b) => a + b, 0) : overview.counts[COUNTED[query]];
        say(chips[i], counted === undefined ? name : `${name} ${counted}`);
      });
    },
  };
}

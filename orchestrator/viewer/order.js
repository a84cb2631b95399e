/** Ordering a delivery: the customer's words, what was understood of them, what is open, and how it is flown. */
import { el, say, show } from "./dom.js";
import { marked } from "./request.js";
import { ask, get, needsServer } from "./server.js";

const READ_AFTER_MS = 400;
const OWN = "own scene file",
  STANDS = "where the vehicle stands";

export function makeOrder() {
  let options = null,
    exchanges = [],
    reading = null,
    scene = null,
    timer = null,
    asked = 0,
    key = crypto.randomUUID?.() ?? String(Math.random());
  const words = el("textarea", {
    id: "words",
    rows: 3,
    maxlength: 4000,
    required: true,
    placeholder: "Please bring my parcel to the fourth floor, the window with the green flower pot.",
    oninput: () => {
      exchanges = [];
      later();
    },
  });
  const place = el("select", { id: "place", onchange: placed }),
    file = el("input", {
      type: "file",
      accept: ".json,application/json",
      "aria-label": "Scene file",
      hidden: true,
      onchange: loaded,
    });
  const model = el("select", { id: "model", onchange: later }),
    search = el("select", { id: "search" }),
    vehicle = el("select", { id: "vehicle" }),
    priority = el(
      "select",
      { id: "priority" },
      ...[...Array(10).keys()].map((n) => el("option", { value: n }, n === 0 ? "0, as usual" : String(n))),
    );
  const understood = el("div", { class: "understood", "aria-live": "polite" }),
    wrong = el("p", { class: "wrong", role: "alert" });
  const send = needsServer(el("button", { class: "primary" }, "Order the delivery"));
  const field = (label, id, ...controls) => el("div", { class: "field" }, el("label", { for: id }, label), ...controls);
  const form = el(
    "form",
    { class: "card order", onsubmit: order },
    el("h1", {}, "Order a delivery"),
    el("p", { class: "soft" }, "Say in your own words where it goes: which floor, and what can be seen at the window."),
    field("Street", "place", place, file),
    field("What shall be brought where?", "words", words),
    understood,
    el(
      "details",
      {},
      el("summary", {}, "How it is flown"),
      el(
        "div",
        { class: "choices" },
        field("Model that sees", "model", model),
        field("Search", "search", search),
        field("Vehicle", "vehicle", vehicle),
        field("Priority", "priority", priority),
      ),
    ),
    wrong,
    el("div", { class: "actions" }, send),
  );
  const node = el("div", { class: "narrow" }, form);

  function later() {
    key = crypto.randomUUID?.() ?? String(Math.random());
    clearTimeout(timer);
    timer = setTimeout(read, READ_AFTER_MS);
  }

  async function read() {
    const request = words.value.trim(),
      mine = ++asked;
    reading = null;
    if (!request) return draw(null);
    say(understood, "reading …");
    try {
      const found = await ask("POST", "/v1/readings", { request, exchanges, model: model.value || null });
      if (mine !== asked) return;
      reading = found;
      draw(request);
    } catch (error) {
      if (mine === asked) understood.replaceChildren(el("p", { class: "wrong" }, error.message));
    }
  }

  /** Shows what was understood, and the words from which. */
  function draw(request) {
    if (!request || !reading) return understood.replaceChildren();
    const { answer, question, known } = reading;
    const rows = [
      ["Floor", answer.floor === null ? "open" : `${answer.floor} (the ground floor is 1)`],
      ["At the window", answer.object ?? "open"],
    ];
    understood.replaceChildren(
      el("h2", {}, "Understood"),
      el("p", { class: "words" }, "“", ...marked(request, answer.evidence), "”"),
      ...exchanges.map((e) => el("p", { class: "soft" }, `${e.question} — ${e.answer}`)),
      el(
        "dl",
        {},
        ...rows.flatMap(([name, value]) => [
          el("dt", {}, name),
          el("dd", { class: value === "open" ? "open" : "" }, value),
        ]),
      ),
      question
        ? questionOf(question)
        : el(
            "p",
            { class: "fine" },
            known === null ? "Nothing is open." : "Nothing is open, and the model can look for such a thing.",
          ),
    );
  }

  function questionOf(text) {
    const line = el("input", {
      maxlength: 1000,
      "aria-label": "Your answer",
      autocomplete: "off",
      onkeydown: (e) => {
        if (e.key === "Enter") {
          e.preventDefault();
          answer();
        }
      },
    });
    const answer = () => {
      if (!line.value.trim()) return;
      exchanges = [...exchanges, { question: text, answer: line.value.trim() }];
      read();
    };
    return el(
      "div",
      { class: "ask" },
      el("p", { class: "asked" }, text),
      el("div", { class: "line" }, line, needsServer(el("button", { type: "button", onclick: answer }, "Answer"))),
      el("p", { class: "soft" }, "It may be ordered as it is: then the delivery asks before it takes off."),
    );
  }

  function placed() {
    show(file, place.value === OWN);
    const sample = options.samples.find((s) => s.name === place.value);
    const begun = document.activeElement === words;
    const untouched = words.value.trim() ? options.samples.some((s) => s.request === words.value) : !begun;
    if (sample && untouched) words.value = sample.request;
    fly();
    later();
  }

  /** Which vehicles may fly it, by where it is flown. */
  function fly() {
    const kind = place.value === STANDS ? "vehicle" : "simulator";
    const fit = options.vehicles.filter((v) => v.kind === kind);
    vehicle.replaceChildren(
      el("option", { value: "" }, "whichever is free"),
      ...fit.map((v) => el("option", { value: v.name }, `${v.name} (${v.state})`)),
    );
    vehicle.disabled = fit.length < 2;
  }

  async function loaded() {
    say(wrong, "");
    scene = null;
    try {
      scene = JSON.parse(await file.files[0].text());
    } catch {
      say(wrong, `${file.files[0]?.name ?? "the file"} is no JSON; choose a scene document`);
    }
  }

  async function order(event) {
    event.preventDefault();
    say(wrong, "");
    if (place.value === OWN && !scene) return say(wrong, "choose the file of the scene");
    send.disabled = true;
    const settings = search.value ? { viewpoint: { policy: search.value } } : undefined;
    const at = place.value === OWN ? { scene } : place.value === STANDS ? {} : { sample: place.value };
    const body = {
      request: words.value.trim(),
      ...at,
      answers: exchanges.map((e) => e.answer),
      priority: Number(priority.value),
      ...(model.value ? { backend: model.value } : {}),
      ...(vehicle.value ? { vehicle: vehicle.value } : {}),
      ...(settings ? { settings } : {}),
    };
    try {
      const delivery = await ask("POST", "/v1/deliveries", body, { "idempotency-key": key });
      location.hash = `#/delivery/${delivery.id}`;
    } catch (error) {
      say(wrong, error.message);
      send.disabled = false;
    }
  }

  async function fill() {
    options = await get("/v1/order-options");
    const samples = options.scenes
      ? options.samples.map((s) => el("option", { value: s.name }, `${s.title} (${s.difficulty})`))
      : [];
    place.replaceChildren(
      samples.length ? el("optgroup", { label: "Simulated streets to try, with a request each" }, ...samples) : "",
      ...(options.scenes ? [el("option", { value: OWN }, "a scene of your own, from a file")] : []),
      ...(options.own_place ? [el("option", { value: STANDS }, "where the vehicle stands")] : []),
    );
    const usual = (list) => list.find((o) => o.usual);
    const choice = (select, list) =>
      select.replaceChildren(
        el("option", { value: "" }, usual(list) ? `as usual: ${usual(list).label}` : "as usual"),
        ...list.filter((o) => !o.usual).map((o) => el("option", { value: o.name }, o.label)),
      );
    choice(model, options.models ?? []);
    choice(search, options.searches);
    placed();
  }
  fill().catch((error) => say(wrong, `What can be chosen could not be asked: ${error.message}.`));

  return {
    node,
    title: () => "Order",
    stop() {
      clearTimeout(timer);
    },
  };
}

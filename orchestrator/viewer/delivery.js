/** One delivery: where the drone is, what it sees, what it asked and decided, now and at any earlier moment. */
import { makeCalls } from "./calls.js";
import { clockTime, el, number, onFrame, say, show, when } from "./dom.js";
import { factsOf, makeFacts, makeLog, makeSteps } from "./facts.js";
import { makeHeight } from "./height.js";
import { LiveDrone } from "./live.js";
import { makePlan } from "./plan.js";
import { makeQuestion } from "./question.js";
import { Replay } from "./replay.js";
import { marked } from "./request.js";
import { ask, connection, get, needsServer, poll, stream } from "./server.js";
import { makeSpace } from "./space.js";
import { makeTimeline } from "./timeline.js";
import { makeMarked, makeViews } from "./views.js";
import { outcomeWords, phaseWords, placeWords, stateWords } from "./wording.js";

/** What arrow keys mean something to. */
const OWN_ARROWS = "input, select, textarea, .scroll, canvas";

/** `session`: {role}; `at`: the moment to show, seconds, or NaN to follow. Returns {node, stop}. */
export function makeDelivery(id, session, at = NaN) {
  const replay = new Replay(),
    drone = new LiveDrone();
  let delivery = null,
    street = null,
    time = at || 0,
    following = Number.isNaN(at),
    ended = false,
    gone = null,
    gap = false,
    drawn = null;

  const address = (file) => `/v1/deliveries/${id}/files/${file}`;
  const request = el("h1"),
    badge = el("span", { class: "badge" }),
    about = el("p", { class: "soft" });
  const trouble = el("p", { class: "trouble", role: "status", hidden: true });
  const cancel = needsServer(el("button", { type: "button", class: "danger", onclick: cancelIt }, "Cancel delivery"));
  const link = needsServer(el("button", { type: "button", onclick: customersLink }, "Customer's link"));
  const compare = el("a", { class: "button", href: `#/compare/${id}` }, "Compare");
  const shared = el("p", { class: "shared", hidden: true });
  const question = makeQuestion(() => `/v1/deliveries/${id}/answer`, { mayAnswer: session.role === "operator" });
  const steps = makeSteps(),
    views = makeViews(address),
    mark = makeMarked(address),
    plan = makePlan(),
    height = makeHeight(),
    space = makeSpace();
  const where = el("p", { class: "where" }),
    facts = makeFacts(),
    calls = makeCalls(seek),
    log = makeLog(seek);
  const timeline = makeTimeline({
    seek,
    live: () => {
      following = true;
      seek(replay.duration, true);
    },
    linkOf: (moment) => `${location.origin}/#/delivery/${id}/${moment.toFixed(1)}`,
  });
  const node = el(
    "article",
    { class: "delivery" },
    el(
      "header",
      {},
      el("div", {}, el("a", { href: "#/", class: "back" }, "← all deliveries"), request, about),
      el("div", { class: "actions" }, badge, session.role === "operator" ? [link, cancel] : null, compare),
    ),
    shared,
    trouble,
    question.node,
    steps.node,
    el(
      "div",
      { class: "stage" },
      el(
        "div",
        { class: "seen" },
        views.node,
        el("section", { class: "card" }, timeline.node),
        el("div", { class: "pair" }, el("section", { class: "card" }, el("h2", {}, "In space"), space.node), mark.node),
        calls.node,
      ),
      el(
        "div",
        { class: "place" },
        el("section", { class: "card" }, el("h2", {}, "From above"), where, plan.node),
        el("section", { class: "card" }, el("h2", {}, "Height"), height.node),
        facts.node,
      ),
    ),
    log.node,
  );

  const redraw = onFrame(draw);

  function seek(to, follow = false) {
    following = follow || (following && to >= replay.duration);
    time = to;
    redraw();
  }

  function draw() {
    const running = !!delivery && delivery.status !== "done" && !ended;
    if (following) time = replay.duration;
    const index = replay.indexAt(time);
    const model = { replay, index, street, time, running, following };
    timeline.draw(model);
    drawHead(running);
    const what = [index, replay.events.length, delivery?.status, !!street].join();
    if (what !== drawn) drawMoment(model);
    drawn = what;
    question.draw(running && following && delivery.status === "needs_answer" ? delivery.question : null);
    place();
  }

  /** What changes from event to event only, not while the drone glides between two. */
  function drawMoment(model) {
    const { index } = model;
    const parsed = replay.lastOf(index, "parsed");
    if (delivery) request.replaceChildren("“", ...marked(delivery.request, parsed?.data.answer.evidence), "”");
    for (const part of [steps, views, mark, plan, height, space, calls, log]) part.draw(model);
    facts.draw(factsOf(delivery, replay, index));
  }

  function drawHead(running) {
    const said = troubleOf(running);
    say(trouble, said);
    show(trouble, said !== "");
    show(cancel, running);
    show(link, !!delivery);
    show(compare, !!delivery);
    if (!delivery) {
      say(request, gone ? "No such delivery" : "Loading …");
      return;
    }
    const words = wordsAt(replay.indexAt(time));
    say(badge, words.text);
    badge.className = `badge ${words.tone}`;
    say(about, `${id} · ordered ${when(delivery.created)}${delivery.vehicle ? ` · flown by ${delivery.vehicle}` : ""}`);
  }

  /** The delivery's state at the moment that is shown. */
  function wordsAt(index) {
    const end = replay.lastOf(index, "result");
    if (end) return outcomeWords(end.data.outcome, end.data.message);
    if (index < replay.events.length - 1)
      return { text: phaseWords(replay.events[index]?.phase ?? "parse"), tone: "quiet" };
    return stateWords({ ...delivery, phase: replay.events[index]?.phase ?? delivery.phase });
  }

  /** What a person has to know before they believe what is shown; empty where all is well. */
  function troubleOf(running) {
    if (gone) return gone;
    if (connection.state !== "live" && running) return "What is shown is as it was when the server answered last.";
    const result = delivery?.result;
    if (result?.message.startsWith("the record breaks off"))
      return `Cut off: ${result.message}. Nothing more will come.`;
    if (gap) return "Some events of this delivery are missing: its record has a gap.";
    if (running && drone.stale)
      return `The drone was last heard at ${clockTime(drone.heard)}; its place is not live.`;
    return "";
  }

  /** The drone's place: as it is told now where the latest is shown, else as the record has it. */
  function place() {
    const verdict = replay.lastOf(replay.indexAt(time), "verdict");
    const liveNow = following && !ended && drone.last && connection.state === "live" && !drone.stale;
    const pose = liveNow ? drone.pose() : replay.poseAt(time);
    const tone = verdict
      ? !verdict.data.judged
        ? "open"
        : verdict.data.delivered
          ? "good"
          : "bad"
      : liveNow || !following || ended
        ? "live"
        : "stale";
    plan.move(pose, tone);
    space.move(pose, tone);
    height.move(pose, replay, time);
    const battery =
      liveNow && drone.last.state.battery.remaining !== null
        ? ` · battery ${number(100 * drone.last.state.battery.remaining, 0)} %`
        : "";
    say(where, pose ? `${placeWords(pose)}${battery}${liveNow ? " · live" : ""}` : "The drone has not taken off yet.");
  }

  function animate() {
    if (!node.isConnected) return;
    if (following && !ended && drone.last) place();
    requestAnimationFrame(animate);
  }

  async function refresh() {
    try {
      delivery = await get(`/v1/deliveries/${id}`);
    } catch (error) {
      if (error.status === 404) gone = "This delivery is no longer kept: it was deleted, with its pictures.";
    }
    redraw();
  }

  async function cancelIt() {
    if (!confirm("End this delivery now? A drone in the air stops and is given back.")) return;
    cancel.disabled = true;
    try {
      delivery = await ask("DELETE", `/v1/deliveries/${id}`);
    } catch (error) {
      say(trouble, `It could not be cancelled: ${error.message}.`);
      show(trouble, true);
    }
    cancel.disabled = false;
    redraw();
  }

  async function customersLink() {
    try {
      const { path } = await ask("POST", `/v1/deliveries/${id}/link`);
      const address = location.origin + path;
      shared.replaceChildren(
        "Whoever has this link sees this delivery, nothing else, and answers its questions: ",
        el("a", { href: path }, address),
      );
    } catch (error) {
      say(shared, error.message);
    }
    show(shared, true);
  }

  function key(event) {
    const own = event.key === " " ? "input, select, textarea, button, a, .scroll, canvas" : OWN_ARROWS;
    if (event.target.closest(own) || event.ctrlKey || event.metaKey || event.altKey) return;
    const does = {
      " ": timeline.toggle,
      ArrowLeft: () => timeline.step(-1),
      ArrowRight: () => timeline.step(1),
      Home: () => seek(0),
      End: () => seek(replay.duration, true),
    };
    if (!does[event.key]) return;
    event.preventDefault();
    does[event.key]();
  }

  document.addEventListener("keydown", key);
  const tellChange = () => redraw();
  connection.addEventListener("change", tellChange);
  const close = stream(
    `/v1/deliveries/${id}/events?drone=true`,
    {
      step(event) {
        const last = replay.events.at(-1)?.number ?? 0;
        if (!replay.add(event)) return;
        if (event.number !== last + 1) gap = true;
        if (["question", "answer", "placed", "result"].includes(event.kind)) refresh();
        redraw();
      },
      drone(seen) {
        drone.hear(seen.state);
      },
      end() {
        ended = true;
        drone.forget();
        refresh();
      },
    },
    (error) => {
      gone =
        error.status === 404 ? "This delivery is no longer kept: it was deleted, with its pictures." : error.message;
      redraw();
    },
  );
  const asking = poll(3000, () => (delivery?.status === "done" ? Promise.resolve() : refresh()));
  get(`/v1/deliveries/${id}/street`).then(
    (plan) => {
      street = plan;
      redraw();
    },
    () => {},
  );
  requestAnimationFrame(() => animate());

  return {
    node,
    title: () => delivery?.request ?? id,
    stop() {
      close();
      asking.stop();
      timeline.stop();
      document.removeEventListener("keydown", key);
      connection.removeEventListener("change", tellChange);
    },
  };
}

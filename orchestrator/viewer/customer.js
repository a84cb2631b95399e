/** A customer's page: their delivery, in their words, and nothing else of the system. */
import { clockTime, duration, el, number, say, show, svg } from "./dom.js";
import { LiveDrone } from "./live.js";
import { background, droneSign, streetFrame } from "./plan.js";
import { makeQuestion } from "./question.js";
import { connection, get, poll } from "./server.js";
import { makePicture } from "./views.js";

/** The page's address is /c/ID.SIGNATURE. */
const id = location.pathname.slice(3).replace(/\.[^.]*$/, "");
const base = `/v1/deliveries/${id}/tracking`;
const STAGES = ["ordered", "waiting for a drone", "on its way", "at your window"];
const PHASES = {
  place: "The drone takes off.",
  floors: "The drone counts the floors to find yours.",
  explore: "The drone is looking for your window.",
  approach: "The drone has seen your window and comes nearer.",
  claim: "The drone is at your window.",
};
const ENDS = {
  delivered: "The drone is in front of your window.",
  stopped_not_judged: "The drone stopped in front of the window that it is sure is yours.",
  wrong_window: "The drone stopped at a window that is not yours.",
  not_in_front: "The drone found your window, but did not stop in front of it.",
  object_not_found: "The drone looked everywhere it could, and did not find what you described.",
  request_incomplete: "The delivery ended, because a question stayed open.",
  object_unknown: "The delivery ended, because the drone can't recognise what you described.",
  floor_not_found: "The drone did not find that floor: the building seems to have fewer.",
  cancelled: "The delivery was cancelled.",
};

const HELD_UP = "Something that is needed does not answer just now; it is tried again and again.";
const OTHER_END = "The drone could not reach your window; whoever sent you this link knows more.";

const request = document.getElementById("request"),
  stages = document.getElementById("stages"),
  now = document.getElementById("now");
const outlook = document.getElementById("outlook"),
  trouble = document.getElementById("trouble"),
  map = document.getElementById("map"),
  stop = document.getElementById("stop");
const question = makeQuestion(() => `/v1/deliveries/${id}/answer`, { answered: () => asking.now() });
document.getElementById("question").append(question.node);
const items = STAGES.map((name) => el("li", {}, name));
stages.append(...items);
const drone = new LiveDrone(),
  sign = droneSign(),
  ground = svg("g");
const picture = svg(
  "svg",
  { viewBox: "0 0 400 400", class: "plan", role: "img", "aria-label": "Where the drone is" },
  ground,
  sign,
);
const place = el("p", { class: "where" });
map.append(picture, place);
const window_ = makePicture("The picture that the drone took where it stopped");
const caption = "A frame marks what it took for what you described: how sure it was (1 is certain), and how far away.";
stop.append(
  el("h2", {}, "The drone's last picture of the window"),
  el("div", { class: "frame square" }, ...window_.nodes),
  el("p", { class: "soft" }, caption),
);
let tracking = null,
  shut = null,
  busy = false,
  heard = null,
  street = null,
  frame = null;

function stageOf({ status, phase, outcome, started }) {
  if (outcome === "delivered" || outcome === "stopped_not_judged" || phase === "claim") return 3;
  if (status === "flying" || (outcome && started)) return 2;
  return phase === "parse" && status !== "needs_answer" ? 0 : 1;
}

function nowOf({ status, phase, outcome, ended, held_up }) {
  if (outcome) return `${ENDS[outcome] ?? OTHER_END}${ended ? ` The delivery ended at ${clockTime(ended)}.` : ""}`;
  if (status === "needs_answer") return "Something is not clear yet: please answer the question.";
  if (held_up) return HELD_UP;
  if (status === "flying") return PHASES[phase] ?? "The drone is on its way.";
  return phase === "parse" ? "Your words are being read." : "A drone will be free soon.";
}

function outlookOf({ status, outcome, outlook: told, started, time }) {
  if (outcome || status === "needs_answer") return "";
  const flight = told.flight,
    usual = flight
      ? `A flight usually takes ${duration(flight.least_s)} to ${duration(flight.most_s)}.`
      : "How long it takes is not known yet.";
  if (status === "waiting")
    return `${told.ahead ? `${told.ahead} ${told.ahead === 1 ? "delivery is" : "deliveries are"} before yours. ` : ""}${usual}`;
  const flown = (new Date(time) - new Date(started)) / 1000;
  return `In the air for ${duration(flown)}. ${usual}`;
}

function draw() {
  tellTrouble();
  if (shut) say(now, shut);
  if (!tracking || shut) return;
  say(request, `“${tracking.request}”`);
  const stage = stageOf(tracking);
  const stopped = tracking.outcome && stage < 3;
  items.forEach((item, i) => {
    item.className = i < stage || (i === stage && stopped) ? "was" : i === stage ? "now" : "";
  });
  say(now, nowOf(tracking));
  say(outlook, outlookOf(tracking));
  question.draw(tracking.status === "needs_answer" ? tracking.question : null);
  show(stop, tracking.picture);
  if (tracking.picture) window_.set(`${base}/picture`);
  show(map, !!tracking.drone || tracking.silent);
}

function tellTrouble() {
  const said = troubleOf();
  say(trouble, said);
  show(trouble, said !== "");
}

/** What has to be known before the page is believed; empty where all is well. */
function troubleOf() {
  if (connection.state !== "live")
    return `The connection is interrupted; this is as it was at ${tracking ? clockTime(tracking.time) : "no time yet"}.`;
  if (busy) return "The server can't tell how it goes just now; trying again …";
  if (!silent()) return "";
  return drone.last
    ? `The drone was last heard at ${clockTime(heard)}; its place is not live.`
    : "The drone does not tell just now where it is.";
}

const silent = () => drone.stale || !!tracking?.silent;

function animate() {
  tellTrouble();
  const pose = drone.pose();
  sign.style.display = pose ? "" : "none";
  if (!pose) say(place, "");
  if (pose) {
    if (!frame?.holds(pose)) reframe([pose]);
    const far = street ? Math.hypot(pose.x - street.start.x, pose.y - street.start.y) : null;
    sign.setAttribute(
      "transform",
      `translate(${frame.x(pose.x)} ${frame.y(pose.y)}) rotate(${(-pose.yaw * 180) / Math.PI})`,
    );
    const old = silent() || connection.state !== "live";
    sign.setAttribute("class", old ? "drone stale" : "drone live");
    const start = far === null ? "" : `, ${number(far, 0)} m from where it started`;
    say(place, `${number(pose.z, 0)} m above the ground${start}${old ? ", when it was last heard" : ""}`);
  }
  requestAnimationFrame(animate);
}

function reframe(drones) {
  frame = streetFrame(street, drones);
  const own = street?.buildings.find((b) => b.target)?.footprint ?? [];
  const middle = (axis) => own.reduce((sum, p) => sum + p[axis], 0) / own.length;
  const name = { x: frame.x(middle("x")), y: frame.y(middle("y")), "text-anchor": "middle" };
  ground.replaceChildren(...background(frame, street), ...(own.length ? [svg("text", name, "your building")] : []));
}

connection.addEventListener("change", draw);
const asking = poll(1000, async () => {
  try {
    tracking = await get(base);
    busy = false;
    if (tracking.drone) {
      heard = tracking.drone.time;
      drone.hear({ pose: tracking.drone.pose });
    } else if (!tracking.silent) drone.forget();
  } catch (error) {
    if (error.status === 404) shut = "This delivery is no longer kept.";
    else if (error.status === 401 || error.status === 403)
      shut = "This link is not good any more; open it anew from where you got it.";
    else busy = !!error.status;
  }
  if (tracking?.outcome || shut) {
    drone.forget();
    asking.stop();
  }
  draw();
});
get(`${base}/street`).then(
  (found) => {
    street = found;
    reframe([]);
  },
  () => {},
);
requestAnimationFrame(animate);

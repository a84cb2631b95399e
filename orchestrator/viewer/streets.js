/** The map of all flights: each street once, with every drone that flies in it. */
import { el, keyed, number, say, show, svg } from "./dom.js";
import { betweenPoses } from "./replay.js";
import { background, droneSign, streetFrame } from "./plan.js";
import { get } from "./server.js";

/** Where the drone is, or where its record has it last; undefined where neither is told. */
const poseOf = (flight) => flight.drone?.state.pose ?? flight.stop ?? undefined;

function wordsOf({ drone, stop, problem }) {
  if (!drone) return problem ?? (stop ? `${number(stop.z)} m high at its last stop` : "takes off");
  const { pose, battery, mode } = drone.state;
  const left = battery.remaining === null ? "" : `, battery ${number(100 * battery.remaining, 0)} %`;
  return `${number(pose.z)} m high${left}, ${mode.replace("_", " ")}`;
}

/** Drones glide from where they were told before to where they were told last. */
const GLIDE_MS = 1100;

export function makeStreets() {
  const grid = el("div", { class: "streets" }),
    about = el("p", { class: "soft" });
  const node = el(
    "section",
    { class: "card", "aria-label": "Flights on their streets" },
    el("h2", {}, "In the air"),
    about,
    grid,
  );
  const plans = new Map(),
    drones = new Map();

  function planOf(flight) {
    if (!flight.street) return null;
    if (!plans.has(flight.street)) {
      plans.set(flight.street, null);
      get(`/v1/deliveries/${flight.delivery}/street`).then(
        (plan) => plans.set(flight.street, plan),
        () => plans.delete(flight.street),
      );
    }
    return plans.get(flight.street);
  }

  function tile() {
    const name = el("h3"),
      picture = svg("svg", { viewBox: "0 0 400 400", class: "plan", role: "group" }),
      flights = el("ul", { class: "flights" });
    const node = el("div", { class: "street" }, name, picture, flights);
    node.parts = { name, picture, flights, drawn: "" };
    return node;
  }

  function update(node, { key, flights }) {
    const { name, picture, flights: list } = node.parts,
      plan = planOf(flights[0]);
    say(name, plan?.name ?? (key.startsWith("alone ") ? "where the vehicle stands" : "a street"));
    picture.setAttribute("aria-label", `${flights.length} in the air: ${plan?.name ?? "a street"}`);
    const shape = JSON.stringify([!!plan, flights.map((f) => f.delivery)]);
    const here = flights.map(poseOf).filter(Boolean);
    if (shape !== node.parts.drawn || !here.every(node.parts.frame.holds)) {
      node.parts.drawn = shape;
      const frame = streetFrame(plan, here.length || plan ? here : [{ x: 0, y: 0 }]);
      node.parts.frame = frame;
      picture.replaceChildren(...background(frame, plan), ...flights.map((f, i) => sign(f, i)));
      for (const f of flights)
        drones.set(f.delivery, {
          ...drones.get(f.delivery),
          node: picture.querySelector(`[data-delivery="${f.delivery}"]`),
          frame,
        });
    }
    for (const f of flights) hear(f);
    const numbered = flights.map((flight, i) => ({ flight, number: i + 1 }));
    keyed(list, numbered, ({ flight }) => flight.delivery, entry, tell);
  }

  function sign(flight, i) {
    return svg(
      "a",
      {
        href: `#/delivery/${flight.delivery}`,
        data: { delivery: flight.delivery },
        style: { display: "none" },
        "aria-label": flight.request,
      },
      droneSign(),
      svg("text", { x: 0, y: -12, "text-anchor": "middle" }, String(i + 1)),
    );
  }

  function hear(flight) {
    const known = drones.get(flight.delivery) ?? {},
      pose = poseOf(flight),
      told = flight.drone?.time ?? JSON.stringify(pose);
    if (pose && told !== known.told)
      Object.assign(known, { from: known.to ?? pose, to: pose, told, at: performance.now() });
    known.silent = !flight.drone;
    drones.set(flight.delivery, known);
  }

  const entry = ({ flight }) =>
    el("li", {}, el("a", { href: `#/delivery/${flight.delivery}` }), el("span", { class: "soft" }));
  function tell(node, { flight, number: at }) {
    say(node.firstChild, `${at} ${flight.request}`);
    say(node.lastChild, wordsOf(flight));
  }

  function animate(now) {
    if (!node.isConnected) return;
    for (const drone of drones.values()) {
      if (!drone.to || !drone.node?.isConnected) continue;
      const pose = betweenPoses(drone.from, drone.to, Math.min(1, (now - drone.at) / GLIDE_MS));
      drone.node.setAttribute(
        "transform",
        `translate(${drone.frame.x(pose.x).toFixed(1)} ${drone.frame.y(pose.y).toFixed(1)})`,
      );
      drone.node.style.display = "";
      drone.node.firstChild.setAttribute("transform", `rotate(${((-pose.yaw * 180) / Math.PI).toFixed(1)})`);
      drone.node.firstChild.setAttribute("class", drone.silent ? "drone stale" : "drone live");
    }
    requestAnimationFrame(animate);
  }
  requestAnimationFrame(() => requestAnimationFrame(animate));

  return {
    node,
    draw(overview) {
      const groups = new Map();
      for (const flight of overview.flights) {
        const key = flight.street ?? `alone ${flight.delivery}`;
        groups.set(key, [...(groups.get(key) ?? []), flight]);
      }
      show(node, overview.vehicles.length > 0 || groups.size > 0);
      say(about, groups.size ? "Blue is the building that is delivered to, where the street is known." : "Nobody flies now.");
      keyed(
        grid,
        [...groups].map(([key, flights]) => ({ key, flights })),
        (group) => group.key,
        tile,
        update,
      );
      const flying = new Set(overview.flights.map((f) => f.delivery));
      for (const name of drones.keys()) if (!flying.has(name)) drones.delete(name);
    },
  };
}

/** The whole system: who flies where, what waits, how the vehicles fare, what needs somebody. */
import { clockTime, el, keyed, number, say, show } from "./dom.js";
import { makeList } from "./list.js";
import { connection, get, poll } from "./server.js";
import { makeStreets } from "./streets.js";

const LOW_BATTERY = 0.25;

export function makeFleet() {
  const list = makeList(() => asking.now()),
    streets = makeStreets(),
    vehicles = makeVehicles(),
    alerts = makeAlerts();
  const trouble = el("p", { class: "trouble", role: "status", hidden: true });
  const node = el(
    "div",
    { class: "fleet" },
    el("h1", { class: "unseen" }, "Deliveries and fleet"),
    list.node,
    el("div", { class: "air" }, trouble, alerts.node, streets.node, vehicles.node),
  );
  let heard = null;

  async function refresh() {
    const overview = await get(`/v1/overview?${list.query()}`);
    heard = overview.time;
    node.classList.toggle("alone", overview.vehicles.length + overview.flights.length === 0);
    for (const part of [list, streets, vehicles, alerts]) part.draw(overview);
    tell();
  }
  function tell() {
    const away = connection.state !== "live";
    say(trouble, away ? `What is shown is as it was at ${heard ? clockTime(heard) : "no time yet"}.` : "");
    show(trouble, away);
    node.classList.toggle("stale", away);
  }
  connection.addEventListener("change", tell);
  const asking = poll(1500, refresh);
  return {
    node,
    title: () => "Fleet",
    stop() {
      asking.stop();
      connection.removeEventListener("change", tell);
    },
  };
}

function makeVehicles() {
  const body = el("tbody");
  const head = el(
    "tr",
    {},
    ...["Vehicle", "State", "Flies", "Battery", "Heard"].map((name) => el("th", { scope: "col" }, name)),
  );
  const node = el(
    "section",
    { class: "card" },
    el("h2", {}, "Vehicles"),
    el(
      "div",
      { class: "scroll", tabindex: 0, role: "region", "aria-label": "Vehicles" },
      el("table", {}, el("thead", {}, head), body),
    ),
  );
  const tones = { ready: "good", flying: "live", lost: "bad" };

  function row(vehicle) {
    const badge = el("span", { class: "badge" }),
      why = el("span", { class: "note" }),
      cells = [0, 1, 2].map(() => el("td"));
    const node = el(
      "tr",
      {},
      el("td", {}, vehicle.name, vehicle.name === vehicle.kind ? null : el("div", { class: "soft" }, vehicle.kind)),
      el("td", {}, badge, why),
      ...cells,
    );
    node.parts = { badge, why, cells };
    return node;
  }
  function update(node, vehicle) {
    const { badge, why, cells } = node.parts,
      battery = vehicle.vehicle?.battery.remaining;
    say(badge, vehicle.state);
    badge.className = `badge ${tones[vehicle.state]}`;
    say(why, vehicle.problem ?? vehicle.vehicle?.health.problems.join("; ") ?? "");
    say(
      cells[0],
      vehicle.kind === "simulator"
        ? `${vehicle.deliveries.length} of ${vehicle.room} drones`
        : (vehicle.deliveries[0] ?? "nothing"),
    );
    say(
      cells[1],
      battery === null || battery === undefined
        ? vehicle.kind === "simulator"
          ? "each its own"
          : "not told"
        : `${number(100 * battery, 0)} %`,
    );
    say(cells[2], vehicle.seen ? clockTime(vehicle.seen) : "never");
  }
  return {
    node,
    draw(overview) {
      show(node, overview.vehicles.length > 0);
      keyed(body, overview.vehicles, (v) => v.name, row, update);
    },
  };
}

/** What somebody should look at: questions, lost vehicles, low batteries, silent drones. */
function makeAlerts() {
  const list = el("ul", { class: "alerts" });
  const node = el(
    "section",
    { class: "card alert-card", hidden: true, "aria-label": "Alerts" },
    el("h2", {}, "Needs somebody"),
    list,
  );
  function alertsOf({ asking, flights, vehicles }) {
    const found = [];
    for (const v of vehicles) {
      if (v.state === "lost")
        found.push({ key: `lost ${v.name}`, tone: "bad", text: `${v.name} is lost: ${v.problem ?? "it does not answer"}` });
      const battery = v.vehicle?.battery.remaining ?? 1;
      if (battery < LOW_BATTERY)
        found.push({
          key: `battery ${v.name}`,
          tone: "bad",
          text: `${v.name} has ${number(100 * battery, 0)} % of its battery left`,
        });
    }
    for (const f of flights) {
      const link = `#/delivery/${f.delivery}`,
        battery = f.drone?.state.battery.remaining ?? 1;
      if (f.problem)
        found.push({
          key: `silent ${f.delivery}`,
          tone: "bad",
          link,
          text: `a drone does not tell where it is: ${f.problem}`,
        });
      else if (battery < LOW_BATTERY)
        found.push({
          key: `battery ${f.delivery}`,
          tone: "bad",
          link,
          text: `a drone has ${number(100 * battery, 0)} % of its battery left`,
        });
    }
    for (const d of asking)
      found.push({ key: `asks ${d.id}`, tone: "open", link: `#/delivery/${d.id}`, text: `asks: ${d.question}` });
    return found;
  }
  const row = ({ link, tone }) => el("li", { class: tone }, link ? el("a", { href: link }) : el("span"));
  return {
    node,
    draw(overview) {
      const found = alertsOf(overview);
      show(node, found.length > 0);
      keyed(
        list,
        found,
        (alert) => alert.key,
        row,
        (item, { text }) => say(item.firstChild, text),
      );
    },
  };
}

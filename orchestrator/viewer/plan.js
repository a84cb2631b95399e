/** A delivery from above: what depth has shown, the way flown, the search's map, the street where it is known. */
import { el, show, svg } from "./dom.js";
import { isFlight } from "./replay.js";

const SIDE = 400,
  RIM = 26,
  NEAR_M = 22,
  MAX_SCALE = 22;

/** What is drawn, in the order of the legend: its class, its name, how its sign looks. */
const LEGEND = [
  ["target", "building delivered to (street map)", "area"],
  ["building", "other building", "area"],
  ["wall", "wall, as depth saw it", "dots"],
  ["inspected", "facade looked at", "area"],
  ["uninspected", "facade still to look at", "area"],
  ["expected", "facade expected", "area"],
  ["track", "way flown", "line"],
  ["planned", "way planned", "dashes"],
  ["refused", "flight refused", "dashes"],
  ["start", "start", "dot"],
  ["stop", "look for the thing", "dot"],
  ["sighting", "thing seen", "ring"],
  ["drone", "drone, nose ahead", "drone"],
];

export function makePlan(label = "The way flown, from above") {
  const layers = svg("g"),
    drone = droneSign();
  const picture = svg(
    "svg",
    { viewBox: `0 0 ${SIDE} ${SIDE}`, class: "plan", role: "img", "aria-label": label },
    layers,
    drone,
  );
  const legend = el("ul", { class: "legend", "aria-label": "Legend of the plan" });
  const signs = LEGEND.map(([kind, name, sign]) => {
    const item = el(
      "li",
      { hidden: true },
      svg("svg", { viewBox: "0 0 24 12", class: "plan sign", "aria-hidden": "true" }, signOf(kind, sign)),
      name,
    );
    legend.append(item);
    return [kind, item];
  });
  let frame = null;

  function draw({ replay, index, street, others = [] }) {
    frame = frameOf([replay, ...others], street);
    const shown = frame
      ? [
          ...background(frame, street),
          ...others.flatMap((o) => [line(frame, "track other", o.track(o.events.length - 1))]),
          ...foreground(frame, replay, index),
          scaleBar(frame),
        ]
      : [];
    layers.replaceChildren(...shown.filter(Boolean));
    const kinds = new Set(shown.filter(Boolean).flatMap((node) => [...node.classList]));
    if (frame) kinds.add("drone");
    for (const [kind, item] of signs) show(item, kinds.has(kind));
  }

  /** Puts the drone there; `tone` colours it: live, good, bad, open, stale. */
  function move(pose, tone) {
    drone.style.display = pose && frame ? "" : "none";
    if (!pose || !frame) return;
    const turn = (-pose.yaw * 180) / Math.PI;
    drone.setAttribute("transform", `translate(${frame.x(pose.x)} ${frame.y(pose.y)}) rotate(${turn})`);
    drone.setAttribute("class", `drone ${tone}`);
  }

  return { node: el("div", { class: "plan-box" }, picture, legend), draw, move };
}

/** A drone as plans show it, its nose to the east. */
export const droneSign = (more = {}) => svg("path", { class: "drone live", d: "M13 0L-8 8L-4 0L-8-8Z", ...more });

/** How metres become places of the picture; null where there is nothing to draw. */
function frameOf(replays, street) {
  const way = replays.flatMap((replay) => replay.track(replay.events.length - 1));
  if (!way.length && street) way.push(street.start);
  if (!way.length) return null;
  const walls = street
    ? street.buildings.flatMap((b) => (b.target || near(b.footprint, way) ? b.footprint : []))
    : replays
        .flatMap((r) =>
          r.events.filter((e) => e.kind === "look").flatMap((e) => e.data.returns.map(([x, y]) => ({ x, y }))),
        )
        .filter((w) => near([w], way));
  return frameAbout([...way, ...replays.flatMap(plannedWays), ...walls]);
}

/** Where a search meant to go, whether or not anybody flew there. */
function plannedWays({ events }) {
  const searches = events.filter((e) => e.kind === "search" && e.data.drawing);
  return searches.flatMap(({ data: { drawing, stop } }) => [
    ...drawing.way.map(([x, y]) => ({ x, y })),
    ...(stop ? [stop] : []),
  ]);
}

/** The frame of a street's map: the building that is delivered to with room to fly round it, the start, the drones. */
export function streetFrame(street, drones) {
  const room = 14,
    target = street?.buildings.filter((b) => b.target).flatMap((b) => b.footprint) ?? [];
  const grown = target.flatMap((p) => [
    { x: p.x - room, y: p.y - room },
    { x: p.x + room, y: p.y + room },
  ]);
  return frameAbout([...grown, ...(street ? [street.start] : []), ...drones]);
}

function frameAbout(points) {
  const xs = points.map((p) => p.x),
    ys = points.map((p) => p.y);
  const [west, east, south, north] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
  const room = SIDE - 2 * RIM;
  const scale = Math.min(room / Math.max(east - west, 8), room / Math.max(north - south, 8), MAX_SCALE);
  return {
    scale,
    x: (x) => SIDE / 2 + (x - (west + east) / 2) * scale,
    y: (y) => SIDE / 2 - (y - (south + north) / 2) * scale,
    /** Whether any of the building's rectangle is in the picture. */
    shows: ({ footprint }) => {
      const [px, py] = [footprint.map((p) => p.x), footprint.map((p) => p.y)];
      const east_m = (west + east) / 2 + SIDE / 2 / scale,
        north_m = (south + north) / 2 + SIDE / 2 / scale;
      return (
        Math.min(...px) < east_m &&
        Math.max(...px) > east_m - SIDE / scale &&
        Math.min(...py) < north_m &&
        Math.max(...py) > north_m - SIDE / scale
      );
    },
    holds: (p) => p.x >= west - 1 && p.x <= east + 1 && p.y >= south - 1 && p.y <= north + 1,
  };
}

const near = (points, way) => points.some((p) => way.some((w) => Math.hypot(p.x - w.x, p.y - w.y) < NEAR_M));

export function background(frame, street) {
  if (!street) return [];
  const roads = street.roads.map((r) =>
    svg("line", {
      class: "road",
      x1: frame.x(r.start.x),
      y1: frame.y(r.start.y),
      x2: frame.x(r.end.x),
      y2: frame.y(r.end.y),
      "stroke-width": r.width_m * frame.scale,
    }),
  );
  const houses = street.buildings.filter(frame.shows).map((b) =>
    svg("polygon", {
      class: b.target ? "target" : "building",
      points: b.footprint.map((p) => `${frame.x(p.x)},${frame.y(p.y)}`).join(" "),
    }),
  );
  return [...roads, ...houses];
}

function foreground(frame, replay, index) {
  const past = replay.events.slice(0, index + 1);
  const looks = past.filter((e) => e.kind === "look");
  const searched = replay.last(index, (e) => e.kind === "search" && e.data.drawing);
  const refused = replay.lastOf(index, "refused"),
    flown = replay.last(index, isFlight);
  const start = replay.lastOf(index, "placed");
  const seen = looks.map((e) => e.data.sightings.find((s) => s.accepted && s.place)).filter(Boolean);
  return [
    dots(
      frame,
      "wall",
      looks.flatMap((e) => e.data.returns),
    ),
    ...(searched ? mapOf(frame, searched.data) : []),
    refused && !(flown && flown.number > refused.number) ? line(frame, "refused", refused.data.path) : null,
    line(frame, "track", replay.track(index)),
    circles(
      frame,
      "stop",
      looks.filter((e) => e.phase === "explore").map((e) => e.data.pose),
      4,
    ),
    circles(frame, "start", start ? [start.data.pose] : [], 6),
    circles(
      frame,
      "sighting",
      seen.slice(-1).map((s) => s.place),
      8,
    ),
  ];
}

function mapOf(frame, { drawing, stop }) {
  const half = (drawing.cell_m * frame.scale) / 2;
  const cells = (kind, points) =>
    points.length
      ? svg("path", {
          class: kind,
          d: points
            .map(([x, y]) => `M${frame.x(x) - half} ${frame.y(y) - half}h${2 * half}v${2 * half}h${-2 * half}z`)
            .join(""),
        })
      : null;
  const way = drawing.way.map(([x, y]) => ({ x, y }));
  return [
    cells("expected", drawing.expected),
    cells("uninspected", drawing.uninspected),
    cells("inspected", drawing.inspected),
    line(frame, "planned", way),
    stop ? circles(frame, "planned", [stop], 4) : null,
  ];
}

/** Many dots as one path: a line of no length with a round end is a dot. */
function dots(frame, kind, points) {
  if (!points.length) return null;
  return svg("path", {
    class: kind,
    d: points.map(([x, y]) => `M${frame.x(x).toFixed(1)} ${frame.y(y).toFixed(1)}h0`).join(""),
  });
}

function line(frame, kind, points) {
  if (points.length < 2) return null;
  return svg("polyline", {
    class: kind,
    points: points.map((p) => `${frame.x(p.x).toFixed(1)},${frame.y(p.y).toFixed(1)}`).join(" "),
  });
}

function circles(frame, kind, places, r) {
  if (!places.length) return null;
  return svg("g", { class: kind }, ...places.map((p) => svg("circle", { cx: frame.x(p.x), cy: frame.y(p.y), r })));
}

function scaleBar(frame) {
  const metres = [50, 20, 10, 5, 2].find((m) => m * frame.scale < 120) ?? 1;
  const length = metres * frame.scale,
    right = SIDE - 12;
  return svg(
    "g",
    { class: "scale" },
    svg("path", { d: `M${right - length} 386v4h${length}v-4` }),
    svg("text", { x: right - length / 2, y: 382, "text-anchor": "middle" }, `${metres} m`),
    svg("path", { d: "M20 34v-20m-5 7l5-7l5 7" }),
    svg("text", { x: 20, y: 46, "text-anchor": "middle" }, "N"),
  );
}

function signOf(kind, sign) {
  if (sign === "area") return svg("rect", { class: kind, x: 3, y: 1, width: 18, height: 10 });
  if (sign === "dots") return svg("path", { class: kind, d: "M5 6h0M10 6h0M15 6h0M20 6h0" });
  if (sign === "drone") return droneSign({ transform: "translate(11 6) scale(.7)" });
  if (sign === "dot" || sign === "ring")
    return svg("g", { class: kind }, svg("circle", { cx: 12, cy: 6, r: kind === "start" ? 5 : 4 }));
  return svg("polyline", { class: kind, points: "2,6 22,6" });
}

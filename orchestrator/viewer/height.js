/** How high the drone flew, along the way: the floors as they were counted, the facade, the height flown to. */
import { el, number, svg } from "./dom.js";
import { isFlight } from "./replay.js";

const WIDE = 400,
  HIGH = 210,
  LEFT = 44,
  BOTTOM = 24,
  TOP = 12;

export function makeHeight() {
  const layers = svg("g"),
    drone = svg("circle", { class: "drone live", r: 6 });
  const picture = svg(
    "svg",
    { viewBox: `0 0 ${WIDE} ${HIGH}`, class: "height", role: "img", "aria-label": "Height over the way flown" },
    layers,
    drone,
  );
  const caption = el("p", { class: "soft" });
  let scale = null;

  function draw({ replay, index, street }) {
    const way = profileOf(replay, replay.events.length - 1);
    const facade = facadeOf(replay, index, street);
    const top = Math.max(4, facade.top ?? 0, ...way.map((p) => p.z)) + 2;
    const long = Math.max(5, way.at(-1)?.s ?? 0);
    scale = {
      x: (s) => LEFT + (s / long) * (WIDE - LEFT - 10),
      y: (z) => HIGH - BOTTOM - (z / top) * (HIGH - BOTTOM - TOP),
    };
    const flown = profileOf(replay, index);
    layers.replaceChildren(
      ...floors(scale, facade, top),
      ...axes(scale, top, long),
      svg("polyline", { class: "track ahead", points: points(scale, way) }),
      svg("polyline", { class: "track", points: points(scale, flown) }),
    );
    caption.textContent =
      facade.wanted === null
        ? "The floor's height is not known yet."
        : `Floor ${facade.floor ?? "?"} was put at ${number(facade.wanted)} m; one floor is ${number(facade.storey)} m high.`;
  }

  function move(pose, replay, time) {
    const shown = pose && scale;
    drone.style.display = shown ? "" : "none";
    if (!shown) return;
    drone.setAttribute("cx", scale.x(distanceAt(replay, time)));
    drone.setAttribute("cy", scale.y(pose.z));
  }

  return { node: el("div", {}, picture, caption), draw, move };
}

/** Corners as distance flown over the ground, and height. */
function profileOf(replay, index) {
  let s = 0,
    before = null;
  return replay.track(index).map((p) => {
    if (before) s += Math.hypot(p.x - before.x, p.y - before.y);
    before = p;
    return { s, z: p.z };
  });
}

function distanceAt(replay, time) {
  const index = replay.indexAt(time),
    s = profileOf(replay, index).at(-1)?.s ?? 0;
  const next = replay.events[index + 1],
    pose = replay.poseAt(time);
  if (!next || !isFlight(next) || !pose) return s;
  return s + Math.hypot(pose.x - next.data.from.x, pose.y - next.data.from.y);
}

/** What is known of the facade up to then: its floors as the delivery counted them, else as the street map says. */
function facadeOf(replay, index, street) {
  const decided = replay.last(index, (e) => e.kind === "floor_count" && e.data.decision === "FinalHeight");
  const counted = replay.last(index, (e) => e.kind === "floor_count" && e.data.facade_top_m !== null);
  const target = street?.buildings.find((b) => b.target);
  return {
    floor: decided?.data.floors_wanted ?? null,
    wanted: decided?.data.detail.height_m ?? null,
    storey: decided?.data.detail.floor_height_m ?? target?.floor_height_m ?? null,
    top: counted?.data.facade_top_m ?? target?.height_m ?? null,
  };
}

function floors(scale, facade, top) {
  const shown = [];
  if (facade.top !== null) {
    const y = scale.y(Math.min(facade.top, top));
    shown.push(
      svg("rect", { class: "facade", x: LEFT, y, width: WIDE - LEFT - 10, height: Math.max(0, scale.y(0) - y) }),
    );
  }
  if (facade.storey) {
    for (let floor = 1; floor * facade.storey <= (facade.top ?? top) + 0.1; floor++) {
      const y = scale.y(floor * facade.storey);
      shown.push(svg("line", { class: "storey", x1: LEFT, x2: WIDE - 10, y1: y, y2: y }));
      if (floor === facade.floor) {
        const under = scale.y((floor - 1) * facade.storey),
          label = under - y < 30 ? y - 5 : under - 4; // in a low row it would lie on the way flown
        shown.push(
          svg("rect", { class: "wanted", x: LEFT, y, width: WIDE - LEFT - 10, height: under - y }),
          svg("text", { x: LEFT + 6, y: label }, `floor ${floor}`),
        );
      }
    }
  }
  return shown;
}

function axes(scale, top, long) {
  const step = [1, 2, 5, 10, 20].find((m) => top / m <= 6) ?? 50;
  const marks = [];
  for (let z = 0; z <= top; z += step) {
    marks.push(svg("text", { x: LEFT - 6, y: scale.y(z) + 4, "text-anchor": "end" }, `${z} m`));
  }
  return [
    ...marks,
    svg("path", { class: "axis", d: `M${LEFT} ${TOP}V${HIGH - BOTTOM}H${WIDE - 10}` }),
    svg("text", { x: WIDE - 12, y: HIGH - 6, "text-anchor": "end" }, `${long.toFixed(0)} m flown over ground`),
  ];
}

const points = (scale, way) => way.map((p) => `${scale.x(p.s).toFixed(1)},${scale.y(p.z).toFixed(1)}`).join(" ");

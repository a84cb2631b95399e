/** The flight in space, drawn on a canvas: buildings as prisms, the way flown, the drone. Turned with mouse or keys. */
import { el } from "./dom.js";

const FAR = 1.1;

export function makeSpace() {
  const canvas = el("canvas", {
    class: "space",
    width: 800,
    height: 560,
    tabindex: 0,
    role: "img",
    "aria-label": "The way flown in space; arrow keys turn it, plus and minus come nearer or go farther",
  });
  const brush = canvas.getContext("2d");
  const eye = { around: -2.2, above: 0.55, zoom: 1 };
  let scene = null,
    drone = null;

  canvas.addEventListener("pointerdown", (e) => canvas.setPointerCapture(e.pointerId));
  canvas.addEventListener("pointermove", (e) => {
    if (e.buttons !== 1) return;
    turn(-e.movementX * 0.008, e.movementY * 0.006);
  });
  canvas.addEventListener(
    "wheel",
    (e) => {
      e.preventDefault();
      zoom(Math.exp(-e.deltaY * 0.001));
    },
    { passive: false },
  );
  canvas.addEventListener("keydown", (e) => {
    const does = {
      ArrowLeft: () => turn(-0.12, 0),
      ArrowRight: () => turn(0.12, 0),
      ArrowUp: () => turn(0, 0.1),
      ArrowDown: () => turn(0, -0.1),
      "+": () => zoom(1.15),
      "-": () => zoom(1 / 1.15),
    };
    if (!does[e.key]) return;
    e.preventDefault();
    does[e.key]();
  });

  function turn(around, above) {
    eye.around += around;
    eye.above = Math.min(1.5, Math.max(0.05, eye.above + above));
    paint();
  }
  function zoom(by) {
    eye.zoom = Math.min(6, Math.max(0.4, eye.zoom * by));
    paint();
  }

  /** A place (x, y, z) as one of the canvas, with how far it is away. */
  function project(p) {
    const [dx, dy, dz] = [p.x - scene.middle.x, p.y - scene.middle.y, (p.z ?? 0) - scene.middle.z];
    const [c, s, ca, sa] = [Math.cos(eye.around), Math.sin(eye.around), Math.cos(eye.above), Math.sin(eye.above)];
    const right = -s * dx + c * dy,
      ahead = -(c * dx + s * dy);
    const away = scene.size * 1.7 + ahead * ca - dz * sa,
      up = dz * ca + ahead * sa;
    const scale = (canvas.height * FAR * eye.zoom * 1.6) / Math.max(away, 0.5);
    return { x: canvas.width / 2 + right * scale, y: canvas.height / 2 - up * scale, away };
  }

  function paint() {
    if (!scene || !canvas.isConnected) return;
    const ink = getComputedStyle(canvas);
    const colour = (name) => ink.getPropertyValue(name).trim();
    brush.clearRect(0, 0, canvas.width, canvas.height);
    const faces = scene.prisms.flatMap((prism) => facesOf(prism));
    for (const face of faces) {
      face.shown = face.points.map(project);
      face.away = Math.max(...face.shown.map((p) => p.away));
    }
    faces.sort((a, b) => b.away - a.away);
    for (const face of faces) fill(face.shown, colour(face.target ? "--house-target" : "--house"), colour("--rim"));
    stroke(scene.track.map(project), colour("--track"), 4);
    for (const p of scene.stops) dot(project(p), 6, colour("--track"));
    if (scene.track.length) dot(project(scene.track[0]), 8, colour("--ink"));
    if (drone) {
      const [here, ground] = [project(drone.pose), project({ ...drone.pose, z: 0 })];
      stroke([here, ground], colour("--soft"), 1.5);
      dot(here, 10, colour({ good: "--good", bad: "--bad", open: "--amber", stale: "--soft" }[drone.tone] ?? "--blue"));
    }
  }

  function fill(points, colour, rim) {
    brush.beginPath();
    points.forEach((p, i) => (i ? brush.lineTo(p.x, p.y) : brush.moveTo(p.x, p.y)));
    brush.closePath();
    brush.fillStyle = colour;
    brush.fill();
    brush.strokeStyle = rim;
    brush.lineWidth = 1;
    brush.stroke();
  }
  function stroke(points, colour, width) {
    brush.beginPath();
    points.forEach((p, i) => (i ? brush.lineTo(p.x, p.y) : brush.moveTo(p.x, p.y)));
    brush.strokeStyle = colour;
    brush.lineWidth = width;
    brush.stroke();
  }
  function dot(p, r, colour) {
    brush.beginPath();
    brush.arc(p.x, p.y, r, 0, 7);
    brush.fillStyle = colour;
    brush.fill();
  }

  return {
    node: el(
      "div",
      {},
      canvas,
      el(
        "p",
        { class: "soft" },
        "Drag to turn, wheel to come nearer. Buildings are of the street map, where there is one.",
      ),
    ),
    draw({ replay, index, street }) {
      const whole = replay.track(replay.events.length - 1);
      scene = whole.length || street ? sceneOf(replay, index, whole, street) : null;
      paint();
    },
    move(pose, tone) {
      const before = drone;
      drone = pose ? { pose, tone } : null;
      if (
        before?.pose.x !== pose?.x ||
        before?.pose.y !== pose?.y ||
        before?.pose.z !== pose?.z ||
        before?.tone !== tone
      )
        paint();
    },
  };
}

function sceneOf(replay, index, whole, street) {
  const near = (b) => b.target || b.footprint.some((p) => whole.some((w) => Math.hypot(p.x - w.x, p.y - w.y) < 25));
  const prisms = (street?.buildings ?? []).filter(near);
  const around = [
    ...whole,
    ...prisms.filter((b) => b.target).flatMap((b) => b.footprint.map((p) => ({ ...p, z: b.height_m }))),
  ];
  if (!around.length) around.push({ ...street.start, z: 0 });
  const of = (axis) => around.map((p) => p[axis] ?? 0);
  const middle = {},
    size = [];
  for (const axis of ["x", "y", "z"]) {
    const [low, high] = [Math.min(0, ...(axis === "z" ? of(axis) : [Infinity])), Math.max(...of(axis))];
    const least = axis === "z" ? low : Math.min(...of(axis));
    middle[axis] = (least + high) / 2;
    size.push(high - least);
  }
  return {
    prisms,
    middle,
    size: Math.max(12, Math.hypot(...size)),
    track: replay.track(index),
    stops: replay.events
      .slice(0, index + 1)
      .filter((e) => e.kind === "look")
      .map((e) => e.data.pose),
  };
}

/** Walls and roof of a prism. */
function facesOf({ footprint, height_m: height, target }) {
  const walls = footprint.map((a, i) => {
    const b = footprint[(i + 1) % footprint.length];
    return {
      target,
      points: [
        { ...a, z: 0 },
        { ...b, z: 0 },
        { ...b, z: height },
        { ...a, z: height },
      ],
    };
  });
  return [...walls, { target, points: footprint.map((p) => ({ ...p, z: height })) }];
}

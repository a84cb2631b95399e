/** The pictures of a look with the boxes of what was seen, and the picture that a model was asked about. */
import { el, keyed, number, say, show } from "./dom.js";
import { sideWords } from "./wording.js";

/** A picture of the record. One that can't be had says why: no longer kept, or the server is away. */
export function makePicture(alt) {
  const image = el("img", { alt, hidden: true, onload: () => settle(""), onerror: missing });
  const why = el("p", { class: "missing" });
  let address = null;

  function settle(text) {
    image.hidden = text !== "" || !address;
    say(why, text);
  }
  async function missing() {
    const asked = address;
    let text = "The server is away.";
    try {
      const answer = await fetch(asked, { method: "HEAD" });
      text = answer.status === 404 ? "This picture is no longer kept." : `The server answered ${answer.status}.`;
    } catch {
      /* the server is away */
    }
    if (asked === address) settle(text);
  }
  return {
    nodes: [image, why],
    /** `none`: what is said where there is no picture. */
    set(wanted, none = "") {
      if (!wanted) say(why, none);
      if (wanted === address) return;
      address = wanted;
      settle(wanted ? "" : none);
      if (wanted) image.src = wanted;
      else image.removeAttribute("src");
    },
  };
}

const boxClass = (s) => (s.rejected ? "box no" : s.accepted ? "box" : "box also");

/** What a box says: how sure, how far, and why it is not the one. */
function boxWords(s) {
  const far = s.distance_m === null ? "no depth" : `${number(s.distance_m)} m`;
  return `${number(s.confidence, 2)} sure, ${far}${s.rejected ? `; ${s.rejected}` : ""}`;
}

function makeView() {
  const picture = makePicture(""),
    frame = el("div", { class: "frame" }, ...picture.nodes),
    boxes = el("div");
  frame.append(boxes);
  const caption = el("figcaption"),
    node = el("figure", {}, frame, caption);
  return {
    node,
    update({ camera, address, none, what, sightings }) {
      frame.style.aspectRatio = `${camera.width}/${camera.height}`;
      picture.nodes[0].alt = `${what} ${camera.name}, ${sideWords(camera)}`;
      picture.set(address, none);
      say(caption, sideWords(camera));
      boxes.replaceChildren(
        ...sightings.map((s) =>
          el(
            "div",
            {
              class: boxClass(s),
              title: boxWords(s),
              style: {
                left: `${s.box.x_min * 100}%`,
                top: `${s.box.y_min * 100}%`,
                width: `${(s.box.x_max - s.box.x_min) * 100}%`,
                height: `${(s.box.y_max - s.box.y_min) * 100}%`,
              },
            },
            el("span", {}, boxWords(s)),
          ),
        ),
      );
    },
  };
}

/** The file of an event's picture by its short name, or undefined. */
export const pictureOf = (event, short) => event?.pictures.find((file) => file.endsWith(`_${short}.jpg`));

export function makeViews(addressOf) {
  const grid = el("div", { class: "views" }),
    said = el("span", { class: "soft" });
  const none = el("p", { class: "soft" }, "The drone has not looked round yet.");
  const depthToo = el("button", { type: "button", "aria-pressed": "false", hidden: true, onclick: turn }, "Depth");
  const scale = makeDepthScale();
  const made = new WeakMap();
  const head = el("div", { class: "head" }, el("h2", {}, "What the cameras saw ", said), depthToo);
  const node = el("section", { class: "card" }, head, grid, scale, none);
  let deep = false,
    model = null;

  function turn() {
    deep = !deep;
    depthToo.setAttribute("aria-pressed", String(deep));
    draw(model);
  }

  function viewOf(look, { camera, picture, depth }) {
    const file = pictureOf(look, deep ? depth : picture);
    return {
      camera,
      address: file ? addressOf(file) : null,
      none: deep ? "No depth was recorded." : "No picture was kept.",
      what: deep ? "depth of camera" : "camera",
      sightings: look.data.sightings.filter((s) => s.camera === camera.name),
    };
  }

  function draw(wanted) {
    model = wanted;
    const { replay, index } = model,
      look = replay.lastOf(index, "look");
    none.hidden = !!look;
    show(depthToo, !!look);
    show(scale, deep && !!look?.data.views.some((view) => pictureOf(look, view.depth)));
    say(said, look ? `${number(look.time_s)} s · ${look.message}` : "");
    const views = look ? look.data.views.map((view) => viewOf(look, view)) : [];
    grid.style.setProperty("--across", Math.max(3, Math.min(views.length, 8)));
    keyed(
      grid,
      views,
      (view) => view.camera.name,
      () => {
        const view = makeView();
        made.set(view.node, view);
        return view.node;
      },
      (child, view) => made.get(child).update(view),
    );
  }

  return { node, draw };
}

/** What the colours of depth mean: from 0.5 to 40 m, evenly by its logarithm, as the record's pictures have them. */
function makeDepthScale() {
  const at = (metres) => `${(100 * Math.log(metres / 0.5)) / Math.log(80)}%`;
  const marks = [0.5, 1, 2, 5, 10, 20, 40].map((m) => el("span", { style: { left: at(m) } }, m === 40 ? "40 m" : String(m)));
  return el(
    "div",
    { class: "depth-scale", hidden: true, role: "img", "aria-label": "Colours of depth: yellow is near, violet far" },
    el("div", { class: "colours" }, ...marks),
    el("p", { class: "soft" }, el("i", { class: "unknown" }), "no depth told ", el("i"), "nothing within reach"),
  );
}

const ASKED = {
  sighting: "Where the thing was seen",
  marked: "The marked ways among which the model chose",
  view: "The picture that was counted",
};

/** The last picture with a mark in it, and in words what it shows. */
export function makeMarked(addressOf) {
  const picture = makePicture("the picture with its marks"),
    title = el("span"),
    said = el("p", { class: "soft" });
  const node = el(
    "section",
    { class: "card" },
    el("h2", {}, title),
    el("div", { class: "frame square" }, ...picture.nodes),
    said,
  );
  return {
    node,
    draw({ replay, index }) {
      const shortOf = (e) =>
        ["sighting", "marked", "view"].find((short) => pictureOf(e, short) && (short !== "view" || e.kind !== "look"));
      const event = replay.last(index, shortOf);
      node.hidden = !event;
      if (!event) return;
      const short = shortOf(event);
      say(title, ASKED[short]);
      say(said, `${number(event.time_s)} s · ${event.message}`);
      picture.set(addressOf(pictureOf(event, short)));
    },
  };
}

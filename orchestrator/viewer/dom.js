/** Elements without markup in strings: what people wrote can't become a tag. */

export function el(tag, props = {}, ...kids) {
  return filled(document.createElement(tag), props, kids);
}

export function svg(tag, props = {}, ...kids) {
  return filled(document.createElementNS("http://www.w3.org/2000/svg", tag), props, kids);
}

function filled(node, props, kids) {
  for (const [name, value] of Object.entries(props)) {
    if (value === null || value === undefined || value === false) continue;
    if (name === "class") node.setAttribute("class", value);
    else if (name === "style") for (const [key, one] of Object.entries(value)) node.style.setProperty(key, one);
    else if (name === "data") Object.assign(node.dataset, value);
    else if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else node.setAttribute(name, value === true ? "" : value);
  }
  node.append(...kids.flat().filter((kid) => kid !== null && kid !== undefined && kid !== false));
  return node;
}

/** Changes a text only where it is another one, so that screen readers and selections are left alone. */
export function say(node, text) {
  if (node.textContent !== text) node.textContent = text;
  return node;
}

/** Shows or hides. */
export function show(node, shown) {
  if (node.hidden === shown) node.hidden = !shown;
  return node;
}

/** Makes the children of `parent` those of `items`, in that order; a child is kept for as long as its key is there. */
export function keyed(parent, items, keyOf, make, update = () => {}) {
  const known = parent.known ?? new Map();
  const wanted = new Map();
  let before = parent.firstElementChild;
  for (const item of items) {
    const key = keyOf(item);
    const node = known.get(key) ?? make(item);
    wanted.set(key, node);
    known.delete(key);
    update(node, item);
    if (node === before) before = before.nextElementSibling;
    else parent.insertBefore(node, before);
  }
  for (const node of known.values()) node.remove();
  parent.known = wanted;
}

export const number = (value, digits = 1) =>
  value === null || value === undefined ? "–" : Number(value).toFixed(digits);

/** `2 min 05 s`, `45 s`. */
export function duration(seconds) {
  const whole = Math.max(0, Math.round(seconds));
  if (whole < 90) return `${whole} s`;
  if (whole < 5400) return `${Math.floor(whole / 60)} min ${String(whole % 60).padStart(2, "0")} s`;
  return `${Math.floor(whole / 3600)} h ${String(Math.round((whole % 3600) / 60)).padStart(2, "0")} min`;
}

const zone = Intl.DateTimeFormat().resolvedOptions().timeZone;
const clock = new Intl.DateTimeFormat(undefined, { hour: "2-digit", minute: "2-digit", second: "2-digit" });
const day = new Intl.DateTimeFormat(undefined, { day: "numeric", month: "short", hour: "2-digit", minute: "2-digit" });

/** The name of the time zone in which all times are shown. */
export const timeZone = () => zone;

export const clockTime = (moment) => clock.format(new Date(moment));

/** Day and time of day, in the reader's zone. */
export const when = (moment) => day.format(new Date(moment));

/** A `time` element: what is shown, and on hover the whole moment with its zone. */
export function moment(iso) {
  const at = new Date(iso);
  return el("time", { datetime: iso, title: `${at.toLocaleString()} ${zone}` }, when(iso));
}

/** Runs `work` once before the next frame, however often it is asked for. */
export function onFrame(work) {
  let pending = false;
  return () => {
    if (pending) return;
    pending = true;
    requestAnimationFrame(() => {
      pending = false;
      work();
    });
  };
}

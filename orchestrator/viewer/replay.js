/**
 * What the events of a delivery tell, at any moment of it: pure functions of the events.
 *
 * One event; what `data` holds under each `kind` is in docs/events.schema.json. A kind that is not known here still
 * shows its message.
 * @typedef {{number: number, time_s: number, phase: string, kind: string, message: string, data: Object, pictures: string[]}} DeliveryEvent
 */

/** Kinds that get a mark of their own on the timeline, with a name for it. */
export const MARKS = {
  question: "question",
  answer: "answer",
  floor_count: "floor count",
  look: "look",
  lost: "sighting dropped",
  refused: "flight refused",
  outage: "something away",
  verdict: "verdict",
  result: "end",
};

export class Replay {
  /** @type {DeliveryEvent[]} */
  events = [];

  /** Takes the next event; one that is there already is passed over. */
  add(event) {
    if (this.events.length && event.number <= this.events.at(-1).number) return false;
    this.events.push(event);
    return true;
  }

  get duration() {
    return this.events.length ? this.events.at(-1).time_s : 0;
  }

  /** The index of the last event at or before `time`, -1 before the first. */
  indexAt(time) {
    let low = 0,
      high = this.events.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.events[middle].time_s <= time + 1e-6) low = middle + 1;
      else high = middle;
    }
    return low - 1;
  }

  /** The last event up to `index` that passes, or null. */
  last(index, test) {
    for (let i = index; i >= 0; i--) if (test(this.events[i])) return this.events[i];
    return null;
  }

  lastOf(index, kind) {
    return this.last(index, (e) => e.kind === kind);
  }

  /** Where the drone was at `time`: between its stops along the way flown. Null before it was placed. */
  poseAt(time) {
    const index = this.indexAt(time);
    const next = this.events[index + 1];
    if (next && isFlight(next)) {
      const begun = index >= 0 ? this.events[index].time_s : 0;
      return alongFlight(next.data, (time - begun) / Math.max(1e-6, next.time_s - begun));
    }
    const there = this.last(index, (e) => isFlight(e) || e.kind === "placed");
    return there ? (there.data.to ?? there.data.pose) : null;
  }

  /** The corners flown up to event `index`, as {x, y, z}. */
  track(index) {
    const corners = [];
    for (const e of this.events.slice(0, index + 1)) {
      if (e.kind === "placed") corners.push(e.data.pose);
      if (isFlight(e)) corners.push(...cornersOf(e.data).slice(1));
    }
    return corners;
  }

  /** Every question to a model up to `index`: who was asked what, and what came of it. */
  calls(index) {
    return this.events
      .slice(0, index + 1)
      .filter((e) => e.data.answer?.outcome)
      .map(callOf);
  }
}

export const isFlight = (e) => e.kind === "move" || e.kind === "turn";

/** The corners of one flight, where it began and ended included. */
function cornersOf(move) {
  return [move.from, ...(move.reached ? move.path.slice(0, -1) : []), move.to];
}

/** The pose after a share of a flight: along its corners, turning the shorter way round. */
function alongFlight(move, share) {
  const part = Math.min(1, Math.max(0, share));
  const corners = cornersOf(move);
  const legs = corners.slice(1).map((b, i) => Math.hypot(b.x - corners[i].x, b.y - corners[i].y, b.z - corners[i].z));
  let left = part * legs.reduce((sum, leg) => sum + leg, 0),
    leg = 0;
  while (leg < legs.length - 1 && left > legs[leg]) left -= legs[leg++];
  const along = legs[leg] > 0 ? Math.min(1, left / legs[leg]) : 1;
  return { ...between(corners[leg], corners[leg + 1], along), yaw: turned(move.from.yaw, move.to.yaw, part) };
}

/** The pose between two, by share. */
export function betweenPoses(a, b, share) {
  return { ...between(a, b, share), yaw: turned(a.yaw, b.yaw, share) };
}

function between(a, b, share) {
  return { x: a.x + (b.x - a.x) * share, y: a.y + (b.y - a.y) * share, z: a.z + (b.z - a.z) * share };
}

function turned(from, to, share) {
  const by = Math.atan2(Math.sin(to - from), Math.cos(to - from));
  return from + by * share;
}

const ASKED = {
  parsed: () => "Which floor, which thing?",
  floor_count: () => "How many floors are visible?",
  height_check: () => "How many floors are visible, from here?",
  building_box: () => "Where is the building?",
  look: (e) => `Is there ${article(e.data.object)}?`,
  direction: () => "Which way on?",
};

const article = (thing) => (thing ? `${/^[aeiou]/i.test(thing) ? "an" : "a"} ${thing}` : "the thing");

function callOf(e) {
  const answer = e.data.answer;
  return {
    event: e,
    role: answer.role ?? "parser",
    model: answer.model,
    backend: answer.backend ?? "",
    asked: (ASKED[e.kind] ?? (() => e.kind.replaceAll("_", " ")))(e),
    answered: answer.outcome === "answered" ? e.message : answer.outcome,
    words: answer.text ?? "",
    seconds: e.data.seconds ?? answer.latency_s ?? 0,
    cached: answer.cache === "hit",
    usd: answer.usd ?? null,
    tokens: (answer.tokens?.prompt ?? 0) + (answer.tokens?.completion ?? 0),
  };
}

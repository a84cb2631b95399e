/** States and outcomes in people's words; `tone` is a class of the style sheet: good, bad, open, live, quiet. */

const OUTCOMES = {
  delivered: ["delivered", "good"],
  stopped_not_judged: ["stopped, not judged", "open"],
  wrong_window: ["wrong window", "bad"],
  not_in_front: ["not in front", "bad"],
  collision: ["collision", "bad"],
  object_not_found: ["not found", "bad"],
  request_incomplete: ["request incomplete", "bad"],
  request_unreadable: ["request unreadable", "bad"],
  object_unknown: ["thing unknown", "bad"],
  no_building: ["no building", "bad"],
  floor_not_found: ["no such floor", "bad"],
  answer_unreadable: ["answer unreadable", "bad"],
  blocked: ["way blocked", "bad"],
  stopped_by_guard: ["stopped by the guard", "bad"],
  model_unreachable: ["model unreachable", "bad"],
  service_unreachable: ["service unreachable", "bad"],
  vehicle_lost: ["vehicle lost", "bad"],
  deadline_passed: ["deadline passed", "bad"],
  cancelled: ["cancelled", "quiet"],
  failed: ["failed", "bad"],
};
export const OUTCOME_NAMES = Object.keys(OUTCOMES);

const PHASES = {
  parse: "reading the request",
  place: "taking off",
  floors: "finding the floor",
  explore: "searching",
  approach: "approaching",
  claim: "at the window",
  done: "over",
};

/** The steps of a delivery as people count them. */
export const STEPS = ["parse", "place", "floors", "explore", "approach", "claim"];
export const STEP_NAMES = {
  parse: "Request",
  place: "Take-off",
  floors: "Floor",
  explore: "Search",
  approach: "Approach",
  claim: "Window",
  done: "End",
};

export const phaseWords = (phase) => PHASES[phase] ?? phase.replaceAll("_", " ");

export function outcomeWords(outcome, message = "") {
  if (outcome === "failed" && message.startsWith("the record breaks off")) return { text: "cut off", tone: "bad" };
  const [text, tone] = OUTCOMES[outcome] ?? [outcome.replaceAll("_", " "), "bad"];
  return { text, tone };
}

/** The state of a delivery or of a line of the list, in one or two words. */
export function stateWords(delivery) {
  const result = delivery.result ?? (delivery.outcome ? delivery : null);
  if (result) return outcomeWords(result.outcome, result.message ?? "");
  if (delivery.status === "needs_answer") return { text: "asks", tone: "open" };
  if (delivery.status === "waiting") return { text: "waiting", tone: "quiet" };
  return { text: phaseWords(delivery.phase === "parse" ? "place" : delivery.phase), tone: "live" };
}

/** Where a drone is, from the middle of its street's map. */
export function placeWords({ x, y, z }) {
  const east = `${Math.abs(x).toFixed(1)} m ${x < 0 ? "west" : "east"}`;
  return `${z.toFixed(1)} m high, ${east}, ${Math.abs(y).toFixed(1)} m ${y < 0 ? "south" : "north"} of the map's middle`;
}

export const sideWords = ({ heading_deg: heading, pitch_deg: pitch }) => {
  const level = heading === 0 ? "ahead" : `${Math.abs(heading).toFixed(0)}° ${heading < 0 ? "left" : "right"}`;
  return pitch === 0 ? level : `${level}, ${Math.abs(pitch).toFixed(0)}° ${pitch > 0 ? "up" : "down"}`;
};

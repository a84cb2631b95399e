/** Where a drone is now, smoothly, from what its vehicle told a few times a second: shown a little late, never ahead. */
import { betweenPoses } from "./replay.js";

const LATE_MS = 900,
  STALE_MS = 4000,
  KEPT = 8;

export class LiveDrone {
  /** What was told: {at: when it came here, ms, state: VehicleState or what of it is told}. */
  #told = [];

  hear(state) {
    this.#told.push({ at: performance.now(), state });
    if (this.#told.length > KEPT) this.#told.shift();
  }

  forget() {
    this.#told = [];
  }

  get last() {
    return this.#told.at(-1) ?? null;
  }

  /** Whether nothing was heard for so long that it is not to be shown as live. */
  get stale() {
    return !!this.last && performance.now() - this.last.at > STALE_MS;
  }

  /** When something was heard last. */
  get heard() {
    return this.last ? new Date(performance.timeOrigin + this.last.at) : null;
  }

  /** The pose between what was told, or the last one; null where nothing was. */
  pose() {
    const shown = performance.now() - LATE_MS,
      told = this.#told;
    if (!told.length) return null;
    const after = told.findIndex((one) => one.at > shown);
    if (after < 0) return told.at(-1).state.pose;
    if (after === 0) return told[0].state.pose;
    const [a, b] = [told[after - 1], told[after]];
    return betweenPoses(a.state.pose, b.state.pose, (shown - a.at) / Math.max(1, b.at - a.at));
  }
}

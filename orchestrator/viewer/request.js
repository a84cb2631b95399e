/** A customer's words, with those marked that floor and thing were read from. */
import { el } from "./dom.js";

/** `evidence`: {floor, object}, words of the text or null. */
export function marked(text, evidence = {}) {
  let parts = [text];
  for (const [kind, words] of Object.entries(evidence ?? {})) {
    if (!words) continue;
    parts = parts.flatMap((part) => {
      if (typeof part !== "string") return [part];
      const at = part.toLowerCase().indexOf(words.toLowerCase());
      if (at < 0) return [part];
      const mark = el(
        "mark",
        { class: kind, title: kind === "floor" ? "read as the floor" : "read as the thing at the window" },
        part.slice(at, at + words.length),
      );
      return [part.slice(0, at), mark, part.slice(at + words.length)];
    });
  }
  return parts;
}

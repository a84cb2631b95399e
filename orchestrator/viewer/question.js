/** A question to the customer and the line for its answer. */
import { clockTime, el, say, show } from "./dom.js";
import { ask, needsServer } from "./server.js";

/** `mayAnswer`: whether whoever looks may answer; `answered()` is called once the answer is taken. */
export function makeQuestion(pathOf, { mayAnswer = true, answered = () => {} } = {}) {
  const text = el("p", { class: "asked" }),
    until = el("span", { class: "soft" }),
    wrong = el("p", { class: "wrong", role: "alert" });
  const line = el("input", { maxlength: 1000, required: true, autocomplete: "off", "aria-label": "Your answer" });
  const send = needsServer(el("button", { class: "primary" }, "Answer"));
  const form = el("form", { class: "line", onsubmit: submit }, line, send);
  const node = el(
    "section",
    { class: "card ask", hidden: true, "aria-live": "polite" },
    el("h2", {}, "A question ", until),
    text,
    mayAnswer ? form : null,
    wrong,
  );

  async function submit(event) {
    event.preventDefault();
    const said = line.value.trim();
    if (!said) return;
    send.disabled = true;
    say(wrong, "");
    try {
      await ask("POST", pathOf(), { text: said });
      line.value = "";
      node.hidden = true;
      answered();
    } catch (error) {
      say(wrong, error.message);
    }
    send.disabled = false;
  }
  return {
    node,
    /** `question`: {text, answer_by}, null where nothing is asked. */
    draw(question) {
      show(node, !!question);
      if (!question) return;
      say(text, question.text);
      say(until, `it is waited for until ${clockTime(question.answer_by)}`);
    },
  };
}

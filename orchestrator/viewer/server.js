/** Asking the orchestrator, and knowing whether it is there. */

export class Unreachable extends Error {}

/** The orchestrator said no: `status` and its message. */
export class Refused extends Error {
  constructor(status, error) {
    super(error?.message ?? `the server answered with status ${status}`);
    this.status = status;
  }
}

const GONE_AFTER_MS = 8000;
const WITHIN_MS = 20000;

/** `live`, `reconnecting`, or `gone`: nobody has answered for a while. Tells `change` events. */
class Connection extends EventTarget {
  state = "live";
  heard = Date.now();

  answered() {
    this.heard = Date.now();
    this.#become("live");
  }

  failed() {
    this.#become(Date.now() - this.heard > GONE_AFTER_MS ? "gone" : "reconnecting");
  }

  #become(state) {
    if (state === this.state) return;
    this.state = state;
    this.dispatchEvent(new Event("change"));
  }
}

export const connection = new Connection();

/** What JSON the server answers. Raises Unreachable, Refused; whoever is not known any more is sent to log in. */
export async function ask(method, path, body, headers = {}) {
  let answer, said;
  try {
    answer = await fetch(path, {
      method,
      headers: body === undefined ? headers : { "content-type": "application/json", ...headers },
      body: body === undefined ? undefined : JSON.stringify(body),
      signal: AbortSignal.timeout(WITHIN_MS),
    });
    said = await answer.text();
  } catch {
    connection.failed();
    throw new Unreachable("the server does not answer");
  }
  connection.answered();
  if (answer.status === 401 && !location.pathname.startsWith("/c/")) {
    location.assign("/login" + location.hash);
    throw new Unreachable("logging in");
  }
  let content = null;
  try {
    content = said ? JSON.parse(said) : null;
  } catch {
    throw new Refused(answer.status, { message: "the server answered something that is no JSON" });
  }
  if (!answer.ok) throw new Refused(answer.status, content?.error);
  return content;
}

export const get = (path) => ask("GET", path);

/**
 * Server-sent events, taken up again after whatever happened, until the server says `end`. `on`: a function for each
 * type of event; `refused` hears why the server does not give the stream. Returns a function that closes it.
 */
export function stream(path, on, refused) {
  let source,
    again,
    closed = false;
  function open() {
    source = new EventSource(path);
    source.onopen = () => connection.answered();
    for (const [type, hear] of Object.entries(on)) {
      source.addEventListener(type, (message) => {
        connection.answered();
        hear(JSON.parse(message.data));
        if (type === "end") close();
      });
    }
    source.onerror = async () => {
      if (source.readyState === EventSource.CONNECTING) {
        connection.failed();
        return;
      }
      source.close();
      again = setTimeout(open, 2000);
      try {
        await get(path.replace(/\/events.*$/, ""));
      } catch (error) {
        if (error instanceof Refused && !closed) {
          close();
          refused(error);
        }
      }
    };
  }
  function close() {
    closed = true;
    clearTimeout(again);
    source.close();
  }
  open();
  return close;
}

/** Asks again and again, at once and then every `every` ms after an answer, while the page is seen. */
export function poll(every, work) {
  let timer,
    stopped = false;
  async function once() {
    clearTimeout(timer);
    if (!document.hidden) await work().catch(() => {});
    if (!stopped) timer = setTimeout(once, every);
  }
  const seen = () => document.hidden || once();
  document.addEventListener("visibilitychange", seen);
  once();
  return {
    now: once,
    stop() {
      stopped = true;
      clearTimeout(timer);
      document.removeEventListener("visibilitychange", seen);
    },
  };
}

/** A button or field that makes no sense while the server is away. */
export function needsServer(control) {
  control.dataset.needsServer = "";
  control.disabled = connection.state !== "live";
  return control;
}

connection.addEventListener("change", () => {
  for (const control of document.querySelectorAll("[data-needs-server]"))
    control.disabled = connection.state !== "live";
});

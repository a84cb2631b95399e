/** The operators' pages: which one the address names, who is logged in, whether the server is there. */
import { makeCompare } from "./compare.js";
import { makeDelivery } from "./delivery.js";
import { el, say, show } from "./dom.js";
import { makeFleet } from "./fleet.js";
import { makeOrder } from "./order.js";
import { ask, connection, get } from "./server.js";

const main = document.getElementById("main"),
  banner = document.getElementById("connection"),
  who = document.getElementById("who");
let session = { role: "read_only", asked: false },
  page = null;

/** Addresses: #/, #/order, #/delivery/ID, #/delivery/ID/SECONDS, #/compare/ID, #/compare/ID/ID. */
function pageOf(hash) {
  const [name, first, second] = hash.replace(/^#\/?/, "").split("/");
  if (name === "order" && session.role === "operator") return makeOrder();
  if (name === "delivery" && isId(first)) return makeDelivery(first, session, Number.parseFloat(second));
  if (name === "compare" && isId(first)) return makeCompare(first, isId(second) ? second : null);
  return makeFleet();
}

/** What may stand in the path of a request. */
const isId = (text) => /^[A-Za-z0-9][A-Za-z0-9_.:-]*$/.test(text ?? "");

function go() {
  page?.stop();
  page = pageOf(location.hash);
  main.replaceChildren(page.node);
  document.title = `${page.title()} · LogisticsVLN`;
  for (const link of document.querySelectorAll("nav a")) {
    if (link.hash === (location.hash || "#/")) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  scrollTo(0, 0);
  main.focus({ preventScroll: true });
}

function tellConnection() {
  const said = {
    live: "",
    reconnecting: "The connection is interrupted; trying again …",
    gone: "The server is gone. Nothing here is live, and nothing can be ordered or cancelled; trying again …",
  }[connection.state];
  say(banner, said);
  banner.className = connection.state;
  show(banner, connection.state !== "live");
}

async function login() {
  session = await get("/v1/session");
  document.body.classList.add(session.role.replace("_", "-"));
  if (!session.asked) return;
  who.replaceChildren(
    el("span", { class: "soft" }, session.role.replace("_", " ")),
    el(
      "button",
      {
        type: "button",
        onclick: async () => {
          await ask("DELETE", "/v1/session");
          location.assign("/login");
        },
      },
      "Log out",
    ),
  );
}

connection.addEventListener("change", tellConnection);
addEventListener("hashchange", go);
login().then(go, () => {
  tellConnection();
  setTimeout(() => location.reload(), 5000);
});

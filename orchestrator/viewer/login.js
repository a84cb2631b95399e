/** Asks for the token, once; afterwards a cookie is good for it that no script can read. */
const wrong = document.getElementById("wrong"),
  field = document.getElementById("token"),
  button = document.querySelector("button");

document.getElementById("login").addEventListener("submit", async (event) => {
  event.preventDefault();
  button.disabled = true;
  wrong.textContent = "";
  try {
    const answer = await fetch("/v1/session", {
      method: "POST",
      headers: { "content-type": "application/json" },
      body: JSON.stringify({ token: field.value.trim() }),
    });
    if (answer.ok) {
      location.replace("/" + location.hash);
      return;
    }
    const body = await answer.json().catch(() => null);
    wrong.textContent =
      answer.status === 401
        ? "This token is not known here."
        : (body?.error?.message ?? `The server answered ${answer.status}.`);
  } catch {
    wrong.textContent = "The server does not answer; try again in a moment.";
  }
  button.disabled = false;
  field.select();
});

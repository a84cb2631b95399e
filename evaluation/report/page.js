"use strict";
(() => {
  const bar = document.getElementById("filters");
  const large = document.getElementById("large");
  if (bar) {
    const cards = [...document.querySelectorAll(".failure")];
    const search = document.getElementById("search");
    const shown = document.getElementById("shown");
    const chosen = () => {
      const groups = {};
      for (const chip of bar.querySelectorAll("button[aria-pressed=true]"))
        (groups[chip.dataset.group] ??= new Set()).add(chip.dataset.value);
      return groups;
    };
    const apply = () => {
      const groups = Object.entries(chosen());
      const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
      let count = 0;
      for (const card of cards) {
        const fits = groups.every(([group, values]) => values.has(card.dataset[group]))
          && words.every((word) => card.dataset.text.includes(word));
        card.hidden = !fits;
        count += fits;
      }
      shown.textContent = count === cards.length ? `${count} failures` : `${count} of ${cards.length} failures`;
    };
    bar.addEventListener("click", (event) => {
      const chip = event.target.closest("button");
      if (!chip) return;
      chip.setAttribute("aria-pressed", String(chip.getAttribute("aria-pressed") !== "true"));
      apply();
    });
    search.addEventListener("input", apply);
  }
  document.addEventListener("click", (event) => {
    const picture = event.target.closest(".pictures img");
    if (!picture) return;
    large.replaceChildren(picture.cloneNode());
    large.showModal();
  });
  large.addEventListener("click", () => large.close());
})();

"use strict";

const root = document.documentElement;
const prefersDark = window.matchMedia("(prefers-color-scheme: dark)");

document.getElementById("theme").addEventListener("click", () => {
  const shown = root.dataset.theme || (prefersDark.matches ? "dark" : "light");
  root.dataset.theme = shown === "dark" ? "light" : "dark";
});

// Pointing at a policy in a legend or table dims the others in the charts of its section.
function highlight(section, name) {
  for (const series of section.querySelectorAll(".chart .series")) {
    series.classList.toggle("dimmed", name !== null && series.dataset.series !== name);
  }
}

for (const item of document.querySelectorAll("section .legend li[data-series], section tr[data-series]")) {
  const section = item.closest("section");
  item.addEventListener("pointerenter", () => highlight(section, item.dataset.series));
  item.addEventListener("pointerleave", () => highlight(section, null));
}

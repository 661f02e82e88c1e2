"use strict";

const root = document.documentElement;
const prefersDark = window.matchMedia("(prefers-color-scheme: dark)");

function shownTheme() {
  return root.dataset.theme || (prefersDark.matches ? "dark" : "light");
}

document.getElementById("theme").addEventListener("click", () => {
  root.dataset.theme = shownTheme() === "dark" ? "light" : "dark";
  shareTheme();
});
prefersDark.addEventListener("change", () => shareTheme());

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

// The replay of the worst trials: a row chooses the trial, and follows when the player goes on.
const frame = document.querySelector("#worst iframe");
const rows = [...document.querySelectorAll("tr[data-replay]")];
let player = null;
let wanted = null;

function mark(index) {
  for (const row of rows) {
    row.toggleAttribute("aria-current", Number(row.dataset.replay) === index);
  }
}

function load() {
  if (!frame.srcdoc) {
    frame.srcdoc = frame.dataset.page;
    frame.removeAttribute("data-page");
  }
}

function watch(index) {
  wanted = index;
  mark(index);
  load();
  frame.scrollIntoView({ block: "nearest" });
  if (player) {
    player.select(index);
    player.play();
  }
}

function shareTheme() {
  if (player && player.state.theme !== shownTheme()) {
    frame.contentDocument.getElementById("theme").click();
  }
}

function join() {
  const inside = frame.contentDocument;
  if (!inside.body || !("ready" in inside.body.dataset)) {
    return;
  }
  player = frame.contentWindow.kinarm;
  shareTheme();
  new MutationObserver(() => mark(player.state.index)).observe(inside.getElementById("spoken"), { childList: true });
  if (wanted === null) {
    mark(player.state.index);
  } else {
    watch(wanted);
  }
}

frame.addEventListener("load", () => {
  if (!frame.srcdoc) {
    return;
  }
  const waiting = new MutationObserver(() => {
    waiting.disconnect();
    join();
  });
  waiting.observe(frame.contentDocument.body, { attributeFilter: ["data-ready"] });
  join();
});

// Nothing is loaded before it is near, and nothing plays on out of sight.
new IntersectionObserver(([entry]) => {
  if (entry.isIntersecting) {
    load();
  } else if (player) {
    player.pause();
  }
}, { rootMargin: "300px" }).observe(frame);

for (const row of rows) {
  row.addEventListener("click", () => watch(Number(row.dataset.replay)));
}

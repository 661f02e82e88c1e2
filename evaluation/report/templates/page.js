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

// What a figure means, and what a drawn mark stands for: shown by a mouse, a tap or the keyboard.
const tip = document.getElementById("tip");
let explained = null;
const meanings = new Map(
  [...document.querySelectorAll("#terms > div")].map((entry) => [entry.children[0].textContent, entry.children[1].textContent])
);

function explanation(target) {
  const term = target.closest("[data-term]");
  if (term) {
    return [term, meanings.get(term.dataset.term)];
  }
  const mark = target.closest("svg :has(> title)");
  return mark ? [mark, mark.querySelector("title").textContent] : [null, ""];
}

function explain(target) {
  const [element, text] = explanation(target);
  explained = text ? element : null;
  tip.textContent = text;
  placeTip();
}

// Beside what it explains and within the window; gone as soon as that is out of sight.
function placeTip() {
  const place = explained?.getBoundingClientRect();
  tip.hidden = !place || place.bottom < 0 || place.top > root.clientHeight;
  if (tip.hidden) {
    return;
  }
  tip.style.left = tip.style.top = "0";
  const within = (wanted, size, room) => `${Math.max(16, Math.min(wanted, room - size - 16))}px`;
  const above = place.top - tip.offsetHeight - 8;
  tip.style.left = within(place.left + (place.width - tip.offsetWidth) / 2, tip.offsetWidth, root.clientWidth);
  tip.style.top = within(above > 60 ? above : place.bottom + 8, tip.offsetHeight, root.clientHeight);
}

function closeTip() {
  explained = null;
  placeTip();
}

document.addEventListener("click", (event) => explain(event.target));
document.addEventListener("scroll", placeTip, { capture: true, passive: true });
window.addEventListener("resize", placeTip);
document.addEventListener("keydown", (event) => event.key === "Escape" && closeTip());
for (const term of document.querySelectorAll(".term")) {
  term.addEventListener("focus", () => explain(term));
  term.addEventListener("blur", closeTip);
  term.addEventListener("pointerenter", (event) => event.pointerType === "mouse" && explain(term));
  term.addEventListener("pointerleave", (event) => event.pointerType === "mouse" && closeTip());
}

// Arrows go from mark to mark of the map that has the focus; what is drawn last comes first.
const DIRECTIONS = { ArrowLeft: -1, ArrowUp: -1, ArrowRight: 1, ArrowDown: 1 };

for (const map of document.querySelectorAll("svg.map[tabindex]")) {
  const marks = [...map.querySelectorAll(":scope :has(> title)")].reverse();
  const choose = (index) => {
    map.querySelector(".chosen")?.classList.remove("chosen");
    marks[index]?.classList.add("chosen");
  };
  map.addEventListener("keydown", (event) => {
    const direction = DIRECTIONS[event.key];
    if (direction === undefined) {
      return;
    }
    event.preventDefault();
    const current = marks.indexOf(map.querySelector(".chosen"));
    const next = current < 0 ? 0 : (current + direction + marks.length) % marks.length;
    choose(next);
    marks[next].scrollIntoView({ block: "nearest", inline: "nearest" });
    explain(marks[next]);
  });
  map.addEventListener("blur", () => {
    choose(-1);
    closeTip();
  });
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

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
  tip.hidden = !text; // before the text, which else is no change in what is announced
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

// A replay of worst trials: a row chooses the trial, and follows when the player goes on. Nothing is
// loaded before it is near, and nothing plays on out of sight.
class Theatre {
  constructor(theatre) {
    this.frame = theatre.querySelector("iframe");
    this.rows = [...theatre.querySelectorAll("tr[data-replay]")];
    Object.assign(this, { player: null, wanted: null, near: false });
    for (const row of this.rows) {
      row.addEventListener("click", () => this.watch(Number(row.dataset.replay)));
    }
    this.frame.addEventListener("load", () => this.frame.srcdoc && this.wait());
    new IntersectionObserver((entries) => this.pass(entries.at(-1).isIntersecting), { rootMargin: "300px" }).observe(this.frame);
  }

  mark(index) {
    for (const row of this.rows) {
      if (Number(row.dataset.replay) === index) {
        row.setAttribute("aria-current", "true");
      } else {
        row.removeAttribute("aria-current");
      }
    }
  }

  load() {
    if (!this.frame.srcdoc) {
      this.frame.srcdoc = this.frame.dataset.page;
      this.frame.removeAttribute("data-page");
    }
  }

  watch(index) {
    this.wanted = index;
    this.mark(index);
    this.load();
    this.frame.scrollIntoView({ block: "nearest" });
    if (this.player) {
      this.player.select(index);
      this.player.play();
    }
  }

  pass(near) {
    this.near = near;
    if (near) {
      this.load();
    } else if (this.player) {
      this.player.pause();
    }
  }

  shareTheme() {
    if (this.player && this.player.state.theme !== shownTheme()) {
      this.frame.contentDocument.getElementById("theme").click();
    }
  }

  wait() {
    const waiting = new MutationObserver(() => {
      waiting.disconnect();
      this.join();
    });
    waiting.observe(this.frame.contentDocument.body, { attributeFilter: ["data-ready"] });
    this.join();
  }

  join() {
    const inside = this.frame.contentDocument;
    if (!inside.body || !("ready" in inside.body.dataset)) {
      return;
    }
    this.player = this.frame.contentWindow.kinarm;
    this.shareTheme();
    new MutationObserver(() => this.mark(this.player.state.index)).observe(inside.getElementById("spoken"), { childList: true });
    if (this.wanted !== null) {
      this.watch(this.wanted);
      return;
    }
    this.mark(this.player.state.index);
    if (!this.near) {
      this.player.pause();
    }
  }
}

const theatres = [...document.querySelectorAll(".theatre")].map((each) => new Theatre(each));

function shareTheme() {
  theatres.forEach((each) => each.shareTheme());
}

"use strict";

const WIDE = window.matchMedia("(min-width: 1001px)"); // where the list fits beside the view

/* ---------- the list of trials in groups ---------- */

class TrialList {
  constructor(data, select) {
    this.chips = [];
    element("list").hidden = !data.groups.length;
    if (!data.groups.length) {
      return;
    }
    element("list-heading").textContent = data.heading;
    const sizes = data.groups.reduce((sizes, name) => sizes.set(name, (sizes.get(name) || 0) + 1), new Map());
    const rows = new Map();
    data.groups.forEach((name, index) => {
      if (!rows.has(name)) {
        const group = make("details");
        const title = make("summary", {}, name);
        title.append(make("small", {}, String(sizes.get(name))));
        rows.set(name, make("div", { class: "chips", role: "group", "aria-label": name }));
        group.append(title, rows.get(name));
        element("list-groups").append(group);
      }
      const number = data.trials[index].trial;
      const chip = make("button", { type: "button", class: "chip", "aria-label": `Trial ${number}` }, String(number));
      chip.addEventListener("click", () => {
        select(index);
        this.show(WIDE.matches);
        if (!WIDE.matches) {
          element("list").focus(); // the chip is gone with its list
        }
      });
      rows.get(name).append(chip);
      this.chips.push(chip);
    });
    element("list").addEventListener("click", () => this.toggle());
    this.show(WIDE.matches);
  }

  get shown() {
    return !element("trial-list").hidden;
  }

  show(shown) {
    element("trial-list").hidden = !shown;
    element("list").setAttribute("aria-expanded", String(shown));
    this.reveal();
  }

  toggle() {
    if (this.chips.length) {
      this.show(!this.shown);
    }
  }

  /** Mark the trial that is played, and open its group. */
  mark(index) {
    if (!this.chips.length) {
      return;
    }
    this.chips.forEach((chip, k) => chip.setAttribute("aria-current", String(k === index)));
    this.marked = this.chips[index];
    this.marked.closest("details").open = true;
    this.reveal();
  }

  /** Scroll the list, and nothing else, to the trial that is played. */
  reveal() {
    const panel = element("trial-list");
    if (!this.marked || panel.hidden) {
      return;
    }
    const above = this.marked.offsetTop - panel.scrollTop;
    if (above < 60 || above > panel.clientHeight - 40) {
      panel.scrollTop = this.marked.offsetTop - panel.clientHeight / 2;
    }
  }
}

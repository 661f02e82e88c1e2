"use strict";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2];
const HOLD = 1.4; // seconds between the end of a trial and the next one

/* ---------- the panels: card, plot and controls ---------- */

/** How a run ended, in words. */
function verdict(run, trial) {
  const steps = run.states.length - 1;
  const distance = metres(run.distances[steps]);
  if (run.outcome === "collision") {
    const pair = run.contact ? run.contact.join(" touches ") : "something touches";
    return `${pair} after ${count(steps, "step")}, ${distance} from the goal`;
  }
  if (run.outcome === "truncated") {
    return `${distance} from the goal after ${count(steps, "step")}`;
  }
  const ratio = steps === trial.floor ? ", as few as possible" : `, ${(steps / trial.floor).toFixed(1)} times what is necessary`;
  return `${count(steps, "step")}${trial.floor ? ratio : ""}`;
}

/** What a shield did in a step, or in all of them. */
function replacement(run, step) {
  const now = run.replaced.find(([at]) => at === step);
  if (now) {
    return now[1] ? now[1].join(" would touch ") : "not proven free";
  }
  return count(run.replaced.length, "step");
}

function fillCard(trial, swatch) {
  element("eyebrow").textContent = `Problem ${trial.problem} · trial ${trial.trial}`;
  element("runs").replaceChildren(...trial.runs.map((run, k) => {
    const row = make("li");
    const name = make("span", { class: "name" });
    if (trial.runs.length > 1) {
      name.append(make("span", { class: "swatch", style: `background: ${k ? "#56b4e9" : swatch}` }));
    }
    name.append(run.policy);
    row.append(name, badge(run.outcome, ...BADGES[run.outcome]), make("span", { class: "note" }, verdict(run, trial)));
    return row;
  }));
  element("replaced-row").hidden = !trial.runs[0].replaced.length;
  element("floor-row").hidden = trial.floor === null;
  if (trial.floor !== null) {
    element("floor").textContent = trial.floor > trial.horizon ? "out of reach" : count(trial.floor, "step");
  }
}

function drawPlot(trial, frames, colours) {
  const highest = Math.max(...trial.runs.flatMap((run) => run.distances), 2 * trial.tolerance);
  const across = (step) => (1000 * step) / Math.max(frames, 1);
  const up = (distance) => 96 - (92 * distance) / highest;
  const plot = element("plot");
  plot.replaceChildren();
  const level = up(trial.tolerance);
  plot.append(make("line", { class: "goal", x1: 0, x2: 1000, y1: level, y2: level }));
  element("goal-label").style.top = `${level / 100 * plot.clientHeight}px`;
  if (trial.floor !== null && trial.floor <= frames) {
    plot.append(make("line", { class: "floor", x1: across(trial.floor), x2: across(trial.floor), y1: 0, y2: 100 }));
  }
  trial.runs.forEach((run, k) => {
    const points = run.distances.map((distance, step) => `${across(step).toFixed(1)} ${up(distance).toFixed(1)}`);
    const colour = colours[run.outcome];
    if (k === 0) {
      plot.append(make("path", { class: "area", d: `M0 100L${points.join("L")}L${across(points.length - 1).toFixed(1)} 100Z`, style: `fill: ${colour}` }));
    }
    plot.append(make("path", { class: k ? "curve ghost" : "curve", d: `M${points.join("L")}`, style: `stroke: ${colour}` }));
  });
  for (const [step] of trial.runs[0].replaced) {
    plot.append(make("line", { class: "replaced", x1: across(step), x2: across(step + 1), y1: 100, y2: 100, style: `stroke: ${colours.replaced}` }));
  }
  plot.append(make("line", { class: "head", y1: -4, y2: 104 }));
}

/* ---------- the player ---------- */

class Player extends Controls {
  constructor(stage, data) {
    super(stage, data);
    this.speed = Number(element("speed").value);
    const groups = new Map();
    data.trials.forEach((trial, index) => {
      const words = BADGES[trial.runs[0].outcome][0].toLowerCase();
      const name = data.groups[index];
      if (name && !groups.has(name)) {
        groups.set(name, make("optgroup", { label: name }));
        element("trial").append(groups.get(name));
      }
      (groups.get(name) || element("trial")).append(make("option", { value: index }, `${trial.problem} ${trial.trial}: ${words}`));
    });
    this.list = new TrialList(data, (index) => this.select(index));
    element("list-key").hidden = !data.groups.length;
    element("trial-choice").hidden = data.trials.length < 2;
    this.connect();
    this.takeInput();
    this.preferTheme();
    this.select(0);
    this.run();
  }

  get trial() {
    return this.data.trials[this.index];
  }

  select(index) {
    this.index = (index + this.data.trials.length) % this.data.trials.length;
    this.frames = Math.max(...this.trial.runs.map((run) => run.states.length - 1));
    fillCard(this.trial, this.data.swatch);
    this.stage.select(this.index);
    element("trial").value = this.index;
    this.list.mark(this.index);
    element("frame").max = this.frames;
    drawPlot(this.trial, this.frames, this.data.colours);
    this.show(0);
    const run = this.trial.runs[0];
    element("spoken").textContent = `Trial ${this.trial.trial}: ${run.policy}, ${BADGES[run.outcome][0]}`;
  }

  /** Show a moment, in steps from the start. */
  show(time) {
    this.time = Math.min(Math.max(time, 0), this.frames);
    this.stage.show(this.time);
    const step = Math.floor(this.time);
    const run = this.trial.runs[0];
    const last = run.states.length - 1;
    element("frame").value = step;
    element("frame").setAttribute("aria-valuetext", `step ${step} of ${this.frames}`);
    element("step").replaceChildren(String(Math.min(step, last)), make("small", {}, ` / ${last}`));
    element("distance").textContent = metres(run.distances[Math.min(step, last)]);
    element("replaced").textContent = replacement(run, step);
    const head = element("plot").querySelector(".head");
    const x = (1000 * this.time) / Math.max(this.frames, 1);
    head.setAttribute("x1", x);
    head.setAttribute("x2", x);
  }

  seek(frame) {
    this.setPlaying(false);
    this.show(Math.round(frame));
  }

  setPlaying(playing) {
    if (playing && this.time >= this.frames) {
      this.show(0);
    }
    super.setPlaying(playing);
    this.held = 0;
  }

  setSpeed(speed) {
    this.speed = speed;
    element("speed").value = speed;
  }

  /** Play on; at the end hold for a moment, then go to the next trial. */
  elapse(passed) {
    if (!this.playing) {
      return;
    }
    if (this.time < this.frames) {
      this.show(this.time + (passed * this.speed) / this.trial.timeStep);
      return;
    }
    this.held += passed;
    if (this.held > HOLD) {
      this.held = 0;
      this.select(this.index + 1);
    }
  }

  get actions() {
    return {
      play: () => this.setPlaying(!this.playing),
      first: () => this.seek(0),
      back: () => this.seek(Math.ceil(this.time) - 1),
      forward: () => this.seek(Math.floor(this.time) + 1),
      previous: () => this.select(this.index - 1),
      next: () => this.select(this.index + 1),
    };
  }

  takeInput() {
    element("frame").addEventListener("input", (event) => this.seek(Number(event.target.value)));
    element("speed").addEventListener("change", (event) => this.setSpeed(Number(event.target.value)));
    element("trial").addEventListener("change", (event) => this.select(Number(event.target.value)));
    window.addEventListener("resize", () => drawPlot(this.trial, this.frames, this.data.colours) ?? this.show(this.time));
    const plot = element("plot");
    const drag = (event) => {
      const bounds = plot.getBoundingClientRect();
      this.seek(this.frames * (event.clientX - bounds.left) / bounds.width);
    };
    plot.addEventListener("pointerdown", (event) => {
      plot.setPointerCapture(event.pointerId);
      drag(event);
    });
    plot.addEventListener("pointermove", (event) => plot.hasPointerCapture(event.pointerId) && drag(event));
  }

  get keys() {
    const { actions } = this;
    const faster = (by) => this.setSpeed(SPEEDS[Math.min(Math.max(SPEEDS.indexOf(this.speed) + by, 0), SPEEDS.length - 1)]);
    return {
      " ": actions.play,
      ArrowLeft: actions.back,
      ArrowRight: actions.forward,
      Home: actions.first,
      End: () => this.seek(this.frames),
      p: actions.previous,
      n: actions.next,
      l: () => this.list.toggle(),
      ",": () => faster(-1),
      ".": () => faster(1),
      r: this.resetView,
    };
  }

  get state() {
    const run = this.trial.runs[0];
    return {
      index: this.index, trial: this.trial.trial, problem: this.trial.problem, policy: run.policy, outcome: run.outcome,
      frame: Math.floor(this.time), frames: this.frames, playing: this.playing, speed: this.speed, theme: this.theme,
    };
  }
}

function main(viewer, data) {
  const stage = new ReplayStage(viewer, data);
  const player = new Player(stage, data);
  window.kinarm = {
    seek: (frame) => player.seek(frame),
    select: (index) => player.select(index),
    play: () => player.setPlaying(true),
    pause: () => player.setPlaying(false),
    lookFrom: (eye, target) => stage.lookFrom(eye, target),
    pose: (name, run) => stage.poseOf(name, run),
    census: () => stage.census(),
    get state() { return player.state; },
  };
  if (!player.calm) {
    player.setPlaying(true);
  }
}

start(main);

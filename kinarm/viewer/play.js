"use strict";

const ACCURACY = 1e-9; // of the contracts' self-tests [rad or m]
const NUDGE = [0.02, 0.1]; // how far a key moves the goal [m], and turns it [rad]
const TURNING = 0.01; // how far a pointer turns the goal [rad/pixel]
const MOST_STEPS = 5; // between two frames
const PAUSE = 150; // after which a goal that has not moved is worth a search [ms]

/* ---------- the playground ---------- */

class Playground extends Controls {
  constructor(stage, data) {
    super(stage, data);
    this.simulator = new Simulator(data);
    if (!(this.simulator.selfTest() < ACCURACY)) {
      throw new Error("it does not compute as kinarm does");
    }
    Object.assign(this, { trial: 0, speed: Number(element("speed").value), turning: false });
    this.simulator.servo = this.simulator.servos.find(({ hertz }) => hertz === data.plant.servo);
    Object.assign(this.simulator, { delay: data.plant.delay, shield: data.shield });
    this.fill();
    this.connect();
    this.takePointers();
    this.preferTheme();
    this.reset();
    this.run();
  }

  fill() {
    const { data, simulator } = this;
    const option = (id, value, words, chosen) => element(id).append(make("option", { value, ...(chosen && { selected: "" }) }, words));
    data.policies.forEach(({ name }, k) => option("policy", k, name, k === 0));
    simulator.servos.forEach(({ hertz }, k) => option("servo", k, hertz ? `${hertz} Hz` : "none", hertz === data.plant.servo));
    for (let delay = 0; delay <= Math.max(2, data.plant.delay); delay++) {
      option("delay", delay, delay ? count(delay, "step") : "none", delay === data.plant.delay);
    }
    const choose = (id, change) => {
      let pointed = false;
      element(id).addEventListener("pointerdown", () => { pointed = true; });
      element(id).addEventListener("keydown", () => { pointed = false; });
      element(id).addEventListener("change", () => {
        change(Number(element(id).value));
        if (pointed) {
          element(id).blur(); // so that keys are the page's
        }
        this.restart();
      });
    };
    choose("policy", (k) => { simulator.policy = simulator.policies[k]; });
    choose("servo", (k) => { simulator.servo = simulator.servos[k]; });
    choose("delay", (steps) => { simulator.delay = steps; });
    element("speed").addEventListener("change", () => { this.speed = Number(element("speed").value); });
    element("eyebrow").textContent = `${data.arm} · drag the cube, or an obstacle`;
    element("turn").hidden = element("turn-key").hidden = element("angle-row").hidden = simulator.task.kind === "position";
    this.toggle("shield", simulator.shield);
  }

  get actions() {
    return {
      play: () => this.setPlaying(!this.playing),
      reset: () => this.reset(),
      next: () => this.reset((this.trial + 1) % this.data.trials.starts.length),
      turn: () => this.toggle("turn", (this.turning = !this.turning)),
      shield: () => { this.toggle("shield", (this.simulator.shield = !this.simulator.shield)); this.restart(); },
    };
  }

  toggle(id, on) {
    element(id).setAttribute("aria-pressed", String(on));
  }

  /* ---------- episodes ---------- */

  /** Everything as in a trial. */
  reset(trial = this.trial) {
    this.trial = trial;
    this.stage.obstacles.forEach((_, k) => this.moveObstacle(k, [0, 0, 0]));
    const { starts, goals } = this.data.trials;
    this.rest(starts[trial], goals[trial]);
    const side = goals[trial][1] < 0 ? -1 : 1;
    if (!this.stage.touched && side !== this.stage.side) {
      this.stage.look(side);
    }
  }

  /** A new episode from where the arm is, at rest. */
  restart() {
    this.rest(this.state.q, this.state.goal);
  }

  rest(q, goal) {
    this.state = this.simulator.begin(q, goal);
    Object.assign(this, { before: q, share: 0 });
    this.started();
  }

  started() {
    const { simulator, state } = this;
    Object.assign(this, { way: [state.tool], replaced: 0, begun: state.q, solution: undefined, moved: performance.now() });
    const [touching] = simulator.contact.at(state.q);
    if (touching) { // an obstacle was pushed into the arm
      Object.assign(state, { outcome: "collision", touched: { pair: touching[3], point: touching[2] } });
    }
    this.show();
  }

  /** Move the goal, as far as it may be [m, and rad or 1]; the arm goes on from there. */
  setGoal(goal) {
    const far = 1.2 * this.data.reach;
    const at = goal.slice(0, 3).map((value, k) => clamp(value, k === 2 ? Math.min(this.state.goal[2], 0) : -far, far));
    this.simulator.turnTo(this.state, [...at, ...goal.slice(3)]);
    this.started();
  }

  /** Turn the goal about an axis of the world [rad]. */
  turnGoal(axis, angle) {
    const [half, rest] = [angle / 2, this.state.goal.slice(3)];
    const turn = [Math.cos(half), ...axis.map((value) => Math.sin(half) * value)];
    const back = [turn[0], -turn[1], -turn[2], -turn[3]];
    const turnedRest = rest.length === 4 ? timesQuaternion(turn, rest) : timesQuaternion(timesQuaternion(turn, [0, ...rest]), back).slice(1);
    const length = Math.hypot(...turnedRest);
    this.setGoal([...this.state.goal.slice(0, 3), ...turnedRest.map((value) => value / length)]);
  }

  /** Put an obstacle away from its place in the scene [m]. */
  moveObstacle(number, offset) {
    this.simulator.contact.bodies[this.data.obstacles[number]].standing = [...WORLD.slice(0, 13), ...offset];
    this.stage.obstacles[number].position.fromArray(offset);
  }

  elapse(passed, now) {
    if (this.playing && !this.state.outcome) {
      this.share += (passed * this.speed) / this.simulator.timeStep;
      for (let steps = 0; this.share >= 1 && !this.state.outcome; steps++) {
        this.share = steps < MOST_STEPS ? this.share - 1 : 0;
        this.step();
      }
      if (this.state.outcome) {
        Object.assign(this, { before: this.state.q, share: 0 });
      }
      this.show();
    }
    if (this.solution === undefined && now - this.moved > PAUSE) {
      this.solution = nearestSolution(this.simulator, { q: this.begun, goal: this.state.goal });
      this.show();
    }
  }

  step() {
    this.before = this.state.q;
    this.simulator.advance(this.state);
    this.way.push(this.state.tool);
    this.replaced += this.state.replaced ? 1 : 0;
  }

  /* ---------- what is shown ---------- */

  show() {
    const { state, solution, simulator } = this;
    const between = this.before.map((value, k) => value + this.share * (state.q[k] - value));
    this.stage.show(between, state, this.way, solution);
    const outcome = state.outcome ?? (state.steps >= simulator.task.horizon ? "truncated" : "moving");
    if (element("outcome").dataset.outcome !== outcome) {
      element("outcome").dataset.outcome = outcome;
      element("outcome").replaceChildren(badge(outcome, ...BADGES[outcome]));
    }
    element("verdict").textContent = this.verdict(outcome);
    element("step").textContent = String(state.steps);
    element("distance").textContent = metres(state.distance);
    element("angle").textContent = `${fixed((state.turn * 180) / Math.PI, 1)}°`;
    element("solution").textContent = solution ? count(solution.steps, "step") : solution === null ? "none found" : "…";
    element("replaced").textContent = count(this.replaced, "step");
    element("replaced-row").hidden = !simulator.shield;
    const spoken = state.outcome ? `${BADGES[outcome][0]}: ${this.verdict(outcome)}` : "";
    if (element("spoken").textContent !== spoken) {
      element("spoken").textContent = spoken;
    }
  }

  verdict(outcome) {
    const { state, data, simulator: { task } } = this;
    const steps = count(state.steps, "step");
    const names = ({ pair }, word) => (pair === null ? "not proven free" : data.pairs[pair].map((body) => data.bodies[body].name).join(word));
    return {
      success: `within ${metres(task.tolerance)} after ${steps}`,
      collision: state.touched ? `${names(state.touched, " touches ")} after ${steps}` : "",
      truncated: `not there after ${count(task.horizon, "step")}, and goes on`,
      moving: state.replaced ? names(state.replaced, " would touch ") : "",
    }[outcome];
  }

  /* ---------- pointers and keys ---------- */

  takePointers() {
    const { stage } = this;
    const area = element("stage");
    let held = null;
    area.addEventListener("pointerdown", (event) => {
      const taken = !held && event.button === 0 && stage.under(event);
      if (taken) {
        stage.viewer.controls.enabled = false; // else it would turn the view
        area.setPointerCapture(event.pointerId);
        const number = stage.obstacles.indexOf(taken.node);
        held = { id: event.pointerId, number, follow: stage.follower(taken), goal: this.state.goal, offset: stage.obstacles[number]?.position.toArray(), x: event.clientX, y: event.clientY };
      }
    }, true);
    area.addEventListener("pointermove", (event) => {
      if (held) {
        if (event.pointerId === held.id) {
          this.drag(held, event);
        }
      } else {
        area.style.cursor = event.pointerType === "mouse" && !event.buttons && stage.under(event) ? "grab" : "";
      }
    });
    for (const end of ["pointerup", "pointercancel"]) {
      area.addEventListener(end, (event) => {
        if (event.pointerId !== held?.id) {
          return;
        }
        held = null;
        stage.viewer.controls.enabled = true;
      }, true);
    }
  }

  drag(held, event) {
    const turns = (this.turning || event.shiftKey) && held.number < 0 && this.state.goal.length > 3;
    const [right, down] = [event.clientX - held.x, event.clientY - held.y];
    Object.assign(held, { x: event.clientX, y: event.clientY });
    if (turns) {
      const axes = this.stage.cameraAxes;
      this.turnGoal(axes[1], TURNING * right);
      this.turnGoal(axes[0], TURNING * down);
      // A move that follows goes on from here.
      Object.assign(held, { goal: this.state.goal, follow: this.stage.follower({ node: this.stage.find("goal"), point: this.stage.goalUnder(event) }) });
      return;
    }
    const moved = held.follow(event);
    if (moved && held.number < 0) {
      this.setGoal(held.goal.map((value, k) => value + (moved[k] ?? 0)));
    } else if (moved) {
      const far = 2 * this.data.reach;
      this.moveObstacle(held.number, held.offset.map((value, k) => clamp(value + moved[k], -far, far)));
      this.restart();
    }
  }

  get keys() {
    const { actions } = this;
    const [right, , back] = this.stage.cameraAxes;
    // The nearest axis of the world, horizontally.
    const nearest = ([x, y]) => (Math.abs(x) > Math.abs(y) ? [Math.sign(x), 0, 0] : [0, Math.sign(y), 0]);
    const nudge = (axis, way) => (event) => {
      if (event.shiftKey && this.state.goal.length > 3) {
        this.turnGoal(axis, way * NUDGE[1]);
      } else {
        this.setGoal(this.state.goal.map((value, k) => value + way * NUDGE[0] * (axis[k] ?? 0)));
      }
    };
    return {
      ArrowLeft: nudge(nearest(right), -1), ArrowRight: nudge(nearest(right), 1),
      ArrowUp: nudge(nearest(back), -1), ArrowDown: nudge(nearest(back), 1),
      PageUp: nudge([0, 0, 1], 1), PageDown: nudge([0, 0, 1], -1),
      " ": actions.play, r: actions.reset, n: actions.next, s: actions.shield,
      v: this.resetView,
    };
  }
}

start((viewer, data) => {
  const stage = new PlayStage(viewer, data);
  const playground = new Playground(stage, data);
  window.kinarm = {
    rollout: (request) => playground.simulator.rollout(request),
    solution: (start, goal) => nearestSolution(playground.simulator, { q: start, goal }),
    contacts: (configuration) => playground.simulator.contact.at(configuration),
    setGoal: (goal) => playground.setGoal(goal),
    moveObstacle: (number, offset) => { playground.moveObstacle(number, offset); playground.restart(); },
    step: () => { playground.step(); playground.share = 1; playground.show(); },
    onScreen: (point) => stage.onScreen(point),
    lookFrom: (eye, target) => stage.lookFrom(eye, target),
    pose: (name) => stage.pose(name),
    census: () => stage.census(),
    get state() {
      const { state, trial, theme, playing, simulator, solution, replaced } = playground;
      const { q, goal, steps, outcome, distance } = state;
      return { q, goal, steps, outcome, distance, trial, theme, playing, replaced, solution, obstacles: stage.obstacles.map(({ position }) => position.toArray()), policy: element("policy").selectedOptions[0].text, shield: simulator.shield, servo: simulator.servo.hertz, delay: simulator.delay };
    },
  };
  playground.setPlaying(!playground.calm);
});

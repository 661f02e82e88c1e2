"use strict";

const MOST_STOPPING = 500; // steps after which joints that do not rest are not looked at further
const SUBSTEPS = 5; // parts of a step in which a servo's limits hold
const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

/* ---------- policies: the networks of `kinarm.kernels.network`, bit for bit ---------- */

const ACTIVATIONS = {
  linear: (x) => x,
  tanh: hyperbolicTangent,
  relu: (x) => Math.max(x, 0),
  hardtanh: (x) => clamp(x, -1, 1),
  elu: (x) => {
    const t = hyperbolicTangent(0.5 * Math.min(x, 0));
    return x < 0 ? (2 * t) / (1 - t) : x;
  },
  leaky_relu: (x) => (x < 0 ? 0.01 * x : x),
  silu: (x) => x * (0.5 + 0.5 * hyperbolicTangent(0.5 * x)),
};

/** A policy: its contract, as exported folders have it, and its network, normaliser folded in. */
class Policy {
  constructor({ contract, widths, parameters, signs, rates }) {
    Object.assign(this, { contract, widths, signs, rates });
    const bytes = Uint8Array.from(atob(parameters), (letter) => letter.charCodeAt(0));
    this.parameters = new Float64Array(bytes.buffer);
    this.parts = contract.observation.parts.map(({ name }) => name);
  }

  /** Action for an observation, within [-1, 1]. */
  act(observation) {
    const { activations, mirror_side: side } = this.contract.policy;
    const reflected = side !== null && observation[side] > 0;
    const seen = reflected ? observation.map((value, i) => this.signs.observations[i] * value) : observation;
    let values = seen;
    let start = 0;
    activations.forEach((name, layer) => {
      const [n, m] = [this.widths[layer], this.widths[layer + 1]];
      const sums = this.parameters.slice(start + n * m, start + (n + 1) * m);
      for (let i = 0; i < n; i++) {
        for (let j = 0, entry = start + i * m; j < m; j++, entry++) {
          sums[j] += values[i] * this.parameters[entry];
        }
      }
      values = sums.map(ACTIVATIONS[name]);
      start += (n + 1) * m;
    });
    if (this.rates >= 0) { // outputs are added to resolved rates, by the longest of them
      const rates = seen.slice(this.rates, this.rates + values.length);
      const longest = Math.max(...rates.map(Math.abs));
      values = values.map((value, k) => rates[k] + longest * value);
    }
    return Array.from(values, (value, k) => clamp(value, -1, 1) * (reflected ? this.signs.actions[k] : 1));
  }
}

/* ---------- goals ---------- */

const ERRORS = {
  direction: (reached, wanted) => [Math.atan2(Math.hypot(...cross(reached, wanted)), dot(reached, wanted)), minus(wanted, reached)],
  pose: (reached, wanted) => {
    const [w, ...turn] = timesQuaternion([reached[0], -reached[1], -reached[2], -reached[3]], wanted);
    const sign = reached.reduce((sum, value, k) => sum + value * wanted[k], 0) < 0 ? -1 : 1;
    return [2 * Math.atan2(Math.hypot(...turn), Math.abs(w)), wanted.map((value, k) => value - sign * reached[k])];
  },
  position: () => [0, []],
};

/* ---------- episodes, as `kinarm.Simulator` steps them ---------- */

class Simulator {
  constructor(data) {
    this.contact = new ContactTest(data);
    this.kinematics = this.contact.kinematics;
    this.policies = data.policies.map((each) => new Policy(each));
    // Contracts differ in the policy alone.
    const { joints, tool, goal, time_step: timeStep, plant, observation } = this.policies[0].contract;
    const actuated = joints.filter((joint) => joint.actuated);
    const [lower, upper, limits] = ["lower", "upper", "velocity_limit"].map((name) => actuated.map((joint) => joint[name]));
    Object.assign(this, { tool, timeStep, lower, upper, step: limits.map((limit) => limit * timeStep), feedback: plant.feedback });
    this.task = { ...goal, horizon: observation.horizon, stride: goal.speed === null ? Infinity : goal.speed * timeStep };
    Object.assign(this, { servos: data.servos, shares: data.shares, policy: this.policies[0], servo: data.servos[0], delay: 0, shield: false });
  }

  get lags() {
    return this.servo.hertz > 0 || this.delay > 0;
  }

  /** Command, velocity and former commands of joints that rest. */
  resting(q) {
    const command = q.slice(0, this.step.length);
    return { command, velocity: command.map(() => 0), former: Array(this.delay).fill(command) };
  }

  /** An arm that rests, before its first step. */
  begin(start, goal) {
    const state = { q: start, before: start, drive: this.resting(start), action: this.step.map(() => 0) };
    this.turnTo(state, goal);
    return Object.assign(state, { rows: Array(this.policy.contract.observation.history).fill(this.observe(state)) });
  }

  /** A new episode with another goal from where the arm is, in place. */
  turnTo(state, goal) {
    Object.assign(state, { goal, steps: 0, held: 0, outcome: null, touched: null, replaced: null });
    this.measure(state);
    state.rows?.splice(0, 1, this.observe(state));
  }

  /** Tool point, and rest of a goal that is reached there. */
  reached(poses) {
    const [last, { position, rotation, axis }] = [poses[poses.length - 1], this.tool];
    const rest = { direction: () => turned(last, axis), pose: () => timesQuaternion(last, rotation), position: () => [] };
    return [placed(last, position), rest[this.task.kind]()];
  }

  /** Errors of what is reached: distance [m] and turn [rad], and of the rest. */
  errors(poses, goal) {
    const [tool, rest] = this.reached(poses);
    const [x, y, z] = minus(goal, tool);
    const [turn, restError] = ERRORS[this.task.kind](rest, goal.slice(3));
    return { tool, offset: [x, y, z], distance: Math.sqrt(x * x + y * y + z * z), turn, restError };
  }

  within({ distance, turn }) {
    return distance <= this.task.tolerance && turn <= this.task.rotation_tolerance;
  }

  measure(state) {
    return Object.assign(state, this.errors(this.kinematics.poses(state.q), state.goal));
  }

  /** Joint positions as the policy sees them. */
  seen({ q, drive }) {
    return this.feedback === "commanded" ? [...drive.command, ...q.slice(drive.command.length)] : q;
  }

  /** What a policy sees of a step. */
  observe(state) {
    const joints = this.seen(state);
    const poses = this.kinematics.poses(joints);
    const { offset, restError } = this.errors(poses, state.goal);
    const rest = () => state.goal.slice(3);
    const parts = {
      goal: () => state.goal.slice(0, 3),
      goal_minus_tool: () => offset,
      orientation: () => poses.slice(1).flatMap((pose) => pose.slice(0, 4)),
      position: () => poses.slice(1).flatMap((pose) => pose.slice(13)),
      joint_positions: () => joints,
      joint_angles: () => joints.flatMap(sineCosine),
      joint_velocities: () => this.step.map((limit, k) => (joints[k] - state.before[k]) / limit),
      last_action: () => state.action,
      commanded: () => [...state.drive.command, ...joints.slice(this.step.length)],
      resolved_rate: () => resolvedRate(this, state),
      time_left: () => [(this.task.horizon - Math.min(state.steps, this.task.horizon)) / this.task.horizon],
      goal_direction: rest, direction_error: () => restError,
      goal_rotation: rest, rotation_error: () => restError,
    };
    return this.policy.parts.flatMap((name) => parts[name]());
  }

  /** Where an action, or null to hold the command, brings the joints; see `kinarm.kernels.plant`. */
  moved({ q, drive }, action) {
    const { lower, upper, step, timeStep, servo, delay } = this;
    const command = drive.command.map((value, k) => (action ? clamp(value + action[k] * step[k], lower[k], upper[k]) : value));
    if (!this.lags) {
      return { q: [...command, ...q.slice(step.length)], drive: { ...drive, command } };
    }
    const former = [drive.command, ...drive.former].slice(0, delay);
    const told = delay ? former[delay - 1] : command;
    const [part, velocity] = [timeStep / SUBSTEPS, []];
    const reached = step.map((limit, k) => {
      let [at, speed] = [q[k], drive.velocity[k]];
      for (let i = 0; i < SUBSTEPS; i++) {
        const [error, most] = [at - told[k], limit / timeStep];
        const exact = told[k] + servo.matrix[0] * error + servo.matrix[1] * speed;
        const wanted = servo.matrix[2] * error + servo.matrix[3] * speed;
        const [free, change] = [wanted - speed, clamp(wanted, -most, most) - speed];
        speed += change;
        at = clamp(change === free ? exact : at + part * (speed - servo.trapeze * change), lower[k], upper[k]);
        speed = at <= lower[k] || at >= upper[k] ? 0 : speed;
      }
      velocity.push(speed);
      return clamp(at, q[k] - limit, q[k] + limit);
    });
    return { q: [...reached, ...q.slice(step.length)], drive: { command, velocity, former } };
  }

  /**
   * What touches in a step, or behind a shield until the joints rest while its command is held.
   * One pair, if given, is looked at first, and that where they will rest, which tells mostly.
   */
  touchedBy(state, next, before = null) {
    const rest = [...next.drive.command, ...next.q.slice(this.step.length)];
    if (before !== null && this.contact.apart(before, this.kinematics.poses(rest), TOUCHING).apart <= TOUCHING) {
      return { share: 1, pair: before };
    }
    let found = this.contact.inMotion(state.q, next.q, before);
    for (let passed = 0; !found && this.shield && this.lags && !this.comesToRest(next, passed); passed++) {
      if (passed === MOST_STOPPING) {
        return { share: 1, pair: null }; // not proven free
      }
      const after = this.moved(next, null);
      found = this.contact.inMotion(next.q, after.q, before);
      next = after;
    }
    return found;
  }

  /** Whether joints that hold their command stay free on any way to rest; see `kinarm.kernels.shield`. */
  comesToRest({ q, drive }, passed) {
    const swings = drive.command.map((told, k) => [Math.abs(q[k] - told), Math.hypot(drive.velocity[k], this.servo.rate * (q[k] - told))]);
    const calm = swings.every(([, swing], k) => swing <= this.step[k] / this.timeStep) && passed + 1 >= this.delay;
    return calm && this.contact.isFreeAbout(q, swings.map(([error, swing]) => error + swing / this.servo.rate));
  }

  /** The step of an action, or behind a shield the nearest share of it that touches nothing. */
  chosen(state, action) {
    const next = this.moved(state, action);
    const touched = this.touchedBy(state, next);
    if (!touched || !this.shield) {
      return { next, action, touched, replaced: null };
    }
    const wanted = this.step.map((limit, k) => {
      const begun = state.drive.command[k];
      return clamp(begun + action[k] * limit, this.lower[k], this.upper[k]) - begun;
    });
    const off = (shares) => shares.reduce((sum, share, k) => sum + ((1 - share) * wanted[k]) ** 2, 0);
    const ranked = this.shares.map((shares) => [off(shares), shares]).filter(([far]) => far > 0).sort(([a], [b]) => a - b);
    let worst = touched.pair;
    for (const [, shares] of ranked) {
      const tried = shares.map((share, k) => (share * wanted[k]) / this.step[k]);
      const onward = this.moved(state, tried);
      const found = this.touchedBy(state, onward, worst);
      if (!found) {
        return { next: onward, action: this.lags ? tried : action, touched: null, replaced: touched };
      }
      worst = found.pair;
    }
    return { next: this.moved(state, null), action: this.lags ? action.map(() => 0) : action, touched: null, replaced: touched };
  }

  /** Let the policy take one step, in place. */
  advance(state) {
    const { next, action, touched, replaced } = this.chosen(state, this.policy.act(state.rows.flat()));
    state.steps += 1;
    if (touched) {
      return Object.assign(state, { drive: this.resting(state.q), outcome: "collision", touched, replaced });
    }
    const [before, tool] = [this.seen(state), state.tool];
    Object.assign(state, next, { before, action, replaced });
    this.measure(state);
    const slow = Math.hypot(...minus(state.tool, tool)) <= this.task.stride;
    state.held = this.within(state) && slow ? state.held + 1 : 0;
    state.rows = [this.observe(state), ...state.rows.slice(0, -1)];
    state.outcome = state.held >= this.task.hold ? "success" : null;
    return state;
  }

  /** Whole episodes: final joints, steps and outcome of each; see `kinarm.Simulator.rollout`. */
  rollout({ starts, goals, ...settings }) {
    const own = Object.assign(Object.create(this), this.settings(settings));
    return starts.map((start, n) => {
      const state = own.begin(start, goals[n]);
      const path = [start];
      while (!state.outcome && state.steps < own.task.horizon) {
        own.advance(state);
        path.push(state.q);
      }
      return { joints: state.q, steps: state.steps, outcome: state.outcome ?? "truncated", path };
    });
  }

  /** Attributes of settings by their names and numbers. */
  settings({ policy = 0, servo = 0, delay = 0, shield = false }) {
    return { policy: this.policies[policy], servo: this.servos.find(({ hertz }) => hertz === servo), delay, shield };
  }

  /** Largest error of the commands of the contracts' self-tests [rad or m]. */
  selfTest() {
    const own = Object.create(this);
    const errors = this.policies.flatMap((policy) => policy.contract.self_test.map((test) => {
      Object.assign(own, { ...this.settings({}), policy });
      const state = own.begin(test.joint_positions, test.goal);
      const { q } = own.moved(state, policy.act(state.rows.flat()));
      return Math.max(...q.map((value, k) => Math.abs(value - test.command[k])));
    }));
    return Math.max(...errors);
  }
}

"use strict";

const STARTS = 16; // configurations from which a solution is sought, beside the present one
const MOST_ROUNDS = 30;
const MOST_IMPROVED = 6; // solutions that are brought nearer
const FEW_ROUNDS = 12; // to bring it nearer
const [DAMPING, SWEEPS] = [1e-3, 4]; // of a round of least squares

/** Configurations from which solutions are sought: always the same. */
function* anywhere({ lower, upper }, q) {
  yield q;
  for (let k = 1; k <= STARTS; k++) {
    yield q.map((value, i) => (i < lower.length ? lower[i] + ((k * Math.sqrt(2 + 3 * i)) % 1) * (upper[i] - lower[i]) : value));
  }
}

/** Searches configurations that reach a goal, by damped least squares within bounds. */
class Search {
  constructor(simulator, goal) {
    Object.assign(this, { simulator, goal, step: simulator.step });
  }

  errors(configuration) {
    return this.simulator.errors(this.simulator.kinematics.poses(configuration), this.goal);
  }

  /** Errors by their tolerances. */
  misses(configuration) {
    const { offset, restError } = this.errors(configuration);
    const { tolerance, rotation_tolerance: rotationTolerance } = this.simulator.task;
    return [...offset.map((value) => value / tolerance), ...restError.map((value) => (2 * value) / rotationTolerance)];
  }

  /** From a configuration to one that reaches the goal within bounds of the joints, or null. */
  from(start, lower, upper, rounds) {
    const at = start.map((value, k) => (k < lower.length ? clamp(value, lower[k], upper[k]) : value));
    for (let round = 0; !this.simulator.within(this.errors(at)); round++) {
      if (round === rounds) {
        return null;
      }
      // How errors change with each joint, by its step; then one joint's move after another's.
      const left = this.misses(at);
      const slopes = this.step.map((limit, k) => this.misses(at.map((value, i) => value + (i === k ? 1e-5 * limit : 0))).map((value, i) => (value - left[i]) / 1e-5));
      const begun = [...at];
      for (let sweep = 0; sweep < SWEEPS; sweep++) {
        slopes.forEach((slope, k) => {
          const [pull, stiffness] = [left, slope].map((other) => slope.reduce((sum, value, n) => sum + value * other[n], 0));
          const damped = pull + (DAMPING * (at[k] - begun[k])) / this.step[k];
          const moved = clamp(at[k] - (damped / (stiffness + DAMPING)) * this.step[k], lower[k], upper[k]);
          slope.forEach((value, n) => { left[n] += (value * (moved - at[k])) / this.step[k]; });
          at[k] = moved;
        });
      }
    }
    return at;
  }
}

/**
 * The nearest configuration that was found to reach a state's goal, and how many steps a straight
 * motion there takes; null if none was found. It is blind to contact, and no proof.
 */
function nearestSolution(simulator, { q, goal }) {
  const { lower, upper, step, task } = simulator;
  const search = new Search(simulator, goal);
  const far = (at) => Math.ceil(Math.max(...step.map((limit, k) => Math.abs(at[k] - q[k]) / limit)) - 1e-9);
  const found = [...anywhere(simulator, q)].map((at) => search.from(at, lower, upper, MOST_ROUNDS)).filter(Boolean);
  let nearest = null;
  for (let at of found.sort((a, b) => far(a) - far(b)).slice(0, MOST_IMPROVED)) {
    // Fewer steps, halving, as long as the goal is within reach of so many.
    for (let [low, high] = [-1, far(at)]; high - low > 1; ) {
      const steps = Math.floor((low + high) / 2);
      const bounds = [-steps, steps].map((way) => step.map((limit, k) => clamp(q[k] + way * limit, lower[k], upper[k])));
      const nearer = search.from(at, ...bounds, FEW_ROUNDS);
      [low, high, at] = nearer ? [low, steps, nearer] : [steps, high, at];
    }
    if (!nearest || far(at) < nearest.steps) {
      nearest = { steps: far(at), configuration: at };
    }
  }
  return nearest && { ...nearest, steps: nearest.steps + task.hold - 1 };
}

/* ---------- resolved-rate control; see `kinarm.kernels.goal_parts` ---------- */

/** Solution of least squares with damping, J^T (J J^T + damping)^-1 e, for columns of J. */
function dampedStep(columns, error, damping) {
  const rows = [...error.keys()];
  const square = rows.map((i) => rows.map((j) => columns.reduce((sum, column) => sum + column[i] * column[j], 0) + (i === j ? damping : 0)));
  const solved = [...error];
  for (const j of rows) {
    const inverse = 1 / square[j][j];
    for (const i of rows.slice(j + 1)) {
      square[j][i] = square[i][j];
      square[i][j] *= inverse;
    }
    for (const i of rows.slice(j + 1)) {
      for (const k of rows.slice(j + 1, i + 1)) {
        square[i][k] -= square[i][j] * square[j][k];
      }
      solved[i] -= square[i][j] * solved[j];
    }
    square[j][j] = inverse;
  }
  for (const i of rows.reverse()) {
    solved[i] *= square[i][i];
    for (let j = i + 1; j < rows.length; j++) {
      solved[i] -= square[j][i] * solved[j];
    }
  }
  return columns.map((column) => solved.reduce((sum, value, i) => sum + column[i] * value, 0));
}

const TURNS = {
  position: () => [],
  direction: (reached, wanted) => {
    const longer = 1 / Math.sqrt(Math.max(0.5 + 0.5 * dot(reached, wanted), 1e-6));
    return cross(reached, wanted).map((value) => longer * value);
  },
  pose: (reached, wanted) => {
    const [, ...turn] = timesQuaternion(wanted, [reached[0], -reached[1], -reached[2], -reached[3]]);
    const sign = reached.reduce((sum, value, k) => sum + value * wanted[k], 0) < 0 ? -2 : 2;
    return turn.map((value) => sign * value);
  },
};

/** Damped Newton step from commanded joints to the goal, by the steps' limits, at most 1 as a whole. */
function resolvedRate(simulator, { q, drive, goal }) {
  const { kinematics, step, task } = simulator;
  const poses = kinematics.poses([...drive.command, ...q.slice(step.length)]);
  const [tool, reached] = simulator.reached(poses);
  const turn = TURNS[task.kind](reached, goal.slice(3));
  const error = [...minus(goal, tool), ...turn];
  const columns = step.map((_, k) => {
    const { axis, slides } = kinematics.axes[k];
    const along = turned(poses[k + 1], axis);
    const moved = slides ? along : cross(along, minus(tool, poses[k + 1].slice(13)));
    let turns = slides ? [0, 0, 0] : along;
    if (task.kind === "direction") {
      turns = turns.map((value, i) => value - dot(reached, turns) * reached[i]);
    }
    return turn.length ? [...moved, ...turns] : moved;
  });
  const damping = 0.1 * error.reduce((sum, value) => sum + value * value, 0) + 1e-12;
  const action = dampedStep(columns, error, damping).map((value, k) => value / step[k]);
  const longest = Math.max(1, ...action.map(Math.abs));
  return action.map((value) => value / longest);
}

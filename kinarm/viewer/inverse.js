"use strict";

const STARTS = 16; // configurations from which a solution is sought, beside the present one
const MOST_ROUNDS = 30;
const MOST_IMPROVED = 6; // solutions that are brought nearer
const FEW_ROUNDS = 12; // to bring it nearer
const DAMPING = 1e-3;

/** Solution of a symmetric system, by Gauss' elimination. */
function solved(matrix, right) {
  const rows = matrix.map((row, i) => [...row, right[i]]);
  rows.forEach((pivot, i) => {
    for (const row of rows.slice(i + 1)) {
      const share = row[i] / pivot[i];
      pivot.forEach((value, j) => { row[j] -= share * value; });
    }
  });
  return rows.reduceRight((found, row, i) => {
    const known = found.reduce((sum, value, j) => sum + value * row[i + 1 + j], 0);
    return [(row[row.length - 1] - known) / row[i], ...found];
  }, []);
}

/** Configurations from which solutions are sought: always the same. */
function* anywhere({ lower, upper }, q) {
  yield q;
  for (let k = 1; k <= STARTS; k++) {
    yield q.map((value, i) => (i < lower.length ? lower[i] + ((k * Math.sqrt(2 + 3 * i)) % 1) * (upper[i] - lower[i]) : value));
  }
}

/** Searches configurations that reach a goal, by damped least squares. */
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
    const within = (value, k) => (k < lower.length ? clamp(value, lower[k], upper[k]) : value);
    let at = start.map(within);
    for (let round = 0; !this.simulator.within(this.errors(at)); round++) {
      if (round === rounds) {
        return null;
      }
      // How errors change with each joint, by its step; a joint at its bound rests.
      const now = this.misses(at);
      const slopes = this.step.map((limit, k) => this.misses(at.map((value, i) => value + (i === k ? 1e-5 * limit : 0))).map((value, i) => (value - now[i]) / 1e-5));
      const right = slopes.map((row) => -row.reduce((sum, value, n) => sum + value * now[n], 0));
      const free = slopes.map((_, k) => !(right[k] < 0 && at[k] <= lower[k]) && !(right[k] > 0 && at[k] >= upper[k]));
      const matrix = slopes.map((row, i) => slopes.map((other, j) => (i === j ? DAMPING : 0) + (free[i] && free[j] ? row.reduce((sum, value, n) => sum + value * other[n], 0) : 0)));
      const moves = solved(matrix, right.map((value, k) => (free[k] ? value : 0)));
      at = at.map((value, k) => within(value + (k < moves.length ? moves[k] * this.step[k] : 0), k));
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

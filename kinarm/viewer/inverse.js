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

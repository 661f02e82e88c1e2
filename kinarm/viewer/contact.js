"use strict";

/* ---------- contact: distances between convex shapes by Gilbert, Johnson and Keerthi's way ---------- */

const CLOSE = 5e-7; // bodies this far apart touch: half of the distance that Coal may take for none [m]
const NARROW = 1e-10; // bounds of a distance that are this close decide [m]
const MOST_CUTS = 200;

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const mixed = (points, weights) => [0, 1, 2].map((k) => points.reduce((sum, point, n) => sum + weights[n] * point[k], 0));

/** Poses of an arm's joints as rows [R | t], the world's first. */
class Kinematics {
  constructor(axes) {
    this.axes = axes;
  }

  poses(configuration) {
    const poses = [[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]];
    this.axes.forEach((axis, k) => {
      const fixed = pose(axis.rotation, axis.translation);
      const [x, y, z] = axis.axis;
      const value = configuration[k];
      const sine = Math.sin(value / 2);
      const moved = axis.slides
        ? pose([1, 0, 0, 0], [value * x, value * y, value * z])
        : pose([Math.cos(value / 2), sine * x, sine * y, sine * z], [0, 0, 0]);
      poses.push(chained(chained(poses[k], fixed), moved));
    });
    return poses;
  }
}

function pose([w, x, y, z], [a, b, c]) {
  return [
    1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), a,
    2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x), b,
    2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y), c,
  ];
}

function chained(first, second) {
  const product = [];
  for (const row of [0, 4, 8]) {
    for (let column = 0; column < 4; column++) {
      product.push(
        first[row] * second[column] + first[row + 1] * second[column + 4] + first[row + 2] * second[column + 8]
        + (column === 3 ? first[row + 3] : 0));
    }
  }
  return product;
}

const placed = (m, [x, y, z]) => [m[0] * x + m[1] * y + m[2] * z + m[3], m[4] * x + m[5] * y + m[6] * z + m[7], m[8] * x + m[9] * y + m[10] * z + m[11]];
const unturned = (m, [x, y, z]) => [m[0] * x + m[4] * y + m[8] * z, m[1] * x + m[5] * y + m[9] * z, m[2] * x + m[6] * y + m[10] * z];

/** The hull of points, or of two discs, widened by a radius, carried by a joint. */
class Body {
  constructor({ name, joint, points, discs, radius }) {
    Object.assign(this, { name, joint, points, discs, radius });
    this.axis = discs ? minus(points[1], points[0]).map((value, _, all) => value / Math.hypot(...all)) : null;
    const [low, high] = [Math.min, Math.max].map((end) => [0, 1, 2].map((k) => end(...points.map((point) => point[k]))));
    this.middle = low.map((value, k) => (value + high[k]) / 2);
    this.extent = radius + (discs || 0) + Math.max(...points.map((point) => Math.hypot(...minus(point, this.middle))));
  }

  place(poses) {
    this.pose = poses[this.joint];
    this.centre = placed(this.pose, this.middle);
  }

  /** The point farthest along a direction, without the radius, in the world. */
  support(direction) {
    const along = unturned(this.pose, direction);
    let [best, most] = [this.points[0], -Infinity];
    for (const point of this.points) {
      const reach = point[0] * along[0] + point[1] * along[1] + point[2] * along[2];
      if (reach > most) {
        [best, most] = [point, reach];
      }
    }
    if (this.discs) {
      const height = dot(along, this.axis);
      const across = along.map((value, k) => value - height * this.axis[k]);
      const length = Math.hypot(...across);
      best = length > 0 ? best.map((value, k) => value + (this.discs * across[k]) / length) : best;
    }
    return placed(this.pose, best);
  }
}

/** Weights of the point of a simplex that is nearest to the origin; all above 0. */
function nearest(simplex) {
  const points = simplex.map((corner) => corner.apart);
  let found = { length: Infinity };
  const take = (members, weights) => {
    const point = mixed(members.map((n) => points[n]), weights);
    const length = Math.hypot(...point);
    if (length < found.length) {
      found = { members, weights, point, length };
    }
  };
  points.forEach((_, a) => {
    take([a], [1]);
    for (let b = 0; b < a; b++) {
      const edge = minus(points[b], points[a]);
      const share = -dot(points[a], edge) / dot(edge, edge);
      if (share > 0 && share < 1) {
        take([a, b], [1 - share, share]);
      }
      for (let c = 0; c < b; c++) {
        const normal = cross(edge, minus(points[c], points[a]));
        const area = dot(normal, normal);
        const [u, v, w] = [[b, c], [c, a], [a, b]].map(([i, j]) => dot(normal, cross(points[i], points[j])) / area);
        if (u > 0 && v > 0 && w > 0) {
          take([a, b, c], [u, v, w]);
        }
      }
    }
  });
  if (points.length === 4) {
    const volumes = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]].map(([i, j, k]) => dot(points[i], cross(points[j], points[k])));
    const whole = volumes.reduce((sum, volume) => sum + volume);
    if (volumes.every((volume) => volume * whole > 0)) {
      return { members: [0, 1, 2, 3], weights: volumes.map((volume) => volume / whole), length: 0 };
    }
  }
  return found;
}

/** Where two bodies touch, or null; see Gilbert, Johnson and Keerthi (1988). */
function touch(first, second) {
  const radius = first.radius + second.radius;
  const between = minus(first.centre, second.centre);
  if (Math.hypot(...between) > first.extent + second.extent) {
    return null;
  }
  let simplex = [];
  let found = { point: dot(between, between) > 0 ? between : [1, 0, 0] };
  found.length = Math.hypot(...found.point);
  for (let cut = 0; cut < MOST_CUTS; cut++) {
    const [a, b] = [first.support(found.point.map((value) => -value)), second.support(found.point)];
    const corner = { a, b, apart: minus(a, b) };
    const least = dot(corner.apart, found.point) / found.length;
    if (least > radius + CLOSE) {
      return null;
    }
    const known = simplex.some((other) => other.apart.every((value, k) => value === corner.apart[k]));
    if (simplex.length > 0 && (found.length - least < NARROW || known)) {
      break;
    }
    const wider = [...simplex, corner];
    const next = nearest(wider);
    if (simplex.length > 0 && next.length >= found.length) {
      break; // rounding errors are all that is left
    }
    found = next;
    simplex = found.members.map((n) => wider[n]);
    if (found.length <= radius + NARROW) {
      break;
    }
  }
  if (found.length > radius + CLOSE) {
    return null;
  }
  const [a, b] = ["a", "b"].map((end) => mixed(simplex.map((corner) => corner[end]), found.weights));
  const share = radius > 0 ? first.radius / radius : 0;
  return a.map((value, k) => value + share * (b[k] - value));
}

/** Where a body touches the ground, or null. */
function touchGround(body) {
  const lowest = body.support([0, 0, -1]);
  return lowest[2] <= body.radius ? [lowest[0], lowest[1], Math.min(lowest[2] - body.radius, 0)] : null;
}

/** Pairs of an arm in a scene that touch, as in kinarm's own model of contact. */
class ContactTest {
  constructor({ axes, bodies, pairs }) {
    this.kinematics = new Kinematics(axes);
    this.bodies = bodies.map((body) => (body.points ? new Body(body) : body));
    this.pairs = pairs;
  }

  /** All pairs [first, second, point] that touch at a configuration. */
  at(configuration) {
    const poses = this.kinematics.poses(configuration);
    const { bodies } = this;
    bodies.forEach((body) => body.points && body.place(poses));
    return this.pairs.flatMap(([first, second]) => {
      const [one, other] = [bodies[first], bodies[second]];
      const point = other.points ? touch(one, other) : touchGround(one);
      return point ? [[first, second, point]] : [];
    });
  }
}

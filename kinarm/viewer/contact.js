"use strict";

/* ---------- contact: distances between convex shapes by Gilbert, Johnson and Keerthi's way ---------- */

const CLOSE = 5e-7; // bodies this far apart touch: half of the distance that Coal may take for none [m]
const TOUCHING = 1e-6; // bodies that come this close in a motion touch, as in `kinarm.step_contact` [m]
const TOLD_APART = 2.5e-7; // distances that differ less are the same there [m]
const MOST_ASKED = 20000; // distances in a motion, after which it touches, as there
const NARROW = 1e-10; // bounds of a distance that are this close decide [m]
const MOST_CUTS = 200;

const mixed = (points, weights) => [0, 1, 2].map((k) => points.reduce((sum, point, n) => sum + weights[n] * point[k], 0));

/** The hull of points, or of two discs, widened by a radius, carried by a joint. */
class Body {
  constructor({ name, joint, points, discs, radius }) {
    Object.assign(this, { name, joint, points, discs, radius, standing: WORLD });
    this.axis = discs ? minus(points[1], points[0]).map((value, _, all) => value / Math.hypot(...all)) : null;
    const [low, high] = [Math.min, Math.max].map((end) => [0, 1, 2].map((k) => end(...points.map((point) => point[k]))));
    this.middle = low.map((value, k) => (value + high[k]) / 2);
    this.extent = radius + (discs || 0) + Math.max(...points.map((point) => Math.hypot(...minus(point, this.middle))));
  }

  place(poses) {
    this.pose = this.joint ? poses[this.joint] : this.standing;
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

/**
 * Distance of two bodies [m] and a point between; see Gilbert, Johnson and Keerthi (1988).
 * Beyond `enough`, any lower bound that is larger, and no point.
 */
function nearness(first, second, enough) {
  const radius = first.radius + second.radius;
  const between = minus(first.centre, second.centre);
  const far = Math.hypot(...between);
  if (far > first.extent + second.extent + enough) {
    return { apart: far - first.extent - second.extent };
  }
  let simplex = [];
  let found = { point: far > 0 ? between : [1, 0, 0] };
  found.length = Math.hypot(...found.point);
  for (let cut = 0; cut < MOST_CUTS; cut++) {
    const [a, b] = [first.support(found.point.map((value) => -value)), second.support(found.point)];
    const corner = { a, b, apart: minus(a, b) };
    const least = dot(corner.apart, found.point) / found.length;
    if (least > radius + enough) {
      return { apart: least - radius };
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
  const [a, b] = ["a", "b"].map((end) => mixed(simplex.map((corner) => corner[end]), found.weights));
  const share = radius > 0 ? first.radius / radius : 0;
  return { apart: found.length - radius, point: a.map((value, k) => value + share * (b[k] - value)) };
}

/** Height of a body above a half-space [m], and its lowest point, on or below the surface. */
function height(body, { normal, offset, standing }) {
  const lowest = body.support(normal.map((value) => -value));
  const apart = dot(normal, minus(lowest, standing.slice(13))) - offset - body.radius;
  return { apart, point: lowest.map((value, k) => value - normal[k] * (body.radius + Math.max(apart, 0))) };
}

/** Pairs of an arm in a scene that touch, as in kinarm's own model of contact. */
class ContactTest {
  constructor({ axes, bodies, pairs, travel }) {
    this.kinematics = new Kinematics(axes);
    this.bodies = bodies.map((body) => (body.points ? new Body(body) : { ...body, standing: WORLD }));
    this.pairs = pairs;
    this.travel = travel; // how far a joint moves the bodies of a pair at most, as in `ContactShapes`
  }

  /** Distance of a pair; see `nearness`. */
  apart(pair, poses, enough) {
    const [first, second] = this.pairs[pair].map((number) => this.bodies[number]);
    first.place(poses);
    if (!second.points) {
      return height(first, second);
    }
    second.place(poses);
    return nearness(first, second, enough);
  }

  /** All pairs [first, second, point, pair] that touch at a configuration. */
  at(configuration) {
    const poses = this.kinematics.poses(configuration);
    return this.pairs.flatMap((bodies, pair) => {
      const { apart, point } = this.apart(pair, poses, CLOSE);
      return apart <= CLOSE ? [[...bodies, point, pair]] : [];
    });
  }

  /** Whether no pair touches while joints stay within reaches of a configuration [rad or m]. */
  isFreeAbout(configuration, reaches) {
    const poses = this.kinematics.poses(configuration);
    return this.pairs.every((_, pair) => {
      const enough = TOUCHING + TOLD_APART + this.way(pair, reaches);
      return this.apart(pair, poses, enough).apart > enough;
    });
  }

  way(pair, moves) {
    return this.travel.reduce((sum, row, k) => sum + row[pair] * Math.abs(moves[k]), 0);
  }

  /**
   * What touches first in a straight motion, as { share, pair, point }, or null: from distance to
   * distance, as far as the pair cannot close it (conservative advancement, Mirtich 1996).
   * One pair, if given, is looked at before the others, and the first one found is told.
   */
  inMotion(start, end, before = null) {
    const moves = end.map((value, k) => value - start[k]);
    const begun = this.kinematics.poses(start);
    let first = null;
    for (const pair of before === null ? this.pairs.keys() : [before, ...this.pairs.keys()]) {
      const found = this.pairInMotion(pair, start, moves, begun);
      if (found && (!first || found.share < first.share)) {
        first = found;
      }
      if (found && before !== null) {
        break;
      }
    }
    return first;
  }

  pairInMotion(pair, start, moves, begun) {
    const way = this.way(pair, moves);
    for (let share = 0, asked = 0, poses = begun; share <= 1 && way > 0; asked++) {
      const left = way * (1 - share) + TOUCHING;
      const { apart, point } = this.apart(pair, poses, left);
      if (apart > left) {
        return null;
      }
      if (apart < TOUCHING + TOLD_APART || asked === MOST_ASKED) { // of which it cannot be told apart
        return { share, pair, point };
      }
      share += (apart - TOUCHING) / way;
      poses = this.kinematics.poses(start.map((value, k) => value + share * moves[k]));
    }
    return null;
  }
}

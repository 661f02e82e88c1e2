"use strict";

/* ---------- elementary functions and forward kinematics: the bits of kinarm's kernels ---------- */

const whole = (x) => (x + 1.5 * 2 ** 52) - 1.5 * 2 ** 52; // nearest whole number

/** Sine and cosine; see `kinarm.kernels.elementary`. */
function sineCosine(angle) {
  const quarter = whole(angle * 0.63661977236758134308);
  const x = (angle - quarter * 1.57079632673412561417) - quarter * 6.07710050650619224932e-11;
  const z = x * x;
  let odd = -2.50507602534068634195e-8 + z * 1.58969099521155010221e-10;
  odd = -1.98412698298579493134e-4 + z * (2.75573137070700676789e-6 + z * odd);
  odd = -1.66666666666666324348e-1 + z * (8.33333333332248946124e-3 + z * odd);
  let even = 2.08757232129817482790e-9 + z * -1.13596475577881948265e-11;
  even = 2.48015872894767294178e-5 + z * (-2.75573143513906633035e-7 + z * even);
  even = 4.16666666666666019037e-2 + z * (-1.38888888888741095749e-3 + z * even);
  const [sine, cosine] = [x + x * z * odd, 1 - (0.5 * z - z * z * even)];
  return [[sine, cosine], [cosine, -sine], [-sine, -cosine], [-cosine, sine]][((quarter % 4) + 4) % 4];
}

function exponential(power) {
  const doublings = whole(power * 1.4426950408889634074);
  const x = (power - doublings * 6.93145751953125e-1) - doublings * 1.42860682030941723212e-6;
  const z = x * x;
  const p = x * (9.99999999999999999910e-1 + z * (3.02994407707441961300e-2 + z * 1.26177193074810590878e-4));
  let q = 2.27265548208155028766e-1 + z * (2.52448340349684104192e-3 + z * 3.00198505138664455042e-6);
  q = 2 + z * q;
  return (1 + 2 * (p / (q - p))) * 2 ** doublings;
}

function hyperbolicTangent(x) {
  const size = Math.abs(x);
  if (size < 0.625) {
    const z = x * x;
    const p = -1.61468768441708447952e3 + z * (-9.92877231001918586564e1 + z * -9.64399179425052238628e-1);
    const q = 4.84406305325125486048e3 + z * (2.23548839060100448583e3 + z * (1.12811678491632931402e2 + z));
    return x + x * z * (p / q);
  }
  const large = 1 - 2 / (exponential(2 * Math.min(size, 20)) + 1);
  return x < 0 ? -large : large;
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const timesQuaternion = ([aw, ax, ay, az], [bw, bx, by, bz]) => [
  aw * bw - ax * bx - ay * by - az * bz, aw * bx + ax * bw + ay * bz - az * by,
  aw * by - ax * bz + ay * bw + az * bx, aw * bz + ax * by - ay * bx + az * bw,
];
const turned = (p, [x, y, z]) => [p[4] * x + p[5] * y + p[6] * z, p[7] * x + p[8] * y + p[9] * z, p[10] * x + p[11] * y + p[12] * z];
const unturned = (p, [x, y, z]) => [p[4] * x + p[7] * y + p[10] * z, p[5] * x + p[8] * y + p[11] * z, p[6] * x + p[9] * y + p[12] * z];

function placed(pose, point) {
  const [x, y, z] = turned(pose, point);
  return [pose[13] + x, pose[14] + y, pose[15] + z];
}

const WORLD = [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0];

/** Poses of an arm's joints, the world's first: quaternion w x y z, rotation by rows, position. */
class Kinematics {
  constructor(axes) {
    this.axes = axes;
  }

  poses(configuration) {
    const poses = [WORLD];
    this.axes.forEach(({ translation, rotation, axis, slides }, k) => {
      const origin = placed(poses[k], translation);
      const [sine, cosine] = slides ? [0, 1] : sineCosine(0.5 * configuration[k]);
      const turn = [cosine, ...axis.map((value) => sine * value)];
      const following = rotation[0] === 1 ? turn : timesQuaternion(rotation, turn);
      const [w, x, y, z] = timesQuaternion(poses[k], following);
      const pose = [
        w, x, y, z,
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
        ...origin,
      ];
      if (slides) {
        turned(pose, axis).forEach((value, i) => { pose[13 + i] += configuration[k] * value; });
      }
      poses.push(pose);
    });
    return poses;
  }
}

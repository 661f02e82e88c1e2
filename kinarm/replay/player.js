"use strict";

const element = (id) => document.getElementById(id);
const SPEEDS = [0.1, 0.25, 0.5, 1, 2];
const HOLD = 1.4; // seconds between the end of a trial and the next one
const THEMES = {
  light: { back: 0xeef1f4, floor: 0xd3d9df, grid: 0xb4bdc7, bench: 0x8f9aa8, top: 0xb3bdc8, ghost: 0x4d5a68, sky: 0.3, sun: 0.62 },
  dark: { back: 0x1a1f25, floor: 0x171c22, grid: 0x3c4753, bench: 0x3d4752, top: 0x586573, ghost: 0xb4c1ce, sky: 0.22, sun: 0.6 },
};
const RIVAL = 0x56b4e9;
const BEHIND = { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 8 }; // gives way to what coincides
const BADGES = {
  success: ["Reached", "m5 12.5 4.5 4.5L19 7.5"],
  collision: ["Contact", "M6 6l12 12M18 6 6 18"],
  horizon: ["Out of time", "M12 6v6.5l4 2.5M12 3a9 9 0 1 0 .01 0"],
};

/* ---------- data ---------- */

async function inflated(id) {
  const packed = Uint8Array.from(atob(element(id).textContent), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

async function startViewer() {
  const script = document.createElement("script");
  script.textContent = new TextDecoder().decode(await inflated("data-viewer"));
  document.head.append(script);
  const viewer = new MeshCat.Viewer(element("stage"));
  const bytes = await inflated("data-scene");
  const view = new DataView(bytes.buffer);
  for (let at = 0; at < bytes.length; ) {
    const length = view.getUint32(at, true);
    viewer.handle_command_bytearray(bytes.subarray(at + 4, at + 4 + length));
    at += 4 + length;
  }
  return viewer;
}

/* ---------- the arm: joint values to poses ---------- */

class ArmModel {
  constructor(THREE, root, description) {
    this.THREE = THREE;
    this.root = root;
    this.axes = description.axes;
    this.frames = [root];
    for (let k = 1; k <= this.axes.length; k++) {
      this.frames.push(this.frames[k - 1].children.find((child) => child.name === `axis_${k}`));
    }
    this.tool = new THREE.Group();
    this.tool.position.fromArray(description.tool);
    this.frames[this.axes.length].add(this.tool);
  }

  show(configuration) {
    const { THREE } = this;
    this.axes.forEach((axis, k) => {
      const [w, x, y, z] = axis.rotation;
      const frame = this.frames[k + 1];
      const direction = new THREE.Vector3(...axis.axis);
      frame.position.fromArray(axis.translation);
      frame.quaternion.set(x, y, z, w);
      if (axis.slides) {
        frame.position.addScaledVector(direction.applyQuaternion(frame.quaternion), configuration[k]);
      } else {
        frame.quaternion.multiply(new THREE.Quaternion().setFromAxisAngle(direction, configuration[k]));
      }
    });
  }

  /** A translucent copy; a pass that draws only depth keeps its inside from showing. */
  ghost(description, colour, opacity) {
    const { THREE } = this;
    const root = this.root.clone(true);
    const material = new THREE.MeshStandardMaterial({
      color: new THREE.Color(colour).convertSRGBToLinear(), roughness: 0.7, transparent: true, opacity, depthWrite: false, ...BEHIND,
    });
    const depth = new THREE.MeshBasicMaterial({ colorWrite: false, transparent: true, ...BEHIND });
    const meshes = [];
    root.traverse((node) => node.isMesh && meshes.push(node));
    for (const mesh of meshes) {
      const veil = mesh.clone();
      Object.assign(mesh, { material, castShadow: false, receiveShadow: false, renderOrder: 2 });
      Object.assign(veil, { material: depth, castShadow: false, receiveShadow: false, renderOrder: 1 });
      mesh.parent.add(veil);
    }
    this.root.parent.add(root);
    const copy = new ArmModel(THREE, root, description);
    copy.material = material;
    return copy;
  }
}

/* ---------- the stage: everything that is drawn in three dimensions ---------- */

class Stage {
  constructor(viewer, data) {
    this.viewer = viewer;
    this.data = data;
    this.THREE = MeshCat.THREE;
    const { THREE } = this;
    viewer.renderer.outputEncoding = THREE.sRGBEncoding;
    viewer.renderer.domElement.tabIndex = -1;
    viewer.renderer.setClearAlpha(0); // the page's own background shows through
    viewer.scene.background = null;
    viewer.scene.traverse((node) => node.isMesh && node.material.color.convertSRGBToLinear());
    this.light();
    this.arm = new ArmModel(THREE, this.find("arm"), data);
    this.tint = this.finishes();
    this.start = this.arm.ghost(data, 0x808890, 0.16);
    this.refused = this.arm.ghost(data, data.colours.collision, 0.34);
    this.rival = data.trials.some((trial) => trial.runs.length > 1) ? this.arm.ghost(data, RIVAL, 0.55) : null;
    this.flash = this.find("flash");
    this.mesh("flash").renderOrder = 9;
    this.mesh("flash").material.depthTest = false;
    for (const name of ["goal", "flash"]) {
      this.find(name).traverse((node) => { node.castShadow = node.castShadow && node.material && !node.material.transparent; });
    }
    this.find("floor").traverse((node) => { node.castShadow = false; });
    this.camera();
  }

  find(...path) {
    return this.viewer.scene_tree.find(["meshcat", ...path]).object;
  }

  mesh(...path) {
    return this.find(...path, "<object>");
  }

  /** A sky, a light against hard shadows, and soft reflections of a bright room. */
  light() {
    const { THREE, viewer } = this;
    viewer.scene_tree.find(["Lights"]).object.visible = false;
    this.sky = new THREE.HemisphereLight(0xffffff, 0xb9c0c8);
    const fill = new THREE.DirectionalLight(0xdce8ff, 0.3);
    fill.position.set(-2.5, 1.8, -2.2);
    viewer.scene.add(this.sky, fill);
    const room = new THREE.Scene();
    const panel = (colour, size, place) => {
      const mesh = new THREE.Mesh(new THREE.BoxGeometry(...size), new THREE.MeshBasicMaterial({ color: colour, side: THREE.DoubleSide }));
      mesh.position.set(...place);
      room.add(mesh);
    };
    panel(0x5c6066, [12, 8, 12], [0, 2, 0]);
    panel(0xffffff, [5, 0.1, 2.4], [1, 5.4, 1]);
    panel(0xe8f0ff, [0.1, 3, 6], [-5.5, 2.5, 0]);
    panel(0xfff4e4, [6, 2.4, 0.1], [0, 3, 5.6]);
    const generator = new THREE.PMREMGenerator(viewer.renderer);
    viewer.scene.environment = generator.fromScene(room, 0.03).texture;
    generator.dispose();
  }

  /** Materials of the arm by joint, to light up what touches. */
  finishes() {
    return this.arm.frames.map((frame) =>
      frame.children.filter((child) => child.name.startsWith("part_")).map((part) => part.children[0].material));
  }

  theme(name) {
    const { viewer } = this;
    const look = THEMES[name];
    const colour = (value) => new this.THREE.Color(value).convertSRGBToLinear();
    viewer.scene.fog = new this.THREE.Fog(look.back, 1, 2); // mixed in after the conversion to sRGB
    this.clear();
    const paint = (value, node) => node.traverse((mesh) => mesh.material && mesh.material.color.copy(colour(value)));
    paint(look.floor, this.find("floor"));
    paint(look.grid, this.find("grid"));
    for (const bench of this.find("benches").children) {
      paint(look.bench, bench.children.find((child) => child.name === "body"));
      paint(look.top, bench.children.find((child) => child.name === "top"));
    }
    this.start.material.color.copy(colour(look.ghost));
    this.sky.intensity = look.sky;
    this.mesh("sun").intensity = look.sun;
    viewer.set_dirty();
  }

  camera() {
    const { viewer } = this;
    viewer.camera.fov = 30;
    viewer.camera.near = 0.05;
    this.side = 0;
    this.touched = false;
    viewer.controls.addEventListener("start", () => { this.touched = true; });
    viewer.controls.addEventListener("change", () => this.clear());
    viewer.controls.minDistance = 0.3;
    viewer.controls.maxDistance = 7;
    viewer.controls.maxPolarAngle = 1.54;
    window.addEventListener("resize", () => this.touched || this.look(this.side));
  }

  /** Let the floor fade out behind the scene, wherever that is seen from. */
  clear() {
    const { fog } = this.viewer.scene;
    fog.near = this.viewer.camera.position.length() + 0.2;
    fog.far = fog.near + 3.6;
  }

  /** Look from behind, on the side (1 left, -1 right) where the goal is. */
  look(side) {
    const { viewer } = this;
    const aspect = window.innerWidth / window.innerHeight;
    const away = 1.2 * Math.max(1, 1.28 / aspect);
    const target = new this.THREE.Vector3(0.05, 0.2, -0.1 * side);
    const eye = new this.THREE.Vector3(-2.35, 1.5, -1.85 * side).multiplyScalar(away);
    viewer.controls.target.copy(target);
    viewer.camera.position.copy(target).add(eye);
    this.side = side;
    this.touched = false;
    viewer.set_dirty();
  }

  select(index) {
    const trial = this.data.trials[index];
    this.trial = trial;
    for (const group of this.find("trials").children) {
      group.visible = group.name === String(index);
    }
    this.traces = trial.runs.map((run, k) => run.states.length > 1 && this.mesh("trials", String(index), k ? "ghost" : "run"));
    if (this.traces[1]) {
      Object.assign(this.traces[1].material, { transparent: true, opacity: 0.5 });
    }
    this.find("goal").position.fromArray(trial.goal);
    this.start.show(trial.runs[0].states[0]);
    if (this.rival) {
      this.rival.root.visible = trial.runs.length > 1;
    }
    const side = trial.goal[1] < 0 ? -1 : 1;
    if (!this.touched && side !== this.side) {
      this.look(side);
    }
  }

  /** Show a moment; between steps the joints move evenly, as they do in the simulator. */
  show(time) {
    const { trial } = this;
    trial.runs.forEach((run, k) => {
      const arm = k ? this.rival : this.arm;
      const last = run.states.length - 1;
      const at = Math.min(time, last);
      const step = Math.min(Math.floor(at), Math.max(last - 1, 0));
      const share = at - step;
      const next = run.states[Math.min(step + 1, last)];
      const exact = share === 0 ? run.states[step] : share === 1 ? next : null;
      arm.show(exact || run.states[step].map((value, axis) => value + share * (next[axis] - value)));
      if (this.traces[k]) {
        this.traces[k].geometry.setDrawRange(0, Math.ceil(at) * this.data.traceIndices);
        this.traces[k].visible = at > 0;
      }
    });
    const main = trial.runs[0];
    const ended = time >= main.states.length - 1;
    this.start.root.visible = time > 0.5;
    this.over(main, ended);
    this.viewer.set_dirty();
  }

  /** What shows only at the end: the cube lights up, or what touched does. */
  over(run, ended) {
    const cube = this.mesh("goal", "cube").material;
    cube.emissive.set(ended && run.outcome === "success" ? 0x0b6b50 : 0x000000);
    const touched = ended && run.outcome === "collision";
    this.flash.visible = touched && run.contactPoint !== null;
    this.refused.root.visible = touched && run.refused !== null;
    if (this.flash.visible) {
      this.flash.position.fromArray(run.contactPoint);
    }
    if (this.refused.root.visible) {
      this.refused.show(run.refused);
    }
    const joints = touched ? (run.contact || []).map((body) => this.data.links[body]) : [];
    this.tint.forEach((materials, joint) => {
      for (const material of materials) {
        material.emissive.set(joints.includes(joint) ? 0x8c2f00 : 0x000000);
      }
    });
  }

  pulse(seconds) {
    const swing = 0.5 - 0.5 * Math.cos(2 * Math.PI * 1.1 * seconds);
    this.flash.scale.setScalar(1 + 1.1 * swing);
    this.mesh("flash").material.opacity = 0.75 - 0.45 * swing;
    this.viewer.set_dirty();
  }

  /** Pose of "base", "axis_1", ... or "tool" in the world, column by column. */
  pose(name, run = 0) {
    const arm = run ? this.rival : this.arm;
    const node = name === "tool" ? arm.tool : name === "base" ? arm.root : arm.frames[Number(name.slice(5))];
    const { scene } = this.viewer;
    scene.updateMatrixWorld(true);
    return scene.matrixWorld.clone().invert().multiply(node.matrixWorld).toArray();
  }

  /** What there is to see: meshes with their boxes, and the triangles that were drawn. */
  census() {
    const meshes = [];
    this.viewer.render();
    this.arm.root.traverse((node) => {
      if (node.isMesh) {
        const bounds = new this.THREE.Box3().setFromObject(node);
        meshes.push([...bounds.min.toArray(), ...bounds.max.toArray()]);
      }
    });
    return { meshes, triangles: this.viewer.renderer.info.render.triangles };
  }
}

/* ---------- the panels: card, plot and controls ---------- */

function make(tag, attributes = {}, text = "") {
  const svg = ["path", "line", "svg"].includes(tag);
  const node = svg ? document.createElementNS("http://www.w3.org/2000/svg", tag) : document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    node.setAttribute(name, value);
  }
  node.append(text);
  return node;
}

function badge(outcome) {
  const [words, shape] = BADGES[outcome];
  const node = make("span", { class: `badge ${outcome}` });
  const icon = make("svg", { viewBox: "0 0 24 24", "aria-hidden": "true" });
  icon.append(make("path", { d: shape }));
  node.append(icon, words);
  return node;
}

const metres = (value) => `${value.toFixed(3)} m`;
const count = (number, noun) => `${number} ${noun}${number === 1 ? "" : "s"}`;

/** How a run ended, in words. */
function verdict(run, trial) {
  const steps = run.states.length - 1;
  const distance = metres(run.distances[steps]);
  if (run.outcome === "collision") {
    const pair = run.contact ? run.contact.join(" touches ") : "something touches";
    return `${pair} after ${count(steps, "step")}, ${distance} from the goal`;
  }
  if (run.outcome === "horizon") {
    return `${distance} from the goal after ${count(steps, "step")}`;
  }
  const ratio = steps === trial.floor ? ", as few as possible" : `, ${(steps / trial.floor).toFixed(1)} times what is necessary`;
  return `${count(steps, "step")}${trial.floor ? ratio : ""}`;
}

function fillCard(trial) {
  element("eyebrow").textContent = `Task ${trial.task} · trial ${trial.trial}`;
  element("runs").replaceChildren(...trial.runs.map((run, k) => {
    const row = make("li");
    const name = make("span", { class: "name" });
    if (trial.runs.length > 1) {
      name.append(make("span", { class: "swatch", style: `background: ${k ? "#56b4e9" : "#f2b21b"}` }));
    }
    name.append(run.policy);
    row.append(name, badge(run.outcome), make("span", { class: "note" }, verdict(run, trial)));
    return row;
  }));
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
  plot.append(make("line", { class: "head", y1: -4, y2: 104 }));
}

/* ---------- the player ---------- */

class Player {
  constructor(stage, data) {
    this.stage = stage;
    this.data = data;
    this.speed = 0.25;
    this.playing = false;
    this.calm = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
    data.trials.forEach((trial, index) => {
      const words = BADGES[trial.runs[0].outcome][0].toLowerCase();
      element("trial").append(make("option", { value: index }, `${trial.task} ${trial.trial}: ${words}`));
    });
    element("trial-choice").hidden = data.trials.length < 2;
    this.connect();
    this.setTheme(window.matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
    this.select(0);
    requestAnimationFrame((now) => this.tick(now));
  }

  get trial() {
    return this.data.trials[this.index];
  }

  select(index) {
    this.index = (index + this.data.trials.length) % this.data.trials.length;
    this.frames = Math.max(...this.trial.runs.map((run) => run.states.length - 1));
    this.stage.select(this.index);
    element("trial").value = this.index;
    element("frame").max = this.frames;
    fillCard(this.trial);
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
    const head = element("plot").querySelector(".head");
    const x = (1000 * this.time) / Math.max(this.frames, 1);
    head.setAttribute("x1", x);
    head.setAttribute("x2", x);
  }

  seek(frame) {
    this.pause();
    this.show(Math.round(frame));
  }

  play() {
    if (this.time >= this.frames) {
      this.show(0);
    }
    this.setPlaying(true);
  }

  pause() {
    this.setPlaying(false);
  }

  setPlaying(playing) {
    this.playing = playing;
    this.held = 0;
    document.body.classList.toggle("playing", playing);
    element("play").setAttribute("aria-label", playing ? "Pause" : "Play");
  }

  setSpeed(speed) {
    this.speed = speed;
    element("speed").value = speed;
  }

  setTheme(name) {
    this.theme = name;
    document.documentElement.dataset.theme = name;
    this.stage.theme(name);
  }

  tick(now) {
    const passed = Math.min((now - (this.before ?? now)) / 1000, 0.1);
    this.before = now;
    if (this.playing) {
      this.advance(passed);
    }
    if (this.stage.flash.visible && !this.calm) {
      this.stage.pulse(now / 1000);
    }
    requestAnimationFrame((next) => this.tick(next));
  }

  /** Play on; at the end hold for a moment, then go to the next trial. */
  advance(passed) {
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

  connect() {
    const click = (id, action) => element(id).addEventListener("click", action);
    click("play", () => this.toggle());
    click("first", () => this.seek(0));
    click("back", () => this.seek(Math.ceil(this.time) - 1));
    click("forward", () => this.seek(Math.floor(this.time) + 1));
    click("previous", () => this.select(this.index - 1));
    click("next", () => this.select(this.index + 1));
    click("view", () => this.stage.look(this.stage.side));
    click("theme", () => this.setTheme(this.theme === "dark" ? "light" : "dark"));
    click("help", () => this.toggleKeys());
    element("frame").addEventListener("input", (event) => this.seek(Number(event.target.value)));
    element("speed").addEventListener("change", (event) => this.setSpeed(Number(event.target.value)));
    element("trial").addEventListener("change", (event) => this.select(Number(event.target.value)));
    window.addEventListener("resize", () => drawPlot(this.trial, this.frames, this.data.colours) ?? this.show(this.time));
    document.addEventListener("keydown", (event) => this.press(event));
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

  toggle() {
    if (this.playing) {
      this.pause();
    } else {
      this.play();
    }
  }

  toggleKeys() {
    element("keys").hidden = !element("keys").hidden;
    element("help").setAttribute("aria-expanded", String(!element("keys").hidden));
  }

  press(event) {
    const tag = event.target.tagName;
    const own = { SELECT: () => true, INPUT: (key) => key !== " " && key.length > 1, BUTTON: (key) => key === " " || key === "Enter" };
    if (event.ctrlKey || event.metaKey || event.altKey || (own[tag] && own[tag](event.key))) {
      return;
    }
    const faster = (by) => this.setSpeed(SPEEDS[Math.min(Math.max(SPEEDS.indexOf(this.speed) + by, 0), SPEEDS.length - 1)]);
    const actions = {
      " ": () => this.toggle(),
      ArrowLeft: () => this.seek(Math.ceil(this.time) - 1),
      ArrowRight: () => this.seek(Math.floor(this.time) + 1),
      Home: () => this.seek(0),
      End: () => this.seek(this.frames),
      p: () => this.select(this.index - 1),
      n: () => this.select(this.index + 1),
      ",": () => faster(-1),
      ".": () => faster(1),
      r: () => this.stage.look(this.stage.side),
      t: () => this.setTheme(this.theme === "dark" ? "light" : "dark"),
      "?": () => this.toggleKeys(),
    };
    const action = actions[event.key.length > 1 ? event.key : event.key.toLowerCase()];
    if (action) {
      event.preventDefault();
      action();
    }
  }

  get state() {
    const run = this.trial.runs[0];
    return {
      index: this.index, trial: this.trial.trial, task: this.trial.task, policy: run.policy, outcome: run.outcome,
      frame: Math.floor(this.time), frames: this.frames, playing: this.playing, speed: this.speed, theme: this.theme,
    };
  }
}

async function main() {
  const data = JSON.parse(new TextDecoder().decode(await inflated("data-trials")));
  const viewer = await startViewer();
  element("card").hidden = element("dock").hidden = false;
  const stage = new Stage(viewer, data);
  const player = new Player(stage, data);
  viewer.set_3d_pane_size();
  element("message").hidden = true;
  window.kinarm = {
    seek: (frame) => player.seek(frame),
    select: (index) => player.select(index),
    play: () => player.play(),
    pause: () => player.pause(),
    pose: (name, run) => stage.pose(name, run),
    census: () => stage.census(),
    get state() { return player.state; },
  };
  document.body.dataset.ready = "";
  if (!player.calm) {
    player.play();
  }
}

main().catch((error) => {
  element("message").textContent = `This browser cannot show the replay, which needs WebGL and gzip streams: ${error.message}`;
  throw error;
});

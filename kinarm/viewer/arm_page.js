"use strict";

const MOST_NAMED = 4; // pairs that are named when many touch
const TURN = Math.PI / 180;

/* ---------- the stage of an arm that is moved by hand ---------- */

class ArmStage extends Stage {
  constructor(viewer, data) {
    super(viewer, data);
    this.shapes = data.bodies.flatMap((body, number) => {
      const group = this.arm.frames[body.joint].children.find((child) => child.name === `shape_${number}`);
      return group ? [group] : [];
    });
    for (const group of this.shapes) {
      const [mesh] = group.children;
      Object.assign(mesh, { castShadow: false, receiveShadow: false, renderOrder: 2 });
      Object.assign(mesh.material, IN_FRONT);
    }
    this.colours = [0x56b4e9, 0xd55e00].map((value) => this.colour(value));
    this.look(1);
  }

  /** Show a configuration, and pairs [first, second, point] that touch. */
  show(configuration, pairs, withShapes) {
    this.arm.show(configuration);
    const touching = new Set(pairs.flatMap(([first, second]) => [first, second]));
    this.shapes.forEach((group, number) => {
      group.visible = withShapes || touching.has(number);
      group.children[0].material.color.copy(this.colours[touching.has(number) ? 1 : 0]);
    });
    this.glow([...touching].filter((number) => number < this.shapes.length).map((number) => this.data.bodies[number].joint));
    this.flashAt(pairs[0]?.[2]);
    this.viewer.set_dirty();
  }

  get toolPosition() {
    return this.pose("tool").slice(12, 15);
  }
}

/* ---------- sliders, card and keys ---------- */

class ArmControls extends Controls {
  constructor(stage, data) {
    super(stage, data);
    this.contact = new ContactTest(data);
    this.withShapes = false;
    this.sliders = data.joints.map((name, k) => this.slider(name, k));
    element("name").textContent = data.arm;
    element("eyebrow").textContent = `${count(data.joints.length, "joint")} · reach at most ${data.reach.toFixed(2)} m`;
    this.connect();
    this.preferTheme();
    this.set(data.home);
  }

  slider(name, k) {
    const { lower, upper, axes } = this.data;
    const input = make("input", { type: "range", min: lower[k], max: upper[k], step: "any", "aria-label": name });
    const output = make("output");
    const label = make("label");
    label.append(make("span", { class: "joint", title: name }, name), output, input);
    const row = make("li");
    row.append(label);
    element("joints").append(row);
    input.addEventListener("input", () => this.move(k, Number(input.value)));
    return { input, output, row, text: (value) => (axes[k].slides ? metres(value) : `${fixed(value / TURN, 1)}°`) };
  }

  /** Move one joint, as far as its limits allow. */
  move(k, value) {
    this.set(this.configuration.map((old, axis) => (axis === k ? value : old)));
  }

  /** Move all joints, as far as their limits allow [rad or m]. */
  set(configuration) {
    const { lower, upper } = this.data;
    this.configuration = configuration.map((value, k) => Math.min(Math.max(value, lower[k]), upper[k]));
    this.pairs = this.contact.at(this.configuration);
    this.stage.show(this.configuration, this.pairs, this.withShapes);
    this.sliders.forEach(({ input, output, text }, k) => {
      const value = this.configuration[k];
      input.value = value;
      output.textContent = text(value);
      input.setAttribute("aria-valuetext", text(value));
    });
    ["x", "y", "z"].forEach((axis, k) => { element(`tool-${axis}`).textContent = metres(this.stage.toolPosition[k]); });
    this.tell();
  }

  get touching() {
    return this.pairs.map(([first, second]) => [first, second].map((number) => this.data.bodies[number].name));
  }

  /** Say what touches. */
  tell() {
    const names = this.touching.map((pair) => pair.join(" touches "));
    const more = names.length - MOST_NAMED;
    const shown = more > 0 ? [...names.slice(0, MOST_NAMED), `and ${count(more, "other pair")}`] : names;
    element("verdict").replaceChildren(names.length ? badge("collision", ...BADGES.collision) : badge("free", ...BADGES.free));
    element("touching").replaceChildren(...shown.map((text) => make("li", {}, text)));
    const spoken = names[0] || "Nothing touches";
    if (element("spoken").textContent !== spoken) {
      element("spoken").textContent = spoken;
    }
  }

  showShapes(shown) {
    this.withShapes = shown;
    element("shapes").setAttribute("aria-pressed", String(shown));
    this.stage.show(this.configuration, this.pairs, shown);
  }

  get actions() {
    return {
      home: () => this.set(this.data.home),
      shapes: () => this.showShapes(!this.withShapes),
    };
  }

  owns() {
    return false; // the page moves sliders itself
  }

  get keys() {
    const { actions } = this;
    const chosen = this.sliders.findIndex(({ input }) => input === document.activeElement);
    const choose = (k) => this.sliders[Math.min(Math.max(k, 0), this.sliders.length - 1)].input.focus();
    const step = (way) => (event) => {
      const k = Math.max(chosen, 0);
      choose(k);
      this.move(k, this.configuration[k] + way * (this.data.axes[k].slides ? 0.005 : TURN) * (event.shiftKey ? 10 : 1));
    };
    return {
      ArrowUp: () => choose(chosen - 1),
      ArrowDown: () => choose(chosen + 1),
      ArrowLeft: step(-1),
      ArrowRight: step(1),
      h: actions.home,
      c: actions.shapes,
      r: this.resetView,
    };
  }

  get state() {
    return {
      configuration: this.configuration, tool: this.stage.toolPosition, touching: this.touching,
      shapes: this.withShapes, theme: this.theme,
    };
  }
}

start((viewer, data) => {
  const stage = new ArmStage(viewer, data);
  const controls = new ArmControls(stage, data);
  window.kinarm = {
    set: (configuration) => controls.set(configuration),
    contacts: (configuration) => controls.contact.at(configuration),
    lookFrom: (eye, target) => stage.lookFrom(eye, target),
    pose: (name) => stage.pose(name),
    census: () => stage.census(),
    get state() { return controls.state; },
  };
});

"use strict";

const element = (id) => document.getElementById(id);
const fixed = (value, digits) => (Math.round(value * 10 ** digits) / 10 ** digits + 0).toFixed(digits); // no "-0.0"
const metres = (value) => `${fixed(value, 3)} m`;
const count = (number, noun) => `${number} ${noun}${number === 1 ? "" : "s"}`;

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

/* ---------- elements ---------- */

function make(tag, attributes = {}, text = "") {
  const svg = ["path", "line", "svg"].includes(tag);
  const node = svg ? document.createElementNS("http://www.w3.org/2000/svg", tag) : document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    node.setAttribute(name, value);
  }
  node.append(text);
  return node;
}

/** A label with an icon. */
function badge(kind, words, shape) {
  const node = make("span", { class: `badge ${kind}` });
  const icon = make("svg", { viewBox: "0 0 24 24", "aria-hidden": "true" });
  icon.append(make("path", { d: shape }));
  node.append(icon, words);
  return node;
}

const BADGES = {
  success: ["Reached", "m5 12.5 4.5 4.5L19 7.5"],
  collision: ["Contact", "M6 6l12 12M18 6 6 18"],
  truncated: ["Truncated", "M12 6v6.5l4 2.5M12 3a9 9 0 1 0 .01 0"],
  moving: ["Moving", "M5 12h14M13 6l6 6-6 6"],
};

function toggleKeys() {
  element("keys").hidden = !element("keys").hidden;
  element("help").setAttribute("aria-expanded", String(!element("keys").hidden));
}

/** What buttons and keys of a page do; pages have their own `actions` and `keys`. */
class Controls {
  constructor(stage, data) {
    Object.assign(this, { stage, data, playing: false });
    this.calm = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.toggleTheme = () => this.setTheme(this.theme === "dark" ? "light" : "dark");
    this.resetView = () => stage.look(stage.side);
  }

  setPlaying(playing) {
    this.playing = playing;
    document.body.classList.toggle("playing", playing);
    element("play").setAttribute("aria-label", playing ? "Pause" : "Play");
  }

  /** Call `elapse` before every frame, with the seconds since the last one. */
  run() {
    let before = null;
    const tick = (now) => {
      this.elapse(Math.min((now - (before ?? now)) / 1000, 0.1), now);
      before = now;
      if (this.stage.flash.visible && !this.calm) {
        this.stage.pulse(now / 1000);
      }
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  setTheme(name) {
    this.theme = name;
    document.documentElement.dataset.theme = name;
    this.stage.theme(name);
  }

  preferTheme() {
    this.setTheme(window.matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
  }

  /** Connect buttons, by their ids, with the page's actions, and keys. */
  connect() {
    const actions = { theme: this.toggleTheme, view: this.resetView, help: toggleKeys };
    for (const [id, action] of Object.entries({ ...actions, ...this.actions })) {
      element(id).addEventListener("click", action);
    }
    document.addEventListener("keydown", (event) => this.press(event));
  }

  /** Whether what has the focus takes a key for itself. */
  owns({ tagName }, key) {
    const presses = key === " " || key === "Enter";
    return { SELECT: true, INPUT: key !== " " && key.length > 1, BUTTON: presses, SUMMARY: presses }[tagName] ?? false;
  }

  press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || this.owns(event.target, event.key)) {
      return;
    }
    const keys = { t: this.toggleTheme, "?": toggleKeys, ...this.keys };
    const action = keys[event.key.length > 1 ? event.key : event.key.toLowerCase()];
    if (action) {
      event.preventDefault();
      action(event);
    }
  }
}

/** Show the page that a function makes of the viewer and the data, or say why there is none. */
async function start(make) {
  try {
    const data = JSON.parse(new TextDecoder().decode(await inflated("data-page")));
    const viewer = await startViewer();
    element("card").hidden = element("dock").hidden = false;
    make(viewer, data);
    viewer.set_3d_pane_size();
    element("message").hidden = true;
    document.body.dataset.ready = "";
  } catch (error) {
    element("card").hidden = element("dock").hidden = true;
    element("message").textContent = `This browser cannot show the page, which needs WebGL and gzip streams: ${error.message}`;
    throw error;
  }
}

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

function toggleKeys() {
  element("keys").hidden = !element("keys").hidden;
  element("help").setAttribute("aria-expanded", String(!element("keys").hidden));
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
    element("message").textContent = `This browser cannot show the page, which needs WebGL and gzip streams: ${error.message}`;
    throw error;
  }
}

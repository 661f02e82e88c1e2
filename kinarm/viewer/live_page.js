"use strict";

const viewer = new MeshCat.Viewer(document.getElementById("stage"));

/** Show what the server sends: commands without end, each led by its length. */
async function follow() {
  const reader = (await fetch("scene")).body.getReader();
  let rest = new Uint8Array();
  for (;;) {
    const { done, value } = await reader.read();
    if (done) {
      return;
    }
    const bytes = new Uint8Array(rest.length + value.length);
    bytes.set(rest);
    bytes.set(value, rest.length);
    const view = new DataView(bytes.buffer);
    let at = 0;
    while (at + 4 <= bytes.length && at + 4 + view.getUint32(at, true) <= bytes.length) {
      const length = view.getUint32(at, true);
      viewer.handle_command_bytearray(bytes.slice(at + 4, at + 4 + length));
      at += 4 + length;
    }
    rest = bytes.subarray(at);
  }
}

follow().catch(console.info).then(() => {
  document.title = "kinarm, no longer live";
});

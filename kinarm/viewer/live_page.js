"use strict";

const viewer = new MeshCat.Viewer(document.getElementById("stage"));

/** Show what the server has to tell: a number to ask with next, and commands, each led by its length. */
async function follow() {
  for (let since = 0; ;) {
    const bytes = new Uint8Array(await (await fetch(`scene?${since}`)).arrayBuffer());
    const view = new DataView(bytes.buffer);
    since = view.getUint32(0, true);
    for (let at = 4; at < bytes.length;) {
      const end = at + 4 + view.getUint32(at, true);
      viewer.handle_command_bytearray(bytes.slice(at + 4, end));
      at = end;
    }
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
}

follow().catch((reason) => {
  console.info(reason);
  document.title = "kinarm, no longer live";
});

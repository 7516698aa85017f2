// The page's half of the web host: passes each call to the engine's module, and posts what that returns.
import * as engine from "./draw.js";

const canvas = document.createElement("canvas");
document.body.append(canvas);

const handlers = {
  async open({ width, height }) {
    Object.assign(canvas, { width, height });
    const version = await engine.open({ canvas, width, height });
    const gl = canvas.getContext("webgl2");
    const { UNMASKED_RENDERER_WEBGL } = gl.getExtension("WEBGL_debug_renderer_info");
    return [{ version, renderer: gl.getParameter(UNMASKED_RENDERER_WEBGL) }];
  },
  async load(view, glb) {
    await engine.load({ glb, view });
    return [{}];
  },
  async draw(argument) {
    await engine.draw(argument);
    return [{ shape: [canvas.height, canvas.width, 4], type: "uint8" }, pixels()];
  },
};

// RGBA of what the canvas shows, row 0 at the top.
function pixels() {
  const gl = canvas.getContext("webgl2");
  const { width, height } = canvas;
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  const drawn = new Uint8Array(4 * width * height);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, drawn);
  const rows = Array.from({ length: height }, (_, row) => drawn.subarray(4 * width * row, 4 * width * (row + 1)));
  return new Blob(rows.reverse());
}

function pack(header, data) {
  const text = new TextEncoder().encode(JSON.stringify(header));
  return new Blob([new Uint32Array([text.length]), text, data]);
}

for (;;) {
  const message = await (await fetch("call")).arrayBuffer();
  const [length] = new Uint32Array(message, 0, 1);
  const { name, argument } = JSON.parse(new TextDecoder().decode(new Uint8Array(message, 4, length)));
  let answer;
  try {
    answer = await handlers[name](argument, message.slice(4 + length));
  } catch (error) {
    answer = [{ error: String(error.stack ?? error).split("\n").slice(0, 2).join(" ") }];
  }
  await fetch("answer", { method: "POST", body: pack(answer[0], answer[1] ?? "") });
}

// Plays the frame at `/frame/` and posts its picture: four floats for each pixel, rows from the top.

import { Player } from "./player.js";

const post = (what, body) => fetch(`/post/${what}`, { method: "POST", body });

try {
    const gl = document.createElement("canvas").getContext("webgl2");
    if (!gl) throw new Error("the page has no WebGL 2");
    const player = await Player.open(gl, "/frame");
    player.run();
    await post("picture", player.picture());
    await post("done");
} catch (e) {
    await post("failed", e?.stack || String(e));
}

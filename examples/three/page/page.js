// Draws the scene by WebGPU and by WebGL 2, and posts what it draws.

import { FloatType, RenderTarget, WebGPURenderer, setConsoleFunction } from "three/webgpu";

import { SIZE, makeScene } from "./scene.js";
import { withMoments } from "./shadows.js";

const post = (what, body) => fetch(`/post/${what}`, { method: "POST", body });

// What three.js complains of is an error here.
const complaints = [];
setConsoleFunction((kind, message, ...more) => {
    if (kind === "warn" || kind === "error") complaints.push([message, ...more].join(" "));
});

/** Four floats for each pixel of the picture, and one for its shadow, from 0 to 1. */
async function draw(forceWebGL) {
    const renderer = new WebGPURenderer({ forceWebGL });
    await renderer.init();
    if (forceWebGL !== Boolean(renderer.backend.isWebGLBackend)) throw new Error("the page has no WebGPU");
    renderer.shadowMap.enabled = true;
    const { scene, camera, ambient, light } = makeScene();
    const drawMap = withMoments(renderer, scene, light);
    const target = new RenderTarget(...SIZE, { type: FloatType });
    const [width, height] = SIZE;
    const read = async () => {
        drawMap();
        renderer.setRenderTarget(target);
        renderer.render(scene, camera);
        const floats = await renderer.readRenderTargetPixelsAsync(target, 0, 0, width, height);
        if (!forceWebGL) return floats;
        // WebGL has the lowest row first.
        const rows = Array.from({ length: height }, (_, y) => floats.slice(4 * width * y, 4 * width * (y + 1)));
        const turned = new Float32Array(floats.length);
        rows.reverse().forEach((row, y) => turned.set(row, 4 * width * y));
        return turned;
    };
    const picture = await read();
    // How much of the light is missing.
    ambient.intensity = 0;
    scene.background.setRGB(0, 0, 0);
    const lit = await read();
    light.shadow.intensity = 0;
    const whole = await read();
    const shadows = new Float32Array(width * height);
    shadows.forEach((_, i) => {
        shadows[i] = whole[4 * i] > 0 ? 1 - lit[4 * i] / whole[4 * i] : 0;
    });
    if (complaints.length > 0) throw new Error(complaints.join("\n"));
    return new Blob([picture, shadows]);
}

try {
    for (const [name, forceWebGL] of [["webgpu", false], ["webgl", true]]) {
        await post(name, await draw(forceWebGL));
    }
    await post("done");
} catch (e) {
    await post("failed", [e?.stack || String(e), ...complaints].join("\n"));
}

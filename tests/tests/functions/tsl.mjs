// What three.js makes of the functions of modules in TSL:
//
//     node tsl.mjs MODULE...
//
// Gives as JSON, for each function that takes scalars and vectors, by its name in the shader, its text and
// that of all that it calls: in WGSL as for three.js' WebGPU renderer, and in GLSL ES 3.00 as for WebGL 2. A
// warning of three.js is an error here.

import { pathToFileURL } from "node:url";
import { Mesh, NodeMaterial, WebGPURenderer, setConsoleFunction } from "three/webgpu";

setConsoleFunction((kind, message, ...more) => {
    if (kind === "warn" || kind === "error") throw new Error([message, ...more].join(" "));
});

/** Stands where a page has a canvas: nothing is drawn. */
const canvas = { style: {}, addEventListener() {}, removeEventListener() {} };

/** The text of a function, after what it calls. */
function text(renderer, shader) {
    const builder = renderer.backend.createNodeBuilder(new Mesh(undefined, new NodeMaterial()), renderer);
    builder.setShaderStage("vertex");
    const seen = new Set();
    const functions = [];
    const visit = (node) => {
        if (seen.has(node)) return;
        seen.add(node);
        if (node.isStructTypeNode) node.getNodeType(builder);
        node.includes?.forEach(visit);
        if (node.code) functions.push(node.code);
    };
    visit(builder.buildFunctionNode(shader));
    return [builder.getStructs("vertex"), ...functions].join("\n");
}

const modules = await Promise.all(process.argv.slice(2).map((path) => import(pathToFileURL(path))));
const texts = {};
for (const [language, forceWebGL] of [["wgsl", false], ["glsl", true]]) {
    const renderer = new WebGPURenderer({ canvas, forceWebGL });
    for (const { shaderNode } of modules.flatMap(Object.values)) {
        if (!shaderNode?.layout?.inputs.every(({ type }) => /^([iub]?vec\d|float|u?int|bool)$/.test(type))) continue;
        (texts[shaderNode.layout.name] ??= {})[language] = text(renderer, shaderNode);
    }
}
process.stdout.write(JSON.stringify(texts));

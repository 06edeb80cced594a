// node --expose-gc case.mjs FOLDER [keep], where FOLDER is the node_modules with `webgpu`.

const [folder, keep] = process.argv.slice(2);
const { create, globals } = await import(`${folder}/webgpu/index.js`);
Object.assign(globalThis, globals);

async function open() {
    const gpu = create([]);
    if (keep) globalThis.gpu = gpu;
    const adapter = await gpu.requestAdapter();
    return adapter.requestDevice();
}

const device = await open();
for (let i = 0; i < 3; i += 1) {
    gc();
    await new Promise((resolve) => setTimeout(resolve, 20));
}
const usage = GPUBufferUsage.COPY_DST | GPUBufferUsage.MAP_READ;
const buffer = device.createBuffer({ size: 4, usage });
await buffer.mapAsync(GPUMapMode.READ);
console.log("mapped");
process.exit(0);

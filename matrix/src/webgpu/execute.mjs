// Runs a job on a WebGPU device: the same in Node and in a page. The protocol is in `job.rs`.

import { WIDTH, captured, filling, points, taken, typeName } from "./wgsl.mjs";

/** Bytes of a texel of a format, of which the name says channels and their bits: `rg16float`. */
function texelBytes(format) {
    if (/^rgb10a2|^rg11b10/.test(format)) return 4;
    const [, channels, bits] = /^(rgba|rg|r|depth)(\d+)/.exec(format);
    return { r: 1, rg: 2, rgba: 4, depth: 1 }[channels] * bits / 8;
}

/** The levels of a texture's argument: texels along each axis, and where its bytes lie. */
function levelsOf({ format, size, levels, layers, samples }) {
    let offset = 0;
    return Array.from({ length: levels }, (_, level) => {
        const own = size.map((n) => Math.max(n >> level, 1));
        const length = own[0] * own[1] * own[2] * layers * samples * texelBytes(format);
        offset += length;
        return { size: own, offset: offset - length, length };
    });
}

/** Rows of a texture begin at multiples of this in a buffer that they are copied to. */
const ALIGNMENT = 256;

/** Features that some kernel needs; those that the adapter has are asked for. */
/** The feature that adds formats of 16-bit normalised numbers, and storage of small ones. */
const TIER = "texture-formats-tier1";

/** The feature of operations of subgroups. */
const SUBGROUPS = "subgroups";

/** Extensions of WGSL, each with the feature that it needs. */
const EXTENSIONS = {
    f16: "shader-f16",
    subgroups: SUBGROUPS,
    primitive_index: "primitive-index",
    clip_distances: "clip-distances",
    dual_source_blending: "dual-source-blending",
};

const FEATURES = ["float32-filterable", "float32-blendable", TIER, ...Object.values(EXTENSIONS)];

/** What is there, multiplied by the second source. */
const SECOND_SOURCE = {
    color: { srcFactor: "zero", dstFactor: "src1" },
    alpha: { srcFactor: "zero", dstFactor: "src1-alpha" },
};

const FILTERS = ["validation", "out-of-memory", "internal"];

/** What a device reported outside of every error scope. */
const uncaptured = new WeakMap();

const up = (n, step) => Math.ceil(n / step) * step;

/** A device with all the limits of its adapter, and what both are, in words. */
export async function open(gpu) {
    const adapter = await gpu.requestAdapter();
    if (!adapter) throw new Error("there is no WebGPU adapter");
    const requiredLimits = {};
    for (const name in adapter.limits) {
        if (typeof adapter.limits[name] === "number") requiredLimits[name] = adapter.limits[name];
    }
    const requiredFeatures = FEATURES.filter((f) => adapter.features.has(f));
    const device = await adapter.requestDevice({ requiredFeatures, requiredLimits });
    const errors = [];
    uncaptured.set(device, errors);
    device.addEventListener("uncapturederror", (e) => errors.push(e.error.message));
    const { vendor, architecture, device: chip, description } = adapter.info;
    const lacking = FEATURES.filter((f) => !adapter.features.has(f));
    const about = [vendor, architecture, chip, description].filter(Boolean).join(" ") +
        lacking.map((f) => `, without ${f}`).join("");
    return { device, about };
}

/**
 * The results of all cases of `job`, one after the other.
 *
 * Throws an `Error` with the implementation's words for whatever it refuses.
 */
export async function execute(device, job, code, inputs) {
    const held = [];
    const lost = device.lost.then(({ reason, message }) => {
        throw new Error(`the device was lost (${reason}): ${message}`);
    });
    try {
        const results = await Promise.race([lost, run(device, job, code, inputs, held)]);
        const errors = uncaptured.get(device)?.splice(0) ?? [];
        if (errors.length > 0) throw new Error(errors.join("\n"));
        return results;
    } finally {
        for (const resource of held) resource.destroy();
    }
}

async function run(device, job, code, inputs, held) {
    for (const [extension, feature] of Object.entries(EXTENSIONS)) {
        if (code.includes(`\nenable ${extension};`) && !device.features.has(feature)) {
            throw new Error(`the device lacks ${feature}`);
        }
    }
    const maker = new Maker(device, job, code, inputs, held);
    const cases = [];
    for (const one of job.cases) cases.push(await maker.prepare(one));
    // Nothing is awaited in here: the scopes of two jobs must not get mixed up.
    const staging = await scoped(device, () => {
        const encoder = device.createCommandEncoder();
        const reads = cases.flatMap((one) => one.encode(encoder));
        let size = 0;
        for (const read of reads) {
            read.offset = size;
            size = up(size + read.pitch * read.rows, ALIGNMENT);
        }
        const buffer = device.createBuffer({
            size: Math.max(size, 4),
            usage: GPUBufferUsage.COPY_DST | GPUBufferUsage.MAP_READ,
        });
        held.push(buffer);
        for (const read of reads) read.copy(encoder, buffer);
        device.queue.submit([encoder.finish()]);
        return { buffer, reads };
    });
    await staging.buffer.mapAsync(GPUMapMode.READ);
    const bytes = new Uint8Array(staging.buffer.getMappedRange());
    const length = staging.reads.reduce((n, r) => n + r.length, 0);
    const results = new Uint8Array(length);
    let at = 0;
    for (const read of staging.reads) {
        unpack(bytes, read, results.subarray(at, at + read.length));
        at += read.length;
    }
    staging.buffer.unmap();
    return results;
}

/** Does `work`, which must not wait, and throws what the device reports about it. */
async function scoped(device, work) {
    for (const filter of FILTERS) device.pushErrorScope(filter);
    let result, thrown;
    try {
        result = work();
    } catch (e) {
        thrown = e;
    }
    const errors = await Promise.all(FILTERS.map(() => device.popErrorScope()));
    const words = errors.filter(Boolean).map((e) => e.message);
    if (thrown) words.unshift(`${thrown.name}: ${thrown.message}`);
    if (words.length > 0) throw new Error(words.join("\n"));
    return result;
}

/** Takes the rows of a read, and of each texel what counts, out of the staging buffer. */
function unpack(bytes, { offset, pitch, rowBytes, texel, take }, results) {
    const row = (rowBytes / texel) * take;
    for (let at = 0, y = 0; at < results.length; at += row, y += 1) {
        const from = offset + y * pitch;
        if (take === texel) {
            const count = Math.min(row, results.length - at);
            results.set(bytes.subarray(from, from + count), at);
            continue;
        }
        for (let x = 0; x < row / take && at + x * take < results.length; x += 1) {
            results.set(bytes.subarray(from + x * texel, from + x * texel + take), at + x * take);
        }
    }
}

/** Reads a buffer's first bytes. */
const readBuffer = (buffer, length) => ({
    pitch: up(length, 4), rows: 1, rowBytes: length, texel: 1, take: 1, length,
    copy(encoder, to) {
        if (length > 0) encoder.copyBufferToBuffer(buffer, 0, to, this.offset, this.pitch);
    },
});

/** Reads `length` bytes of a texture, of each texel the first `take`. */
function readTexture(texture, length, take) {
    const texel = texelBytes(texture.format);
    const size = [texture.width, texture.height, texture.depthOrArrayLayers];
    const rowBytes = size[0] * texel;
    const pitch = up(rowBytes, ALIGNMENT);
    return {
        pitch, rows: size[1] * size[2], rowBytes, texel, take: take ?? texel, length,
        copy(encoder, to) {
            const layout = { buffer: to, offset: this.offset, bytesPerRow: pitch, rowsPerImage: size[1] };
            encoder.copyTextureToBuffer({ texture }, layout, size);
        },
    };
}

/** Format of a colour target that holds a value whole. */
function targetFormat(value) {
    const channels = { 1: "r", 2: "rg", 4: "rgba" }[value.size];
    if (!channels) throw new Error(`no target format holds ${typeName(value)}`);
    return `${channels}32${{ f32: "float", u32: "uint", i32: "sint" }[value.scalar]}`;
}

/** Numbers of targets, in groups that one pass may write. */
function groupsOf(formats, limits) {
    const groups = [];
    let bytes = Infinity;
    formats.forEach((format, i) => {
        const more = texelBytes(format);
        const last = groups.at(-1);
        if (!last || last.length >= limits.maxColorAttachments ||
            bytes + more > limits.maxColorAttachmentBytesPerSample) {
            groups.push([i]);
            bytes = more;
        } else {
            last.push(i);
            bytes += more;
        }
    });
    return groups;
}

/** Makes what the cases of a job need. */
class Maker {
    constructor(device, job, code, inputs, held) {
        Object.assign(this, { device, job, code, inputs, held });
        this.kept = new Map();
    }

    /** What `make` gives, made once for each key. */
    once(key, make) {
        if (!this.kept.has(key)) this.kept.set(key, make());
        return this.kept.get(key);
    }

    /** A shader module; throws the messages of the compiler, each with its line. */
    module(text) {
        return this.once(text, async () => {
            let module;
            const refusal = await scoped(this.device, () => {
                module = this.device.createShaderModule({ code: text });
            }).catch((e) => e);
            const { messages } = (await module?.getCompilationInfo()) ?? { messages: [] };
            const lines = text.split("\n");
            const words = messages.filter((m) => m.type === "error").map((m) => {
                const line = m.lineNum > 0 ? `\n  ${lines[m.lineNum - 1]?.trim()}` : "";
                return `WGSL line ${m.lineNum}:${m.linePos}: ${m.message}${line}`;
            });
            if (words.length > 0) throw new Error(words.join("\n"));
            if (refusal) throw refusal;
            return module;
        });
    }

    bytes({ offset, length }) {
        if (offset + length > this.inputs.byteLength) {
            throw new Error(`the inputs end before byte ${offset + length}`);
        }
        return new Uint8Array(this.inputs, offset, length);
    }

    buffer(bytes, usage, size = Math.max(up(bytes.length, 4), 4)) {
        const buffer = this.device.createBuffer({ size, usage, mappedAtCreation: true });
        this.held.push(buffer);
        new Uint8Array(buffer.getMappedRange()).set(bytes);
        buffer.unmap();
        return buffer;
    }

    texture(format, size, usage, options = {}) {
        const texture = this.device.createTexture({ format, size, usage, ...options });
        this.held.push(texture);
        return texture;
    }

    /** Slots of the bind group, each with its argument. */
    bound(one) {
        return this.job.slots.flatMap((slot, i) => {
            const binding = slot.place?.index;
            return slot.binding == null || binding == null ? [] : [{ slot, binding, arg: one.args[i], i }];
        });
    }

    /** The bytes of push constants; none without. */
    immediates(one) {
        const i = this.job.slots.findIndex((slot) => slot.place?.class === "immediate");
        if (i < 0) return null;
        const bytes = this.bytes(one.args[i]);
        // WebGPU's name of the limit, and of how much a pipeline takes of it.
        if (!(this.device.limits.maxImmediateSize >= bytes.length)) {
            throw new Error("the device lacks immediates");
        }
        return bytes;
    }

    /** Slots of some role, each with its argument. */
    having(kind, one) {
        return this.job.slots.flatMap(({ role }, i) =>
            role.kind === kind ? [{ ...role, arg: one.args[i], i }] : []);
    }

    /** The pipeline of a case, and what encodes it: gives the reads back. */
    prepare(one) {
        if (one.args.length !== this.job.slots.length) {
            throw new Error(`${one.args.length} arguments for ${this.job.slots.length} slots`);
        }
        const kind = this.job.stage.kind;
        if (kind === "compute") return this.compute(one);
        if (kind === "fragment") return this.fragment(one);
        if (kind === "vertex") return this.vertex(one);
        throw new Error(`there is no stage \`${kind}\``);
    }

    /** The explicit layout of group 0, from the slots. */
    async layout(one) {
        const visibility = GPUShaderStage[this.job.stage.kind.toUpperCase()];
        const filtersTexels = (a) => [a.magnify, a.minify, a.mip].includes("linear");
        const isFiltered = one.args.some((a) => a.kind === "sampler" && filtersTexels(a));
        const filters = (format) =>
            format.includes("32float") ? this.device.features.has("float32-filterable") : true;
        const entries = this.bound(one).map(({ slot: { name, role }, binding, arg }) => {
            const entry = { binding, visibility };
            switch (role.kind) {
                case "uniform":
                    return { ...entry, buffer: { type: "uniform" } };
                case "read":
                    return { ...entry, buffer: { type: "read-only-storage" } };
                case "atomic":
                case "write":
                    return { ...entry, buffer: { type: "storage" } };
                case "texture": {
                    const integer = /[us]int$/.exec(arg.format)?.[0];
                    const isFine = isFiltered && arg.samples === 1 && filters(arg.format) &&
                        arg.format !== "depth32float";
                    const float = isFine ? "float" : "unfilterable-float";
                    return { ...entry, texture: {
                        sampleType: role.depth ? "depth" : integer ?? float,
                        viewDimension: role.view,
                        multisampled: role.multisampled,
                    } };
                }
                case "sampler":
                    return { ...entry, sampler: {
                        type: arg.compare ? "comparison" : filtersTexels(arg) ? "filtering" : "non-filtering",
                    } };
                case "storage_texture":
                    // Core WebGPU stores neither 16-bit normalised numbers nor small texels.
                    if (/16[su]norm$|^rg?(8|16)|^rgb10a2|^rg11b10/.test(role.format) && !this.device.features.has(TIER)) {
                        throw new Error(`the device lacks ${TIER}`);
                    }
                    return { ...entry, storageTexture: {
                        access: role.access,
                        format: role.format,
                        viewDimension: role.view,
                    } };
                default:
                    throw new Error(`slot \`${name}\` is bound, and a ${role.kind}`);
            }
        });
        const immediateSize = this.immediates(one)?.length ?? 0;
        const key = JSON.stringify(entries);
        return this.once(key, () => scoped(this.device, () => {
            const group = this.device.createBindGroupLayout({ entries });
            const pipeline = this.device.createPipelineLayout({ bindGroupLayouts: [group], immediateSize });
            return { key, group, pipeline };
        }));
    }

    /** Fills a texture that nothing can be copied to: several samples, or depth. */
    async filler(arg) {
        const { format, samples } = arg;
        const isDepth = format === "depth32float";
        const texel = texelBytes(format);
        if (!texel) throw new Error(`format \`${format}\` is not known`);
        if (isDepth && new Float32Array(this.bytes(arg).slice().buffer).some((d) => !(d >= 0 && d <= 1))) {
            throw new Error("a depth texture cannot be given depths beyond 0 and 1");
        }
        // One for each level: its width is part of the text.
        return Promise.all(levelsOf(arg).map(async ({ size }) => {
            const module = await this.module(filling(format, size[0], samples, texel / 4));
            return this.once(JSON.stringify([format, samples, size[0]]), () =>
                this.device.createRenderPipelineAsync({
                    layout: "auto",
                    vertex: { module, entryPoint: "hankel_cover" },
                    fragment: { module, entryPoint: "hankel_fill", targets: isDepth ? [] : [{ format }] },
                    depthStencil: isDepth
                        ? { format, depthWriteEnabled: true, depthCompare: "always" }
                        : undefined,
                    multisample: { count: samples },
                }));
        }));
    }

    /** Fills a layer of a level. */
    fill(encoder, texture, pipeline, bytes, baseMipLevel, baseArrayLayer) {
        const view = texture.createView({
            dimension: "2d", baseMipLevel, baseArrayLayer, mipLevelCount: 1, arrayLayerCount: 1,
        });
        const isDepth = texture.format === "depth32float";
        const pass = encoder.beginRenderPass({
            colorAttachments: isDepth ? [] : [{ view, loadOp: "clear", storeOp: "store" }],
            depthStencilAttachment: isDepth
                ? { view, depthClearValue: 0, depthLoadOp: "clear", depthStoreOp: "store" }
                : undefined,
        });
        pass.setPipeline(pipeline);
        pass.setBindGroup(0, this.device.createBindGroup({
            layout: pipeline.getBindGroupLayout(0),
            entries: [{ binding: 0, resource: { buffer: this.buffer(bytes, GPUBufferUsage.STORAGE) } }],
        }));
        pass.draw(3);
        pass.end();
    }

    /** Pipelines that fill the textures of a case, by slot. */
    async fillers(one) {
        const fillers = new Map();
        for (const { slot, arg, i } of this.bound(one)) {
            if (slot.role.kind === "texture" && (arg.samples > 1 || arg.format === "depth32float")) {
                fillers.set(i, await this.filler(arg));
            }
        }
        return fillers;
    }

    /** The bind group of a case, and a read for each slot in it that is written. */
    bind(encoder, one, { group }, fillers) {
        const reads = new Map();
        const entries = this.bound(one).map(({ slot: { role }, binding, arg, i }) => {
            if (role.kind === "sampler") {
                const [addressModeU, addressModeV, addressModeW] = arg.address;
                return { binding, resource: this.device.createSampler({
                    magFilter: arg.magnify, minFilter: arg.minify, mipmapFilter: arg.mip,
                    addressModeU, addressModeV, addressModeW,
                    maxAnisotropy: arg.anisotropy,
                    ...(arg.compare ? { compare: arg.compare } : {}),
                }) };
            }
            const bytes = this.bytes(arg);
            if (role.kind === "texture" || role.kind === "storage_texture") {
                const { format, dimensions, size, samples, levels, layers } = arg;
                const texel = texelBytes(format);
                if (!texel) throw new Error(`format \`${format}\` is not known`);
                const isStored = role.kind === "storage_texture";
                const isWritten = isStored && role.access !== "read-only";
                const filler = fillers.get(i);
                const usage = (isStored
                    ? GPUTextureUsage.STORAGE_BINDING | GPUTextureUsage.COPY_SRC
                    : GPUTextureUsage.TEXTURE_BINDING) |
                    (filler ? GPUTextureUsage.RENDER_ATTACHMENT : GPUTextureUsage.COPY_DST);
                const texture = this.texture(format, [size[0], size[1], size[2] * layers], usage, {
                    dimension: `${dimensions}d`, sampleCount: samples, mipLevelCount: levels,
                });
                levelsOf(arg).forEach(({ size: [width, height, depth], offset, length }, mipLevel) => {
                    const own = bytes.subarray(offset, offset + length);
                    if (!filler) {
                        const rows = { bytesPerRow: width * texel, rowsPerImage: height };
                        const all = [width, height, depth * layers];
                        this.device.queue.writeTexture({ texture, mipLevel }, own, rows, all);
                        return;
                    }
                    const each = length / layers;
                    for (let layer = 0; layer < layers; layer += 1) {
                        const of = own.subarray(layer * each, (layer + 1) * each);
                        this.fill(encoder, texture, filler[mipLevel], of, mipLevel, layer);
                    }
                });
                if (isWritten) reads.set(i, readTexture(texture, arg.length));
                return { binding, resource: texture.createView({ dimension: role.view }) };
            }
            const isUniform = role.kind === "uniform";
            const usage = isUniform ? GPUBufferUsage.UNIFORM : GPUBufferUsage.STORAGE;
            const size = Math.max(up(bytes.length, isUniform ? 16 : 4), 4);
            const buffer = this.buffer(bytes, usage | GPUBufferUsage.COPY_SRC, size);
            if (role.kind === "write" || role.kind === "atomic") {
                reads.set(i, readBuffer(buffer, arg.length));
            }
            return { binding, resource: { buffer } };
        });
        return { group: this.device.createBindGroup({ layout: group, entries }), reads };
    }

    /** The reads of all written slots, in order. */
    inOrder(reads, one) {
        const written = ["atomic", "write", "storage_texture", "position", "passed",
            "clip_distances", "depth", "target", "second_source"];
        return this.job.slots.flatMap(({ name, role }, i) => {
            if (!written.includes(role.kind) || role.access === "read-only") return [];
            if (reads.has(i)) return [reads.get(i)];
            // The text does not use it: it stays as it was.
            const arg = one.args[i];
            if (arg.kind !== "bytes" && arg.kind !== "texture") {
                throw new Error(`slot \`${name}\` is written, and is given no bytes`);
            }
            return [readBuffer(this.buffer(this.bytes(arg), GPUBufferUsage.COPY_SRC), arg.length)];
        });
    }

    async compute(one) {
        const layout = await this.layout(one);
        const module = await this.module(this.code);
        const fillers = await this.fillers(one);
        const pipeline = await this.once(`pipeline ${layout.key}`, () =>
            this.device.createComputePipelineAsync({
                layout: layout.pipeline,
                compute: { module, entryPoint: this.job.entry_point },
            }));
        const encode = (encoder) => {
            const { group, reads } = this.bind(encoder, one, layout, fillers);
            const pass = encoder.beginComputePass();
            pass.setPipeline(pipeline);
            pass.setBindGroup(0, group);
            const immediates = this.immediates(one);
            if (immediates) pass.setImmediates(0, immediates);
            pass.dispatchWorkgroups(...one.groups);
            pass.end();
            return this.inOrder(reads, one);
        };
        return { encode };
    }

    /** What each point has of its own, one after the other in one buffer. */
    ownValues(own, count) {
        let stride = 0;
        const attributes = own.map(({ location, value: { scalar, size } }) => {
            const type = { f32: "float32", u32: "uint32", i32: "sint32" }[scalar];
            const offset = stride;
            stride += size * 4;
            return { shaderLocation: location, offset, format: size === 1 ? type : `${type}x${size}` };
        });
        if (own.length === 0) return { buffers: [], bytes: null };
        const bytes = new Uint8Array(stride * count);
        own.forEach(({ arg, value: { size } }, n) => {
            const from = this.bytes(arg);
            const width = size * 4;
            if (from.length < width * count) {
                throw new Error(`${count} points need more than ${from.length} bytes`);
            }
            for (let i = 0; i < count; i += 1) {
                const at = i * stride + attributes[n].offset;
                bytes.set(from.subarray(i * width, (i + 1) * width), at);
            }
        });
        return { buffers: [{ arrayStride: stride, attributes }], bytes };
    }

    /**
     * Draws each point of a case into a pixel of its own. `outputs` are the slots that are read,
     * each with its target's format; `fragmentOf` makes the fragment stage of a group of them;
     * `depth` is the slot of the depth that they write, if they do.
     */
    async draw(one, height, own, vertex, outputs, fragmentOf, depth) {
        const limit = this.device.limits.maxTextureDimension2D;
        if (height > limit) throw new Error(`${one.invocations} points need more than ${limit} rows`);
        const layout = await this.layout(one);
        const fillers = await this.fillers(one);
        // A second source is seen by blending, in a pass of its own.
        const apart = outputs.some((o) => o.blend);
        const groups = apart
            ? outputs.map((_, n) => [n])
            : groupsOf(outputs.map((o) => o.format), this.device.limits);
        if (groups.length === 0) groups.push([]);
        if (groups.length > 1 && this.job.slots.some(({ role }) => ["atomic", "write"].includes(role.kind))) {
            throw new Error("its targets need several passes, and it writes buffers");
        }
        const { buffers, bytes } = this.ownValues(own, one.invocations);
        const pipelines = [];
        for (const group of groups) {
            const fragment = await fragmentOf(group);
            const key = `pipeline ${height} ${group} ${layout.key}`;
            pipelines.push(await this.once(key, () => this.device.createRenderPipelineAsync({
                layout: layout.pipeline,
                vertex: { ...vertex, buffers },
                primitive: { topology: "point-list" },
                depthStencil: depth === undefined
                    ? undefined
                    : { format: "depth32float", depthWriteEnabled: true, depthCompare: "always" },
                fragment,
            })));
        }
        const encode = (encoder) => {
            const { group: binds, reads } = this.bind(encoder, one, layout, fillers);
            const values = bytes && this.buffer(bytes, GPUBufferUsage.VERTEX);
            groups.forEach((group, g) => {
                const colours = [];
                for (const n of group) {
                    const { format, i, take, at, blend } = outputs[n];
                    const texture = this.texture(format, [WIDTH, height],
                        GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.COPY_SRC);
                    const all = blend ? 1 : 0;
                    colours[at(group, n)] = {
                        view: texture.createView(),
                        clearValue: [all, all, all, all], loadOp: "clear", storeOp: "store",
                    };
                    reads.set(i, readTexture(texture, one.invocations * take, take));
                }
                let depthStencilAttachment;
                if (depth !== undefined) {
                    const texture = this.texture("depth32float", [WIDTH, height],
                        GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.COPY_SRC);
                    depthStencilAttachment = {
                        view: texture.createView(),
                        depthClearValue: 0, depthLoadOp: "clear", depthStoreOp: "store",
                    };
                    reads.set(depth, readTexture(texture, one.invocations * 4, 4));
                }
                const pass = encoder.beginRenderPass({
                    colorAttachments: Array.from(colours, (c) => c ?? null),
                    depthStencilAttachment,
                });
                pass.setPipeline(pipelines[g]);
                pass.setBindGroup(0, binds);
                const immediates = this.immediates(one);
                if (immediates) pass.setImmediates(0, immediates);
                if (values) pass.setVertexBuffer(0, values);
                pass.draw(one.invocations);
                pass.end();
            });
            return this.inOrder(reads, one);
        };
        return { encode };
    }

    async fragment(one) {
        const height = Math.max(Math.ceil(one.invocations / WIDTH), 1);
        const varyings = this.having("varying", one);
        const module = await this.module(this.code);
        const helper = await this.module(points(this.code, this.job.entry_point, varyings, height));
        const outputs = this.having("target", one).map(({ location, value, i }) => ({
            i, location, format: targetFormat(value), take: value.size * 4, at: () => location,
        }));
        for (const { value, i } of this.having("second_source", one)) {
            outputs.push({
                i, location: 0, format: targetFormat(value), take: value.size * 4, at: () => 0,
                blend: SECOND_SOURCE,
            });
        }
        const vertex = { module: helper, entryPoint: "hankel_points" };
        const depth = this.job.slots.findIndex(({ role }) => role.kind === "depth");
        return this.draw(one, height, varyings, vertex, outputs, (group) => {
            const targets = [];
            for (const n of group) {
                const { location, format, blend } = outputs[n];
                targets[location] = { format, blend };
            }
            const all = Array.from(targets, (t) => t ?? null);
            return { module, entryPoint: this.job.entry_point, targets: all };
        }, depth < 0 ? undefined : depth);
    }

    async vertex(one) {
        const height = Math.max(Math.ceil(one.invocations / WIDTH), 1);
        const position = { scalar: "f32", size: 4 };
        const returned = this.job.slots.flatMap(({ role: { kind, location, value } }, i) =>
            kind === "position" ? [{ value: position, i }]
                : kind === "passed" ? [{ location, value, i }]
                : kind === "clip_distances" ? [{ clips: true, value, i }] : []);
        const text = captured(this.code, this.job.entry_point, returned, height);
        const module = await this.module(text);
        const outputs = returned.map(({ value, i }) => ({
            i, format: "rgba32uint", take: value.size * 4, at: (group, n) => group.indexOf(n),
        }));
        const vertex = { module, entryPoint: "hankel_captured" };
        return this.draw(one, height, this.having("attribute", one), vertex, outputs, async (group) => ({
            module: await this.module(taken(group)),
            entryPoint: "hankel_taken",
            targets: group.map(() => ({ format: "rgba32uint" })),
        }));
    }
}

// Plays a frame with WebGL 2. It knows nothing of Hankel but what `frame.json` says, and needs a frame whose shaders
// are all in GLSL ES 3.00: `multisampling = 1` in the scene, and `--image-passes fragment --target essl300`.
//
// WebGL's clip space has depths from -1 to 1, and its first row is the lowest one. So matrices are changed where they
// are uploaded: what is drawn then stands upside down, its first row is the first one of the frame's textures, and
// window depths are those of the frame.

const GL = WebGL2RenderingContext;

/** Formats by their names in `frame.json`: the internal format, and the extensions that it needs. */
const FORMATS = {
    rgba8unorm: [GL.RGBA8],
    rgba16float: [GL.RGBA16F, "EXT_color_buffer_float"],
    rgba32float: [GL.RGBA32F, "EXT_color_buffer_float", "OES_texture_float_linear"],
    r32float: [GL.R32F, "EXT_color_buffer_float", "OES_texture_float_linear"],
    r32uint: [GL.R32UI],
    rg32uint: [GL.RG32UI],
    rg16float: [GL.RG16F, "EXT_color_buffer_float"],
    rg32float: [GL.RG32F, "EXT_color_buffer_float", "OES_texture_float_linear"],
    // RG16_EXT and RGBA16_EXT
    rg16unorm: [0x822c, "EXT_texture_norm16"],
    rgba16unorm: [0x805b, "EXT_texture_norm16"],
    depth32float: [GL.DEPTH_COMPONENT32F],
};

const COMPARE = {
    never: GL.NEVER,
    less: GL.LESS,
    equal: GL.EQUAL,
    "less-equal": GL.LEQUAL,
    greater: GL.GREATER,
    "not-equal": GL.NOTEQUAL,
    "greater-equal": GL.GEQUAL,
    always: GL.ALWAYS,
};
const WRAP = { "clamp-to-edge": GL.CLAMP_TO_EDGE, repeat: GL.REPEAT, "mirror-repeat": GL.MIRRORED_REPEAT };

function find(all, name, what) {
    if (!(name in all)) throw new Error(`there is no ${what} \`${name}\``);
    return all[name];
}

export class Player {
    /** The frame of a folder, with everything made that its passes need. */
    static async open(gl, folder) {
        const file = async (name) => {
            const response = await fetch(`${folder}/${name}`);
            if (!response.ok) throw new Error(`${folder}/${name}: ${response.status}`);
            return response;
        };
        const player = new Player();
        player.gl = gl;
        player.frame = await (await file("frame.json")).json();
        const { buffers, textures, samplers, shaders } = player.frame;
        player.buffers = {};
        for (const [name, it] of Object.entries(buffers)) {
            if (!it.contents) throw new Error(`buffer \`${name}\`: WebGL 2 has no passes that write buffers`);
            let bytes = await (await file(it.contents)).arrayBuffer();
            if (it.type === "Transform") bytes = asWebGL(bytes);
            if (it.usage.includes("uniform")) bytes = inVectors(bytes);
            const target = it.usage.includes("index") ? gl.ELEMENT_ARRAY_BUFFER : gl.ARRAY_BUFFER;
            player.buffers[name] = gl.createBuffer();
            gl.bindBuffer(target, player.buffers[name]);
            gl.bufferData(target, bytes, gl.STATIC_DRAW);
        }
        player.textures = {};
        for (const [name, it] of Object.entries(textures)) player.textures[name] = texture(gl, name, it);
        player.samplers = {};
        for (const [name, it] of Object.entries(samplers)) player.samplers[name] = sampler(gl, it);
        // What is read texel by texel.
        player.nearest = sampler(gl, { mag_filter: "nearest", min_filter: "nearest", address_modes: [] });
        player.texts = {};
        for (const [name, it] of Object.entries(shaders)) {
            const essl = it.languages.essl300;
            if (!essl) throw new Error(`shader \`${name}\`: ${it.unsupported?.essl300 ?? "build with essl300"}`);
            player.texts[name] = await (await file(essl.file)).text();
        }
        player.passes = player.frame.passes.map((pass) => player.#pass(pass));
        player.#check("while things were made");
        return player;
    }

    /** Runs all passes. */
    run() {
        this.passes.forEach((pass, i) => {
            pass();
            this.#check(`in pass \`${this.frame.passes[i].label}\``);
        });
    }

    /** Four floats for each pixel of the picture, rows from the top. */
    picture() {
        const { gl } = this;
        const picture = this.#texture(this.frame.picture);
        const [width, height] = picture.size;
        const pixels = new Float32Array(4 * width * height);
        gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer(gl, [picture], null));
        gl.readPixels(0, 0, width, height, gl.RGBA, gl.FLOAT, pixels);
        this.#check("while the picture was read");
        return pixels;
    }

    #texture(name) {
        return find(this.textures, name, "texture");
    }

    #check(when) {
        const error = this.gl.getError();
        if (error !== this.gl.NO_ERROR) throw new Error(`WebGL error 0x${error.toString(16)} ${when}`);
    }

    /** A function that runs a pass. */
    #pass(pass) {
        const { gl } = this;
        switch (pass.kind) {
            case "levels": {
                const target = this.#texture(pass.texture);
                const copies = pass.levels.map((name, level) => {
                    const source = this.#texture(name);
                    return [source, framebuffer(gl, [source], null), framebuffer(gl, [target], null, level)];
                });
                return () => copies.forEach(([source, read, draw]) => blit(gl, read, draw, source.size));
            }
            case "full-screen": {
                const targets = pass.targets.map((name) => this.#texture(name));
                const fbo = framebuffer(gl, targets, null);
                const bind = this.#program(pass.vertex, pass.fragment);
                const array = gl.createVertexArray();
                return () => {
                    begin(gl, fbo, targets[0].size);
                    gl.disable(gl.DEPTH_TEST);
                    bind();
                    gl.bindVertexArray(array);
                    gl.drawArrays(gl.TRIANGLES, 0, 3);
                };
            }
            case "draw":
                return this.#draw(pass);
            default:
                throw new Error(`pass \`${pass.label}\`: WebGL 2 has no ${pass.kind} passes`);
        }
    }

    #draw(pass) {
        const { gl } = this;
        if (pass.colour_targets.some((it) => it.blend)) throw new Error(`pass \`${pass.label}\`: this player does not blend`);
        const colours = pass.colour_targets.map((it) => this.#texture(it.texture));
        const depth = pass.depth_target && this.#texture(pass.depth_target.texture);
        const fbo = framebuffer(gl, colours, depth);
        const resolves = pass.colour_targets.map(
            (it) => it.resolve && framebuffer(gl, [this.#texture(it.resolve)], null),
        );
        const bind = this.#program(pass.vertex, pass.fragment);
        const array = gl.createVertexArray();
        gl.bindVertexArray(array);
        for (const { location, format, buffer, stride } of pass.attributes) {
            const [, components] = /^float32(?:x(\d))?$/.exec(format) ?? [];
            gl.bindBuffer(gl.ARRAY_BUFFER, find(this.buffers, buffer, "buffer"));
            gl.vertexAttribPointer(location, Number(components ?? 1), gl.FLOAT, false, stride, 0);
            gl.enableVertexAttribArray(location);
        }
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, find(this.buffers, pass.indices.buffer, "buffer"));
        gl.bindVertexArray(null);
        const { size } = colours[0] ?? depth;
        return () => {
            begin(gl, fbo, size);
            gl.disable(gl.CULL_FACE);
            pass.colour_targets.forEach((it, i) => gl.clearBufferfv(gl.COLOR, i, it.clear));
            if (depth) {
                gl.enable(gl.DEPTH_TEST);
                gl.depthFunc(find(COMPARE, pass.depth_target.compare, "comparison"));
                gl.depthMask(true);
                gl.clearBufferfv(gl.DEPTH, 0, [pass.depth_target.clear ?? 1]);
                gl.depthMask(pass.depth_target.write);
            }
            bind();
            gl.bindVertexArray(array);
            gl.drawElements(gl.TRIANGLES, pass.indices.count, gl.UNSIGNED_INT, 0);
            resolves.forEach((draw) => draw && blit(gl, fbo, draw, size));
        };
    }

    /** A function that makes a program of two shaders current, with what they bind. */
    #program(vertex, fragment) {
        const { gl } = this;
        const program = gl.createProgram();
        // Depth alone is drawn without a fragment kernel.
        const nothing = "#version 300 es\nvoid main() {}\n";
        for (const [type, text] of [
            [gl.VERTEX_SHADER, find(this.texts, vertex.shader, "shader")],
            [gl.FRAGMENT_SHADER, fragment ? find(this.texts, fragment.shader, "shader") : nothing],
        ]) {
            const shader = gl.createShader(type);
            gl.shaderSource(shader, text);
            gl.compileShader(shader);
            gl.attachShader(program, shader);
            if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) {
                throw new Error(`${vertex.shader}, ${fragment?.shader}: ${gl.getShaderInfoLog(shader)}`);
            }
        }
        gl.linkProgram(program);
        if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
        gl.useProgram(program);
        const blocks = [];
        const units = [];
        for (const call of [vertex, fragment].filter(Boolean)) {
            const { bindings } = this.frame.shaders[call.shader];
            // In GLSL a texture and its sampler are one.
            const samplers = new Map();
            for (const it of bindings) {
                for (const number of it.places.essl300?.combined_with ?? []) {
                    samplers.set(number, find(this.samplers, call.bind[it.name].sampler, "sampler"));
                }
            }
            for (const it of bindings) {
                const place = it.places.essl300;
                if (!place) continue;
                const { buffer, texture } = call.bind[it.name] ?? {};
                if (it.kind === "uniform") {
                    const block = gl.getUniformBlockIndex(program, place.block);
                    // Two stages may have blocks of one name; a block that is not used is not there.
                    if (block === gl.INVALID_INDEX) continue;
                    gl.uniformBlockBinding(program, block, blocks.length);
                    blocks.push(find(this.buffers, buffer, "buffer"));
                } else if (it.kind === "texture") {
                    gl.uniform1i(gl.getUniformLocation(program, place.name), units.length);
                    units.push([this.#texture(texture), samplers.get(it.binding) ?? this.nearest]);
                }
            }
        }
        return () => {
            gl.useProgram(program);
            blocks.forEach((buffer, i) => gl.bindBufferBase(gl.UNIFORM_BUFFER, i, buffer));
            units.forEach(([texture, sampler], i) => {
                gl.activeTexture(gl.TEXTURE0 + i);
                gl.bindTexture(gl.TEXTURE_2D, texture.texture);
                gl.bindSampler(i, sampler);
            });
        };
    }
}

/** A matrix, by rows, to a clip space with y up and depths from 0 to 1, as one to WebGL's, upside down. */
function asWebGL(bytes) {
    const rows = new Float32Array(bytes.slice(0));
    for (let i = 0; i < 4; i++) {
        rows[4 + i] = -rows[4 + i];
        rows[8 + i] = 2 * rows[8 + i] - rows[12 + i];
    }
    return rows.buffer;
}

/** A block of uniforms is as large as its vectors of four numbers. */
function inVectors(bytes) {
    const padded = new Uint8Array(Math.ceil(bytes.byteLength / 16) * 16);
    padded.set(new Uint8Array(bytes));
    return padded.buffer;
}

/** A texture; a renderbuffer if it has several samples. */
function texture(gl, name, { dimensions, layers, levels, samples, format, size }) {
    const [internal, ...extensions] = find(FORMATS, format, "format");
    for (const extension of extensions) {
        if (!gl.getExtension(extension)) throw new Error(`texture \`${name}\`: the browser has no ${extension}`);
    }
    if (dimensions !== 2 || layers !== 1) throw new Error(`texture \`${name}\`: this player has 2-D textures alone`);
    const [width, height] = size;
    if (samples > 1) {
        const renderbuffer = gl.createRenderbuffer();
        gl.bindRenderbuffer(gl.RENDERBUFFER, renderbuffer);
        gl.renderbufferStorageMultisample(gl.RENDERBUFFER, samples, internal, width, height);
        return { renderbuffer, size: [width, height] };
    }
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texStorage2D(gl.TEXTURE_2D, levels, internal, width, height);
    return { texture, size: [width, height] };
}

function sampler(gl, { mag_filter, min_filter, mipmap_filter, address_modes, compare, max_anisotropy }) {
    const sampler = gl.createSampler();
    const min = mipmap_filter ? `${min_filter}_MIPMAP_${mipmap_filter}` : min_filter;
    gl.samplerParameteri(sampler, gl.TEXTURE_MAG_FILTER, gl[mag_filter.toUpperCase()]);
    gl.samplerParameteri(sampler, gl.TEXTURE_MIN_FILTER, gl[min.toUpperCase()]);
    const [s = "clamp-to-edge", t = "clamp-to-edge"] = address_modes;
    gl.samplerParameteri(sampler, gl.TEXTURE_WRAP_S, WRAP[s]);
    gl.samplerParameteri(sampler, gl.TEXTURE_WRAP_T, WRAP[t]);
    if (compare) {
        gl.samplerParameteri(sampler, gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE);
        gl.samplerParameteri(sampler, gl.TEXTURE_COMPARE_FUNC, find(COMPARE, compare, "comparison"));
    }
    if (max_anisotropy > 1) {
        const extension = gl.getExtension("EXT_texture_filter_anisotropic");
        if (!extension) throw new Error("the browser has no EXT_texture_filter_anisotropic");
        gl.samplerParameterf(sampler, extension.TEXTURE_MAX_ANISOTROPY_EXT, max_anisotropy);
    }
    return sampler;
}

function attach(gl, point, { texture, renderbuffer }, level) {
    if (texture) gl.framebufferTexture2D(gl.FRAMEBUFFER, point, gl.TEXTURE_2D, texture, level);
    else gl.framebufferRenderbuffer(gl.FRAMEBUFFER, point, gl.RENDERBUFFER, renderbuffer);
}

function framebuffer(gl, colours, depth, level = 0) {
    const fbo = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, fbo);
    colours.forEach((it, i) => attach(gl, gl.COLOR_ATTACHMENT0 + i, it, level));
    if (depth) attach(gl, gl.DEPTH_ATTACHMENT, depth, 0);
    gl.drawBuffers(colours.map((_, i) => gl.COLOR_ATTACHMENT0 + i));
    const status = gl.checkFramebufferStatus(gl.FRAMEBUFFER);
    if (status !== gl.FRAMEBUFFER_COMPLETE) throw new Error(`a framebuffer is not complete: 0x${status.toString(16)}`);
    return fbo;
}

function begin(gl, fbo, [width, height]) {
    gl.bindFramebuffer(gl.FRAMEBUFFER, fbo);
    gl.viewport(0, 0, width, height);
}

function blit(gl, read, draw, [width, height]) {
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, read);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, draw);
    gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
}

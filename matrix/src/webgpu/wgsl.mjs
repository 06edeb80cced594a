// Reads the interface of an entry point from WGSL text, and writes the helper stages that carry
// values to a vertex or fragment stage, or from it. Bodies are left as they are.

/** Width of the targets that vertices and fragments are read back through. */
export const WIDTH = 64;

/** A scalar or vector type in WGSL. */
export const typeName = ({ scalar, size }) => (size === 1 ? scalar : `vec${size}<${scalar}>`);

const ATTRIBUTE = /@(\w+)\s*(?:\(([^()]*)\))?\s*/g;

/** Takes the attributes off the front of a declaration. */
function attributes(text) {
    const found = {};
    const rest = text.replace(ATTRIBUTE, (_, name, value) => {
        found[name] = (value ?? "").trim();
        return "";
    });
    return { found, rest: rest.trim() };
}

/** Splits at the commas that no bracket encloses. */
function split(text) {
    const parts = [""];
    let depth = 0;
    for (const c of text) {
        depth += "(<[".includes(c) ? 1 : ")>]".includes(c) ? -1 : 0;
        if (c === "," && depth === 0) parts.push("");
        else parts[parts.length - 1] += c;
    }
    return parts.map((p) => p.trim()).filter(Boolean);
}

/** Declarations such as `@location(0) name: type`. */
const declarations = (text) =>
    split(text).map((whole) => {
        const { found, rest } = attributes(whole);
        return { whole, rest, attributes: found, name: rest.split(":")[0].trim() };
    });

/** The members of a structure; none if the type is something else. */
function membersOf(code, type) {
    const found = /^\w+$/.test(type) && new RegExp(`struct\\s+${type}\\s*\\{([^}]*)\\}`).exec(code);
    return found ? declarations(found[1]) : null;
}

/** The header of an entry point: where it begins and its body begins, its parameters and result. */
export function header(code, stage, name) {
    const found = new RegExp(`@${stage}\\s+fn\\s+${name}\\s*\\(`).exec(code);
    if (!found) throw new Error(`the text has no ${stage} entry point \`${name}\``);
    const open = found.index + found[0].length;
    let close = open;
    for (let depth = 1; depth > 0; close += 1) {
        if (close >= code.length) throw new Error(`the parameters of \`${name}\` have no end`);
        depth += code[close] === "(" ? 1 : code[close] === ")" ? -1 : 0;
    }
    const body = code.indexOf("{", close);
    if (body < 0) throw new Error(`\`${name}\` has no body`);
    const result = attributes(code.slice(close, body).replace("->", ""));
    return { start: found.index, body, parameters: declarations(code.slice(open, close - 1)), result };
}

/** Where vertex `i` is drawn: in the middle of its own pixel. */
const place = (index, height) =>
    `vec4<f32>(f32(2u * (${index} % ${WIDTH}u) + 1u) / ${WIDTH}.0 - 1.0, ` +
    `1.0 - f32(2u * (${index} / ${WIDTH}u) + 1u) / ${height}.0, 0.0, 1.0)`;

/** A vertex stage that hands the varyings of one fragment each to `code`'s entry point. */
export function points(code, name, varyings, height) {
    const declared = header(code, "fragment", name).parameters;
    let members = "", inputs = "", copies = "";
    for (const { location, value } of varyings) {
        const own = declared.find((p) => p.attributes.location === String(location));
        // The stages must agree; integers are never interpolated.
        const how = own?.attributes.interpolate ?? (value.scalar === "f32" ? "" : "flat");
        const interpolate = how ? ` @interpolate(${how})` : "";
        members += `    @location(${location})${interpolate} v${location}: ${typeName(value)},\n`;
        inputs += `, @location(${location}) v${location}: ${typeName(value)}`;
        copies += `    point.v${location} = v${location};\n`;
    }
    return `struct Point {
    @builtin(position) place: vec4<f32>,
${members}}

@vertex
fn hankel_points(@builtin(vertex_index) index: u32${inputs}) -> Point {
    var point: Point;
    point.place = ${place("index", height)};
${copies}    return point;
}
`;
}

/** `value` as four words, its bits unchanged; an array of up to four numbers, if `isArray` says so. */
function words(expression, { scalar, size }, isArray) {
    if (size > 4) throw new Error(`${size} numbers are not read back here`);
    const of = (part) => (scalar === "u32" ? part : `bitcast<u32>(${part})`);
    const parts = [..."xyzw"].map((c, i) => {
        if (i >= size) return "0u";
        if (isArray) return of(`${expression}[${i}]`);
        return of(size === 1 ? expression : `${expression}.${c}`);
    });
    return `vec4<u32>(${parts.join(", ")})`;
}

/**
 * The text with a new vertex entry point `hankel_captured`, which calls the old one as a plain
 * function, draws vertex `i` into a pixel of its own and passes the bits of each output on.
 * `outputs` are the outputs' values, with a location or, for the position and clip distances, none.
 */
export function captured(code, name, outputs, height) {
    const { start, body, parameters, result } = header(code, "vertex", name);
    const members = membersOf(code, result.rest);
    const isIndex = (d) => d.attributes.builtin === "vertex_index";
    let index;
    for (const p of parameters) {
        const member = membersOf(code, p.rest.split(":")[1].trim())?.find(isIndex);
        if (isIndex(p)) index = p.name;
        else if (member) index = `${p.name}.${member.name}`;
    }
    const entry = parameters.map((p) => p.whole);
    if (!index) {
        index = "hankel_index";
        entry.push(`@builtin(vertex_index) ${index}: u32`);
    }
    let passed = "", copies = "";
    outputs.forEach(({ location, value, clips }, i) => {
        const builtIn = clips ? "clip_distances" : "position";
        const member = members?.find((m) =>
            location === undefined
                ? m.attributes.builtin === builtIn
                : m.attributes.location === String(location),
        );
        const alone = !members && location === undefined && result.found.builtin === builtIn;
        if (!member && !alone) {
            throw new Error(`\`${name}\` does not return ${
                location === undefined ? builtIn : `location ${location}`}`);
        }
        passed += `    @location(${i}) @interpolate(flat) v${i}: vec4<u32>,\n`;
        const own = member ? `result.${member.name}` : "result";
        copies += `    point.v${i} = ${words(own, value, clips)};\n`;
    });
    return `${code.slice(0, start)}fn ${name}(${parameters.map((p) => p.rest).join(", ")}) -> ${
        result.rest} ${code.slice(body)}
struct HankelCaptured {
    @builtin(position) place: vec4<f32>,
${passed}}

@vertex
fn hankel_captured(${entry.join(", ")}) -> HankelCaptured {
    let result = ${name}(${parameters.map((p) => p.name).join(", ")});
    var point: HankelCaptured;
    point.place = ${place(index, height)};
${copies}    return point;
}
`;
}

/** A fragment stage that writes the outputs numbered `group` of a captured vertex. */
export function taken(group) {
    const members = group.map((n, i) => `    @location(${i}) t${i}: vec4<u32>,\n`).join("");
    const inputs = group.map((n) => `    @location(${n}) @interpolate(flat) v${n}: vec4<u32>,\n`);
    return `struct Taken {
${members}}

@fragment
fn hankel_taken(
${inputs.join("")}) -> Taken {
    return Taken(${group.map((n) => `v${n}`).join(", ")});
}
`;
}

/** How a texel of a format is made from its words, which begin at `at`. */
const TEXELS = {
    r32float: ["f32", "bitcast<f32>(words[at])"],
    rgba32float: ["vec4<f32>",
        "bitcast<vec4<f32>>(vec4<u32>(words[at], words[at + 1u], words[at + 2u], words[at + 3u]))"],
    rgba16float: ["vec4<f32>",
        "vec4<f32>(unpack2x16float(words[at]), unpack2x16float(words[at + 1u]))"],
    rgba16unorm: ["vec4<f32>",
        "vec4<f32>(unpack2x16unorm(words[at]), unpack2x16unorm(words[at + 1u]))"],
    rgba8unorm: ["vec4<f32>", "unpack4x8unorm(words[at])"],
    r32uint: ["u32", "words[at]"],
    rgba32uint: ["vec4<u32>",
        "vec4<u32>(words[at], words[at + 1u], words[at + 2u], words[at + 3u])"],
    rg16uint: ["vec2<u32>", "vec2<u32>(words[at] & 0xffffu, words[at] >> 16u)"],
    rg16sint: ["vec2<i32>",
        "vec2<i32>(extractBits(i32(words[at]), 0u, 16u), extractBits(i32(words[at]), 16u, 16u))"],
    depth32float: ["f32", "bitcast<f32>(words[at])"],
};

/** A vertex and a fragment stage that fill a texture, each sample for itself. */
export function filling(format, width, samples, wordsOfTexel) {
    const [type, texel] = TEXELS[format];
    const target = format === "depth32float" ? "@builtin(frag_depth)" : "@location(0)";
    const sample = samples === 1 ? "" : ", @builtin(sample_index) sample: u32";
    return `@group(0) @binding(0) var<storage, read> words: array<u32>;

@vertex
fn hankel_cover(@builtin(vertex_index) i: u32) -> @builtin(position) vec4<f32> {
    return vec4<f32>(f32((i << 1u) & 2u) * 2.0 - 1.0, f32(i & 2u) * 2.0 - 1.0, 0.0, 1.0);
}

@fragment
fn hankel_fill(@builtin(position) place: vec4<f32>${sample}) -> ${target} ${type} {
    let pixel = u32(place.y) * ${width}u + u32(place.x);
    let at = (pixel * ${samples}u + ${samples === 1 ? "0u" : "sample"}) * ${wordsOfTexel}u;
    return ${texel};
}
`;
}

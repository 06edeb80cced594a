// Runner of WGSL in Dawn, through Node's `webgpu` package:
//
//     node dawn.mjs
//
// HANKEL_NODE_MODULES is the folder that the package is in. Vulkan's own variables choose the driver.
// Dawn runs in a child, so that its death is only an error.

import { fork } from "node:child_process";
import { readFile, writeFile } from "node:fs/promises";
import { join } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";

import { execute, open } from "./execute.mjs";
import { ending, lastWords, serve, within } from "./runner.mjs";

const folder = process.env.HANKEL_NODE_MODULES;

if (process.send) {
    await child();
} else if (!folder) {
    console.error("HANKEL_NODE_MODULES does not say where the package `webgpu` is");
    process.exit(1);
} else {
    await serve(start);
}

/** In the child: opens a device and runs the jobs that the parent sends. */
async function child() {
    process.on("disconnect", () => process.exit(0));
    const at = join(folder, "webgpu");
    const { version } = JSON.parse(await readFile(join(at, "package.json"), "utf8"));
    const { create, globals } = await import(pathToFileURL(join(at, "index.js")));
    Object.assign(globalThis, globals);
    // Dawn goes away when nothing refers to this any more; the jobs below do.
    const gpu = create([]);
    let { device, about } = await open(gpu);
    let lost = watch(device);
    process.on("message", async ({ turn, job }) => {
        let error;
        try {
            if (lost.yes) {
                ({ device } = await open(gpu));
                lost = watch(device);
            }
            const [code, inputs] = await Promise.all([
                readFile(job.code, "utf8"),
                readFile(job.inputs),
            ]);
            const bytes = new Uint8Array(inputs).buffer;
            await writeFile(job.results, await execute(device, job, code, bytes));
        } catch (e) {
            error = e?.message || String(e);
        }
        process.send({ turn, error });
    });
    process.send({ about: `Dawn of webgpu ${version} in Node ${process.versions.node}: ${about}` });
}

/** Whether a device is lost by now. */
function watch(device) {
    const lost = { yes: false };
    device.lost.then(() => {
        lost.yes = true;
    });
    return lost;
}

/** A session: a child with a device. */
async function start() {
    const child = fork(fileURLToPath(import.meta.url), {
        stdio: ["ignore", "ignore", "pipe", "ipc"],
    });
    const words = lastWords(child.stderr);
    const waiting = new Map();
    let turns = 0;
    let isDead = false;
    const death = new Promise((_, reject) => {
        const die = (how) => {
            isDead = true;
            reject(Object.assign(new Error(`Dawn's process ${how}: ${words()}`), { isDeath: true }));
        };
        child.on("error", (e) => die(`failed: ${e.message}`));
        child.on("close", (code, signal) => die(ending(code, signal)));
    });
    death.catch(() => {});
    const end = async () => {
        child.kill("SIGKILL");
        await death.catch(() => {});
    };
    const greeting = new Promise((resolve) => {
        child.on("message", ({ about, turn, error }) => {
            if (about !== undefined) resolve(about);
            else waiting.get(turn)?.(error);
        });
    });
    const timely = (work, what) =>
        within(work, death, what).catch(async (e) => {
            if (e.isLate) await end();
            throw e;
        });
    const about = await timely(greeting, "Dawn's start").catch(async (e) => {
        await end();
        throw e;
    });
    const run = async (job) => {
        const turn = (turns += 1);
        const answer = new Promise((resolve, reject) => {
            waiting.set(turn, (error) => (error === undefined ? resolve() : reject(new Error(error))));
            child.send({ turn, job }, (e) => {
                if (e) reject(new Error(`Dawn's process takes no jobs: ${e.message}`));
            });
        });
        try {
            await timely(answer, "the job");
        } finally {
            waiting.delete(turn);
        }
    };
    return { about, run, end, isDead: () => isDead };
}

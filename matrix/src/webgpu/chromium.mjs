// Runner of WGSL in a page of headless Chromium:
//
//     node chromium.mjs
//
// HANKEL_CHROMIUM is the program.

import { spawn } from "node:child_process";
import { randomUUID } from "node:crypto";
import { mkdtemp, readFile, rm, writeFile } from "node:fs/promises";
import { createServer } from "node:http";
import { join } from "node:path";
import { fileURLToPath } from "node:url";

import { ending, lastWords, serve, within } from "./runner.mjs";

const PROGRAM = process.env.HANKEL_CHROMIUM;

/** It complains about the desktop's message bus where there is none. */
const NOISE = /:dbus\//;

/** What the server gives to whoever knows the session's name. */
const FILES = {
    "page.html": "text/html",
    "page.mjs": "text/javascript",
    "execute.mjs": "text/javascript",
    "wgsl.mjs": "text/javascript",
};

await serve(start);

/** The body of a request. */
async function body(request) {
    const chunks = [];
    for await (const chunk of request) chunks.push(chunk);
    return Buffer.concat(chunks);
}

/** A session: a server and a Chromium whose page asks it for jobs. */
async function start() {
    const name = randomUUID();
    const jobs = [];
    const idle = [];
    const waiting = new Map();
    let turns = 0;
    let greet, refuse;
    const greeting = new Promise((resolve, reject) => {
        greet = resolve;
        refuse = reject;
    });

    const hand = () => {
        while (jobs.length > 0 && idle.length > 0) {
            const response = idle.shift();
            if (response.closed || response.destroyed) continue;
            const { head, code, inputs } = jobs.shift();
            const size = Buffer.alloc(8);
            size.writeUInt32LE(head.length, 0);
            size.writeUInt32LE(code.length, 4);
            response.end(Buffer.concat([size, head, code, inputs]));
        }
    };
    const answer = async (request, response) => {
        const [session, what, turn] = request.url.slice(1).split("/");
        if (session !== name) {
            response.writeHead(404).end();
        } else if (what in FILES) {
            const text = await readFile(new URL(what, import.meta.url));
            response.writeHead(200, { "content-type": FILES[what] }).end(text);
        } else if (what === "next") {
            idle.push(response);
            hand();
        } else if (request.method === "POST") {
            const bytes = await body(request);
            response.end();
            if (what === "ready") greet(bytes.toString());
            else if (what === "refused") refuse(new Error(`Chromium: ${bytes}`));
            else if (what === "results") waiting.get(turn)?.resolve(bytes);
            else if (what === "failed") waiting.get(turn)?.reject(new Error(bytes.toString()));
        } else {
            response.writeHead(404).end();
        }
    };
    const server = createServer((request, response) => {
        answer(request, response).catch(() => response.destroy());
    });
    server.requestTimeout = 0;
    await new Promise((resolve, reject) => {
        server.once("error", reject);
        server.listen(0, "127.0.0.1", resolve);
    });

    // Within the folder that this file was laid into: it is removed with that, even if this process is killed.
    const profile = await mkdtemp(join(fileURLToPath(new URL(".", import.meta.url)), "profile-"));
    const flags = [
        "--headless", "--no-sandbox", "--disable-quic", "--no-first-run",
        "--disable-background-networking", "--disable-component-update", "--disable-sync",
        "--disable-background-timer-throttling", "--disable-renderer-backgrounding",
        "--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader", `--user-data-dir=${profile}`,
        // Chromium ends when this pipe does, even if this process is killed.
        "--remote-debugging-pipe",
    ];
    const child = spawn(PROGRAM, [...flags, `http://127.0.0.1:${server.address().port}/${name}/page.html`], {
        stdio: ["ignore", "ignore", "pipe", "pipe", "pipe"],
        detached: true,
        // What it writes there beside its profile stays when it is killed.
        env: { ...process.env, TMPDIR: profile },
    });
    // What the pipe says does not matter, nor that it breaks.
    for (const pipe of [child.stdio[3], child.stdio[4]]) pipe?.on("error", () => {});
    child.stdio[4]?.resume();
    const words = lastWords(child.stderr, NOISE);
    let isDead = false;
    const death = new Promise((_, reject) => {
        const die = (how) => {
            isDead = true;
            reject(Object.assign(new Error(`Chromium ${how}: ${words()}`), { isDeath: true }));
        };
        child.on("error", (e) => die(`failed: ${e.message}`));
        child.on("exit", (code, signal) => die(ending(code, signal)));
    });
    death.catch(() => {});
    const end = async () => {
        try {
            // The whole group: its helpers may outlive it.
            if (child.pid) process.kill(-child.pid, "SIGKILL");
        } catch {
            // None of them is left.
        }
        await death.catch(() => {});
        server.close();
        server.closeAllConnections();
        await rm(profile, { recursive: true, force: true, maxRetries: 5, retryDelay: 50 });
    };
    const timely = (work, what) =>
        within(work, death, what).catch(async (e) => {
            if (e.isLate) await end();
            throw e;
        });
    const about = await timely(greeting, "Chromium's start").catch(async (e) => {
        await end();
        throw e;
    });

    const run = async (job) => {
        const [code, inputs] = await Promise.all([readFile(job.code), readFile(job.inputs)]);
        const turn = String((turns += 1));
        const bytes = new Promise((resolve, reject) => waiting.set(turn, { resolve, reject }));
        jobs.push({ head: Buffer.from(JSON.stringify({ turn, job })), code, inputs });
        hand();
        try {
            await writeFile(job.results, await timely(bytes, "the job"));
        } finally {
            waiting.delete(turn);
        }
    };
    return { about, run, end, isDead: () => isDead };
}

// Shows a page to a headless Chromium, and writes what it posts to `/post/NAME` as `OUT/NAME.bin`, until it posts to
// `/post/done`, or why it cannot to `/post/failed`:
//
//     node chromium.mjs CHROMIUM OUT page=FOLDER NAME=FOLDER...
//
// The page is `/page/index.html`. The folders are served by their names, on this machine alone.

import { spawn } from "node:child_process";
import { mkdtemp, readFile, rm, writeFile } from "node:fs/promises";
import { createServer } from "node:http";
import { tmpdir } from "node:os";
import { extname, join, normalize } from "node:path";

/** Milliseconds that all may take. */
const LIMIT = 120_000;

const TYPES = { ".html": "text/html", ".js": "text/javascript" };

const [chromium, out, ...served] = process.argv.slice(2);
const folders = Object.fromEntries(served.map((it) => [it.slice(0, it.indexOf("=")), it.slice(it.indexOf("=") + 1)]));
if (!folders.page) {
    console.error("usage: node chromium.mjs CHROMIUM OUT page=FOLDER NAME=FOLDER...");
    process.exit(2);
}

const server = createServer();
const finished = new Promise((resolve, reject) => {
    const answer = async (request, response) => {
        const path = normalize(decodeURIComponent(request.url.split("?")[0]));
        const [folder, ...rest] = path.slice(1).split("/");
        if (request.method === "POST") {
            const chunks = [];
            for await (const chunk of request) chunks.push(chunk);
            const body = Buffer.concat(chunks);
            response.end();
            if (rest[0] === "done") resolve();
            else if (rest[0] === "failed") reject(new Error(`the page: ${body}`));
            else await writeFile(join(out, `${rest[0]}.bin`), body);
        } else if (folder in folders) {
            const text = await readFile(join(folders[folder], ...rest));
            response.writeHead(200, { "content-type": TYPES[extname(path)] ?? "text/plain" }).end(text);
        } else {
            response.writeHead(404).end();
        }
    };
    server.on("error", reject);
    server.on("request", (request, response) => {
        answer(request, response).catch((e) => {
            reject(new Error(`${request.url}: ${e.message}`));
            response.destroy();
        });
    });
    setTimeout(() => reject(new Error(`nothing came within ${LIMIT / 1000} s`)), LIMIT).unref();
});
await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));

const profile = await mkdtemp(join(tmpdir(), "hankel-page-"));
const child = spawn(chromium, [
    "--headless", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--enable-unsafe-webgpu",
    "--use-webgpu-adapter=swiftshader", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    // Chromium ends when this pipe does, even if this process is killed.
    "--remote-debugging-pipe", `--user-data-dir=${profile}`,
    `http://127.0.0.1:${server.address().port}/page/index.html`,
], {
    stdio: ["ignore", "ignore", "ignore", "pipe", "pipe"],
    detached: true,
    // What it writes there beside its profile stays when it is killed.
    env: { ...process.env, TMPDIR: profile },
});
for (const pipe of [child.stdio[3], child.stdio[4]]) pipe.on("error", () => {});
child.stdio[4].resume();
const death = new Promise((_, reject) => {
    child.on("error", reject);
    child.on("exit", (code, signal) => reject(new Error(`Chromium ended: ${signal ?? code}`)));
});
death.catch(() => {});
let status = 0;
try {
    await Promise.race([finished, death]);
} catch (e) {
    console.error(e.message);
    status = 1;
}
try {
    // The whole group: its helpers may outlive it.
    process.kill(-child.pid, "SIGKILL");
} catch {
    // None of them is left.
}
await death.catch(() => {});
await rm(profile, { recursive: true, force: true, maxRetries: 5, retryDelay: 50 });
process.exit(status);

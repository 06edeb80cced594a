// The protocol of `job.rs` on standard input and output, around a session that does the work in
// another process: whatever becomes of that one, each job gets its reply.

import { createInterface } from "node:readline";

/** Milliseconds that a session may take to start, and for a job. */
export const LIMIT = 1000 * Number(process.env.HANKEL_JOB_SECONDS || 120);

/** How much of a process's last words goes into an error. */
const LAST_WORDS = 2000;

/** Passes a process's standard error on and keeps its end, without the lines that are `noise`. */
export function lastWords(stream, noise) {
    let kept = "";
    createInterface({ input: stream }).on("line", (line) => {
        process.stderr.write(`${line}\n`);
        if (!noise?.test(line)) kept = `${kept}${line}\n`.slice(-LAST_WORDS);
    });
    return () => kept.trim() || "it said nothing";
}

/** How a process ended, in words. */
export const ending = (code, signal) => (signal ? `was killed by ${signal}` : `ended with status ${code}`);

/** `work`, or an error when it takes too long or when `death`, a promise, rejects first. */
export function within(work, death, what) {
    let timer;
    const late = new Promise((_, reject) => {
        timer = setTimeout(() => {
            reject(Object.assign(new Error(`${what} took longer than ${LIMIT / 1000} s`), { isLate: true }));
        }, LIMIT);
    });
    return Promise.race([work, death, late]).finally(() => clearTimeout(timer));
}

/** How every message begins that says which feature a device lacks. */
const LACKS = "the device lacks ";

/** The part of a reply that says what went wrong. */
function failure(e) {
    const error = e.message || String(e);
    if (error.startsWith(LACKS)) return { error: error.slice(LACKS.length), kind: "lacks" };
    return { error, kind: e.isLate ? "timed_out" : e.isDeath ? "crashed" : "refused" };
}

/**
 * Serves jobs until standard input ends.
 *
 * `start` gives a session: `about`, its name and versions; `run(job)`, which resolves when the
 * results are written and rejects with words; `isDead()`; `end()`. After a death the next job
 * starts another one. Jobs run one after the other, so that a death is blamed on the right one.
 */
export async function serve(start) {
    let session = null;
    const close = async () => {
        const old = session;
        session = null;
        await old?.end();
    };
    for (const signal of ["SIGINT", "SIGTERM", "SIGHUP"]) {
        process.on(signal, () => close().finally(() => process.exit(1)));
    }
    // Nobody reads the replies any more.
    process.stdout.on("error", () => close().finally(() => process.exit(1)));
    const say = (line) => process.stdout.write(`${JSON.stringify(line)}\n`);
    const fresh = async () => {
        if (session?.isDead()) await close();
        session ??= await start();
        return session;
    };

    try {
        say({ ready: (await fresh()).about });
        for await (const line of createInterface({ input: process.stdin })) {
            if (line.trim() === "") continue;
            const job = JSON.parse(line);
            try {
                await (await fresh()).run(job);
                say({ id: job.id });
            } catch (e) {
                say({ id: job.id, ...failure(e) });
            }
        }
        await close();
        process.exit(0);
    } catch (e) {
        console.error(e.message || e);
        await close();
        process.exit(1);
    }
}

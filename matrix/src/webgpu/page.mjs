// In the page: fetches jobs, runs them and posts the results.

import { execute, open } from "./execute.mjs";

const post = (what, body) => fetch(what, { method: "POST", body });

/** What the browser calls itself. */
async function browser() {
    const data = await navigator.userAgentData?.getHighEntropyValues(["fullVersionList"]);
    const own = data?.fullVersionList?.find(({ brand }) => /Chrom/.test(brand));
    return own ? `${own.brand} ${own.version}` : navigator.userAgent;
}

let opened;

/** A device that is not lost. */
function fresh() {
    opened ??= open(navigator.gpu).then((one) => {
        one.device.lost.then(() => {
            opened = undefined;
        });
        return one;
    }, (e) => {
        opened = undefined;
        throw e;
    });
    return opened;
}

/** Runs one job after the other, for as long as the runner gives any. */
async function work() {
    for (;;) {
        const bytes = await (await fetch("next")).arrayBuffer();
        const [head, code] = new Uint32Array(bytes, 0, 2);
        const text = (at, length) => new TextDecoder().decode(new Uint8Array(bytes, at, length));
        const { turn, job } = JSON.parse(text(8, head));
        try {
            const { device } = await fresh();
            const inputs = bytes.slice(8 + head + code);
            const results = await execute(device, job, text(8 + head, code), inputs);
            await post(`results/${turn}`, results);
        } catch (e) {
            await post(`failed/${turn}`, e?.message || String(e));
        }
    }
}

try {
    if (!navigator.gpu) throw new Error("the page has no WebGPU");
    const { about } = await fresh();
    await post("ready", `${await browser()}: ${about}`);
    await work();
} catch (e) {
    // Before the page is ready this is why; afterwards the runner hears it no more.
    await post("refused", e?.message || String(e));
}

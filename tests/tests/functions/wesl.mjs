// What WESL's linker makes of stubs that import modules:
//
//     node wesl.mjs LIBRARY HOST STUB...
//
// in the folder with the modules' texts. Gives as JSON the WGSL of each stub.

import { readFileSync } from "node:fs";
import { link } from "wesl/core";

const [library, host, ...stubs] = process.argv.slice(2);
const text = (name) => readFileSync(`${name}.wesl`, "utf8");
const modules = { [`./${library}.wesl`]: text(library), [`./${host}.wesl`]: text(host) };
const linked = {};
for (const stub of stubs) {
    const weslSrc = { ...modules, [`./${stub}.wesl`]: text(stub) };
    linked[stub] = (await link({ weslSrc, rootModuleName: `./${stub}.wesl` })).dest;
}
process.stdout.write(JSON.stringify(linked));

// Khronos' validator over the files given; prints its messages as JSON, one list a file.
// The package `gltf-validator` is looked for in the folder that FABRIG_GLTF_VALIDATOR names.
import { createRequire } from "node:module";
import { readFileSync } from "node:fs";
import { dirname, resolve } from "node:path";

const require = createRequire(resolve(process.env.FABRIG_GLTF_VALIDATOR, "package.json"));
const validator = require("gltf-validator");
const found = [];
for (const path of process.argv.slice(2)) {
  const report = await validator.validateBytes(new Uint8Array(readFileSync(path)), {
    externalResourceFunction: async (uri) =>
      new Uint8Array(readFileSync(resolve(dirname(path), decodeURIComponent(uri)))),
  });
  found.push(report.issues.messages);
}
console.log(JSON.stringify(found));

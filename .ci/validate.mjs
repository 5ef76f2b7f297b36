// Runs the Khronos glTF validator on every .glb, .gltf and .vrm below a folder; exit 1 on any error, or if there is none.
// node validate.mjs FOLDER_WITH_NODE_MODULES FOLDER
import { createRequire } from "node:module";
import { readdirSync, readFileSync } from "node:fs";
import { dirname, join, resolve } from "node:path";

const [tools, folder] = process.argv.slice(2);
const { validateBytes } = createRequire(resolve(tools, "package.json"))("gltf-validator");
const files = readdirSync(folder, { recursive: true }).filter((name) => /\.(glb|gltf|vrm)$/.test(name)).sort();
let bad = 0;
for (const name of files) {
  const path = join(folder, name);
  const report = await validateBytes(new Uint8Array(readFileSync(path)), {
    uri: name,
    maxIssues: 20,
    externalResourceFunction: async (uri) => new Uint8Array(readFileSync(join(dirname(path), decodeURIComponent(uri)))),
  });
  const { numErrors, numWarnings, messages } = report.issues;
  const errors = messages.filter((message) => message.severity === 0).map((message) => `${message.code} ${message.pointer}`);
  console.log(`${name}: ${numErrors} errors, ${numWarnings} warnings ${errors.join("; ")}`);
  bad += numErrors > 0 ? 1 : 0;
}
console.log(`${files.length} files validated, ${bad} with errors`);
process.exit(bad > 0 || files.length === 0 ? 1 : 0);

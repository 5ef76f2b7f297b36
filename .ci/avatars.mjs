// Reads every .vrm below a folder with three-vrm, as viewers in browsers do, and lets a second pass; exit 1 if it finds less than the
// file says, if a bone comes to no place, or if there is no avatar.
// node avatars.mjs FOLDER_WITH_NODE_MODULES FOLDER
import { readdirSync, readFileSync } from "node:fs";
import { join, resolve } from "node:path";
import { pathToFileURL } from "node:url";

const [tools, folder] = process.argv.slice(2);
const module = (path) => import(pathToFileURL(join(resolve(tools), "node_modules", path)));
globalThis.self ??= globalThis;
// Pictures need a browser: they are left out, all else is read.
globalThis.createImageBitmap ??= async () => ({ width: 1, height: 1, close() {} });
const { GLTFLoader } = await module("three/examples/jsm/loaders/GLTFLoader.js");
const { Vector3 } = await module("three/build/three.module.js");
const { VRMLoaderPlugin } = await module("@pixiv/three-vrm/lib/three-vrm.module.js");

const REQUIRED = ["hips", "spine", "head"].concat(
  ...["left", "right"].map((side) =>
    ["UpperLeg", "LowerLeg", "Foot", "UpperArm", "LowerArm", "Hand"].map((bone) => side + bone),
  ),
);

/** JSON of a GLB. */
function json(bytes) {
  const length = bytes.readUInt32LE(12);
  return JSON.parse(bytes.subarray(20, 20 + length).toString("utf8"));
}

/** Parts that three-vrm does not find in an avatar though its file has them. */
async function lacks(bytes) {
  const file = json(bytes);
  const { VRMC_vrm: says = {}, VRMC_springBone: springs = {} } = file.extensions ?? {};
  const loader = new GLTFLoader();
  loader.register((parser) => new VRMLoaderPlugin(parser, { autoUpdateHumanBones: true }));
  const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
  const read = await loader.parseAsync(buffer, "");
  const { vrm } = read.userData;
  if (!vrm) return ["no avatar"];
  const missing = [];
  const expect = (what, is, wanted) => is === wanted || missing.push(`${what}: ${is} of ${wanted}`);
  for (const bone of REQUIRED) {
    if (!vrm.humanoid.getRawBoneNode(bone)) missing.push(`bone ${bone}`);
  }
  expect("bones", Object.keys(vrm.humanoid.humanBones).length, Object.keys(says.humanoid.humanBones).length);
  const { preset = {}, custom = {} } = says.expressions ?? {};
  const expressions = Object.keys(preset).length + Object.keys(custom).length;
  expect("expressions", vrm.expressionManager?.expressions.length ?? 0, expressions);
  // Without expressions three-vrm reads no look-at.
  expect("look-at", Boolean(vrm.lookAt), Boolean(says.lookAt && says.expressions));
  const joints = (springs.springs ?? []).reduce((sum, spring) => sum + Math.max(0, spring.joints.length - 1), 0);
  expect("spring joints", vrm.springBoneManager?.joints.size ?? 0, joints);
  const groups = new Set((springs.springs ?? []).flatMap((spring) => spring.colliderGroups ?? []));
  const colliders = new Set([...groups].flatMap((group) => springs.colliderGroups[group].colliders));
  expect("colliders", vrm.springBoneManager?.colliders.length ?? 0, colliders.size);
  const constraints = (file.nodes ?? []).filter((node) => node.extensions?.VRMC_node_constraint).length;
  expect("constraints", vrm.nodeConstraintManager?.constraints.size ?? 0, constraints);
  expect("animations", read.animations.length, file.animations?.length ?? 0);
  for (let frame = 0; frame < 60; frame++) vrm.update(1 / 60);
  vrm.scene.updateMatrixWorld(true);
  for (const [bone, { node }] of Object.entries(vrm.humanoid.humanBones)) {
    const place = node.getWorldPosition(new Vector3());
    if (![place.x, place.y, place.z].every(Number.isFinite)) missing.push(`${bone} comes to no place`);
  }
  return missing;
}

const files = readdirSync(folder, { recursive: true }).filter((name) => name.endsWith(".vrm")).sort();
let bad = 0;
for (const name of files) {
  const missing = await lacks(readFileSync(join(folder, name))).catch((error) => [`not read: ${error.message ?? error}`]);
  console.log(`${name}: ${missing.length === 0 ? "whole" : missing.join("; ")}`);
  bad += missing.length > 0 ? 1 : 0;
}
console.log(`${files.length} avatars read by three-vrm, ${bad} not whole`);
process.exit(bad > 0 || files.length === 0 ? 1 : 0);

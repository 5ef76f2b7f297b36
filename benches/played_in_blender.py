"""An exported clip as Blender plays it beside the file itself: the distance of skinned vertices at key times.

    python played_in_blender.py ANIMATED.glb [--times N]

The file is read here without any importer: keys, hierarchy, inverse bind matrices and weights, as glTF 2.0 defines them.
Blender imports it and evaluates its armature. The N (else 24) key times are spread over all of them. Prints one JSON line
with the largest distance of a vertex as a share of the mesh's height.
"""
import json, os, struct, sys
import bpy
import numpy as np

path = sys.argv[1]
wanted = int(sys.argv[sys.argv.index("--times") + 1]) if "--times" in sys.argv else 24
data = open(path, "rb").read()
size = struct.unpack_from("<I", data, 12)[0]
gltf, binary = json.loads(data[20 : 20 + size]), data[28 + size :]
KINDS = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def values(index):
    accessor = gltf["accessors"][index]
    view = gltf["bufferViews"][accessor["bufferView"]]
    kind, width = np.dtype(KINDS[accessor["componentType"]]), WIDTHS[accessor["type"]]
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    stride = view.get("byteStride", kind.itemsize * width)
    rows = np.lib.stride_tricks.as_strided(
        np.frombuffer(binary, np.uint8, offset=start), (accessor["count"], kind.itemsize * width), (stride, 1))
    array = np.ascontiguousarray(rows).view(kind).reshape(accessor["count"], width)
    if accessor.get("normalized"):
        array = array.astype(np.float64) / np.iinfo(kind).max
    return array.astype(np.float64) if kind == np.float32 else array


def matrix(node, keyed):
    if "matrix" in node:
        return np.array(node["matrix"]).reshape(4, 4).T
    x, y, z, w = keyed.get("rotation", node.get("rotation", [0, 0, 0, 1]))
    turn = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
    out = np.eye(4)
    out[:3, :3] = turn * np.array(keyed.get("scale", node.get("scale", [1, 1, 1])))
    out[:3, 3] = keyed.get("translation", node.get("translation", [0, 0, 0]))
    return out


def between(times, keys, time, kind, ease):
    if ease == "CUBICSPLINE":
        keys = keys.reshape(len(times), 3, -1)[:, 1]  # only asked at its own keys
    at = np.clip(np.searchsorted(times, time, "right") - 1, 0, len(times) - 1)
    if at == len(times) - 1 or ease == "STEP":
        return keys[at]
    share = np.clip((time - times[at]) / (times[at + 1] - times[at]), 0, 1)
    a, b = keys[at], keys[at + 1]
    if kind == "rotation":
        b = b if a @ b >= 0 else -b
        angle = np.arccos(np.clip(a @ b, -1, 1))
        if angle > 1e-6:
            return (np.sin((1 - share) * angle) * a + np.sin(share * angle) * b) / np.sin(angle)
    out = (1 - share) * a + share * b
    return out / np.linalg.norm(out) if kind == "rotation" else out


animation = gltf["animations"][0]
channels = [(c["target"]["node"], c["target"]["path"], values(animation["samplers"][c["sampler"]]["input"])[:, 0],
             values(animation["samplers"][c["sampler"]]["output"]), animation["samplers"][c["sampler"]].get("interpolation", "LINEAR"))
            for c in animation["channels"]]
times = np.unique(np.concatenate([c[2] for c in channels]))
times = times[np.unique(np.linspace(0, len(times) - 1, wanted).round().astype(int))]
parents = {child: index for index, node in enumerate(gltf["nodes"]) for child in node.get("children", [])}
instance = next(node for node in gltf["nodes"] if "skin" in node)
skin, parts = gltf["skins"][instance["skin"]], gltf["meshes"][instance["mesh"]]["primitives"]
bind = values(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
points = np.concatenate([values(p["attributes"]["POSITION"]) for p in parts])
joints = np.concatenate([np.concatenate([values(p["attributes"][f"JOINTS_{i}"]) for i in range(8) if f"JOINTS_{i}" in p["attributes"]], 1) for p in parts])
weights = np.concatenate([np.concatenate([values(p["attributes"][f"WEIGHTS_{i}"]) for i in range(8) if f"WEIGHTS_{i}" in p["attributes"]], 1) for p in parts])
weights = weights / weights.sum(1, keepdims=True)


def skinned(time):
    keyed = {}
    for node, kind, at, keys, ease in channels:
        keyed.setdefault(node, {})[kind] = between(at, keys, time, kind, ease)
    world = {}

    def place(node):
        if node not in world:
            local = matrix(gltf["nodes"][node], keyed.get(node, {}))
            world[node] = place(parents[node]) @ local if node in parents else local
        return world[node]

    moves = np.array([place(node) @ b for node, b in zip(skin["joints"], bind)])
    blended = np.einsum("nk,nkij->nij", weights, moves[joints])
    return np.einsum("nij,nj->ni", blended[:, :3, :3], points) + blended[:, :3, 3]


bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.fps = 1000  # key times fall near whole frames; the rest is told by subframes
bpy.ops.import_scene.gltf(filepath=path, merge_vertices=False, disable_bone_shape=True)
mesh = next(o for o in bpy.data.objects if o.type == "MESH" and o.find_armature())
worst = 0.0
for time in times:
    frame = time * 1000
    scene.frame_set(int(frame), subframe=float(frame - int(frame)))
    evaluated = mesh.evaluated_get(bpy.context.evaluated_depsgraph_get())
    found = np.empty(len(evaluated.data.vertices) * 3)
    evaluated.data.vertices.foreach_get("co", found)
    place = np.array(evaluated.matrix_world)
    found = found.reshape(-1, 3) @ place[:3, :3].T + place[:3, 3]
    found = np.stack([found[:, 0], found[:, 2], -found[:, 1]], 1)  # Z up to Y up
    worst = max(worst, float(np.linalg.norm(found - skinned(time), axis=1).max()))
print(json.dumps({"file": os.path.basename(path), "times": len(times), "vertices": len(points),
                  "worst": worst / float(np.ptp(points[:, 1]))}), flush=True)
os._exit(0)  # Blender as a module can hang at exit

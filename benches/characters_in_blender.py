"""Weights of skinned characters beside those of their files: ours, and Blender's bone heat with tails that are guessed.

    BLENDER characters_in_blender.py RIGSMITH FILE.glb...

BLENDER is a Python with `bpy` 5.0.1, RIGSMITH the program. Blender gets the skinned surface welded, the joints that hold
skin and those above them. The end of a bone is the first child, the mean of all children, or the child with the most joints
below it; that of a last joint goes on as the bone before it. The error is the mean over the points of half the sum of
absolute differences of the weights."""
import json, os, struct, subprocess, sys, tempfile
from collections import defaultdict
import bpy
import numpy as np

KINDS = {5120: "i1", 5121: "u1", 5122: "i2", 5123: "u2", 5125: "u4", 5126: "f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class File:
    """The skinned points of a binary glTF file at rest, with their weights over its nodes."""

    def __init__(self, path):
        data = open(path, "rb").read()
        length = struct.unpack("<I", data[12:16])[0]
        self.json, self.bytes = json.loads(data[20 : 20 + length]), data[28 + length :]
        nodes = self.json["nodes"]
        self.names = [node.get("name", str(at)) for at, node in enumerate(nodes)]
        self.parents = [-1] * len(nodes)
        for at, node in enumerate(nodes):
            for child in node.get("children", []):
                self.parents[child] = at
        globals_ = [self.matrix(at) for at in range(len(nodes))]
        self.heads = np.array([matrix[:3, 3] for matrix in globals_])
        self.points, self.rows, self.triangles = [], [], []
        for node in nodes:
            if "mesh" in node and "skin" in node:
                for primitive in self.json["meshes"][node["mesh"]]["primitives"]:
                    self.add(primitive, self.json["skins"][node["skin"]], globals_)
        self.points = np.array(self.points)

    def matrix(self, at):
        node = self.json["nodes"][at]
        if "matrix" in node:
            local = np.array(node["matrix"], float).reshape(4, 4).T
        else:
            x, y, z, w = node.get("rotation", [0, 0, 0, 1])
            local = np.eye(4)
            local[:3, :3] = np.array([
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]) * np.array(node.get("scale", [1, 1, 1]))
            local[:3, 3] = node.get("translation", [0, 0, 0])
        return local if self.parents[at] < 0 else self.matrix(self.parents[at]) @ local

    def numbers(self, at):
        accessor = self.json["accessors"][at]
        view = self.json["bufferViews"][accessor["bufferView"]]
        kind, width = np.dtype("<" + KINDS[accessor["componentType"]]), WIDTHS[accessor["type"]]
        strides = (view.get("byteStride", kind.itemsize * width), kind.itemsize)
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        found = np.ndarray((accessor["count"], width), kind, self.bytes, start, strides)
        return found / np.iinfo(kind).max if accessor.get("normalized") else found

    def add(self, primitive, skin, globals_):
        attributes = primitive["attributes"]
        if "JOINTS_0" not in attributes:
            return
        points = self.numbers(attributes["POSITION"]).astype(float)
        points = np.c_[points, np.ones(len(points))]
        inverses = self.numbers(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
        moves = np.array([globals_[node] @ inverses[at] for at, node in enumerate(skin["joints"])])
        rows, places, sums = [defaultdict(float) for _ in points], np.zeros((len(points), 3)), np.zeros(len(points))
        for layer in range(8):
            if f"JOINTS_{layer}" not in attributes:
                break
            joints = self.numbers(attributes[f"JOINTS_{layer}"]).astype(int)
            weights = self.numbers(attributes[f"WEIGHTS_{layer}"]).astype(float)
            for joint, weight in zip(joints.T, weights.T):
                places += weight[:, None] * np.einsum("nij,nj->ni", moves[joint], points)[:, :3]
                sums += weight
                for point in np.nonzero(weight > 0)[0]:
                    rows[point][skin["joints"][joint[point]]] += weight[point]
        first = len(self.points)
        self.points += list(places / sums[:, None])
        self.rows += [{joint: weight / total for joint, weight in row.items()} for row, total in zip(rows, sums)]
        corners = np.arange(len(points))
        if "indices" in primitive:
            corners = self.numbers(primitive["indices"]).ravel().astype(int)
        self.triangles += (corners[: len(corners) // 3 * 3].reshape(-1, 3) + first).tolist()


def difference(a, b):
    return sum(abs(a.get(joint, 0) - b.get(joint, 0)) for joint in a.keys() | b.keys()) / 2


def ours(rigsmith, path, file):
    """Rows of the program for each point, found by place and by names of joints."""
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, "skinned.glb")
        subprocess.run([rigsmith, "skin", path, path, "-o", out], check=True, capture_output=True)
        bound = File(out)
    of = {name: at for at, name in enumerate(file.names)}
    nearest = (int(np.argmin(((bound.points - point) ** 2).sum(1))) for point in file.points)
    return [{of[bound.names[joint]]: weight for joint, weight in bound.rows[at].items()} for at in nearest]


def blenders(file, guess):
    """Rows of Blender's automatic weights for each point."""
    size = np.ptp(file.points, axis=0).max()
    keys = np.round(file.points / size * 2e5).astype(np.int64)
    _, first, place = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    place = place.ravel()
    needed = {joint for row in file.rows for joint in row}
    for joint in list(needed):
        while file.parents[joint] >= 0:
            joint = file.parents[joint]
            needed.add(joint)
    needed, heads = sorted(needed), file.heads
    children = {joint: [other for other in needed if file.parents[other] == joint] for joint in needed}
    apart = lambda a, b: np.linalg.norm(heads[a] - heads[b]) > 1e-4 * size
    below = lambda joint: 1 + sum(below(child) for child in children[joint])

    def tail(joint):
        ends = [child for child in children[joint] if apart(child, joint)]
        if ends and guess == "mean":
            return np.mean(heads[ends], 0)
        if ends:
            return heads[max(ends, key=below) if guess == "largest" else ends[0]]
        above = file.parents[joint]
        while above >= 0 and not apart(above, joint):
            above = file.parents[above]
        return 2 * heads[joint] - heads[above] if above >= 0 else heads[joint] + [0, 0.05 * size, 0]

    bpy.ops.wm.read_factory_settings(use_empty=True)
    faces = [[int(place[corner]) for corner in triangle] for triangle in file.triangles]
    mesh = bpy.data.meshes.new("surface")
    mesh.from_pydata([tuple(point) for point in file.points[first]], [], [f for f in faces if len(set(f)) == 3])
    body = bpy.data.objects.new("surface", mesh)
    bpy.context.collection.objects.link(body)
    bpy.ops.object.armature_add(enter_editmode=True)
    armature = bpy.context.object
    bones = armature.data.edit_bones
    bones.remove(bones[0])
    made = {}
    for joint in needed:
        made[joint] = bones.new(f"j{joint}")
        made[joint].head, end = heads[joint], tail(joint)
        made[joint].tail = end if np.linalg.norm(end - heads[joint]) > 1e-5 * size else end + [0, 0.02 * size, 0]
    for joint in needed:
        if file.parents[joint] >= 0:
            made[joint].parent = made[file.parents[joint]]
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.ops.object.select_all(action="DESELECT")
    body.select_set(True)
    armature.select_set(True)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.parent_set(type="ARMATURE_AUTO")
    joint_of = {group.index: int(group.name[1:]) for group in body.vertex_groups}
    rows = []
    for vertex in mesh.vertices:
        total = sum(group.weight for group in vertex.groups) or 1
        rows.append({joint_of[group.group]: group.weight / total for group in vertex.groups if group.weight > 0})
    return [rows[at] for at in place]


rigsmith, *paths = sys.argv[1:]
for path in paths:
    file = File(path)
    error = lambda rows: float(np.mean([difference(row, true) for row, true in zip(rows, file.rows)]))
    found = {"file": os.path.basename(path), "points": len(file.points), "ours": round(error(ours(rigsmith, path, file)), 4)}
    for guess in ["first", "mean", "largest"]:
        found[f"blender, {guess}"] = round(error(blenders(file, guess)), 4)
    print(json.dumps(found), flush=True)
os._exit(0)  # Blender as a module can hang at exit

"""Foot slide of a retargeted walk beside Blender's own way: Copy Rotation constraints on the same skeleton.

    python retarget_in_blender.py ANIMATED.glb CLIP.bvh MAP.ron

ANIMATED.glb and MAP.ron come from `rigsmith animate RIG CLIP.bvh --mesh BODY --map-out MAP.ron -o ANIMATED.glb`. The peer is
what a Blender user builds: the skeleton of the same file at rest; in the armature of the motion a bone for each mapped
joint, child of the joint that it follows and oriented as the joint is at rest; a Copy Rotation constraint on each joint, in
world space; Copy Location on the hips; and the armature of the motion scaled to the height of the hips. Both are measured at
the same frames: while the ball of the foot of the motion itself stands (slower than 0.2 heights a second over a tenth of a second, and at most
0.06 heights above its lowest place, for 0.15 seconds). Prints one JSON line; lengths are hundredths of the height of the hips over the feet.
"""
import json, os, re, sys
import bpy
import numpy as np
from mathutils import Matrix

animated, clip, map_file = sys.argv[1:4]
pairs = re.findall(r'\("([^"]+)",\s*"([^"]+)"\)', open(map_file).read())
text = open(clip).read()
frame_time = float(re.search(r"Frame Time:\s*([\d.eE+-]+)", text).group(1))
frame_count = int(re.search(r"Frames:\s*(\d+)", text).group(1))

bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.fps = round(1 / frame_time)
scene.render.fps_base = scene.render.fps * frame_time
rate = 1 / frame_time


def imported(call):
    before = set(bpy.data.objects)
    call()
    return [o for o in bpy.data.objects if o not in before]


def armature(objects):
    return next(o for o in objects if o.type == "ARMATURE")


ours = armature(imported(lambda: bpy.ops.import_scene.gltf(filepath=animated)))
peer = armature(imported(lambda: bpy.ops.import_scene.gltf(filepath=animated)))
for obj in (ours, peer):
    for track in list(obj.animation_data.nla_tracks) if obj is peer else []:
        obj.animation_data.nla_tracks.remove(track)
peer.animation_data.action = None
for bone in peer.pose.bones:
    bone.matrix_basis = Matrix()
source = armature(imported(lambda: bpy.ops.import_anim.bvh(filepath=clip, frame_start=0, use_fps_scale=False)))

targets = {}
for of, to in pairs:
    if of in source.data.bones and to in peer.data.bones:
        targets[to] = of
hips = next(to for of, to in pairs if to.startswith("hip"))
feet = {side: f"foot_{side}" for side in "lr"}
balls = {side: f"toe_{side}" for side in "lr"}


def rest(obj, bone):
    return obj.matrix_world @ obj.data.bones[bone].matrix_local


# The sizes are told by the hips over the feet at rest.
def hip_height(obj, names):
    hip, foot = (rest(obj, name).translation for name in names)
    return hip.z - foot.z


height = hip_height(peer, (hips, feet["l"]))
source.scale *= height / hip_height(source, (targets[hips], targets[feet["l"]]))
bpy.context.view_layer.update()

bpy.ops.object.select_all(action="DESELECT")
bpy.context.view_layer.objects.active = source
source.select_set(True)
bpy.ops.object.mode_set(mode="EDIT")
inverse = source.matrix_world.inverted()
for to, of in targets.items():
    bone = source.data.edit_bones.new("to " + to)
    bone.parent = source.data.edit_bones[of]
    wanted = rest(peer, to).to_3x3().to_4x4()
    wanted.translation = rest(source, of).translation
    bone.head, bone.tail = (0, 0, 0), (0, 0.1 / source.scale.x, 0)
    bone.matrix = (inverse @ wanted).normalized()
bpy.ops.object.mode_set(mode="OBJECT")
for to in targets:
    constraint = peer.pose.bones[to].constraints.new("COPY_ROTATION")
    constraint.target, constraint.subtarget = source, "to " + to
constraint = peer.pose.bones[hips].constraints.new("COPY_LOCATION")
constraint.target, constraint.subtarget = source, "to " + hips

places = {key: [] for key in ("source", "ours", "peer")}
for frame in range(frame_count):
    scene.frame_set(frame)
    graph = bpy.context.evaluated_depsgraph_get()
    for key, obj in (("source", source), ("ours", ours), ("peer", peer)):
        obj = obj.evaluated_get(graph)
        names = [targets.get(balls[s], targets[feet[s]]) if key == "source" else balls[s] for s in "lr"]
        places[key].append([list((obj.matrix_world @ obj.pose.bones[name].matrix).translation) for name in names])
places = {key: np.array(value) for key, value in places.items()}

slides = {"source": [], "ours": [], "peer": []}
rises = {"source": [], "ours": [], "peer": []}
spans = 0
for side in range(2):
    path = places["source"][:, side]
    # Captured places tremble: the speed is that over a tenth of a second.
    wide = max(1, round(0.05 * rate))
    padded = np.pad(path, ((wide, wide), (0, 0)), mode="edge")
    speed = np.linalg.norm(padded[2 * wide :] - padded[: -2 * wide], axis=1) * rate / (2 * wide)
    stands = (speed < 0.2 * height) & (path[:, 2] < path[:, 2].min() + 0.06 * height)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], stands.astype(int), [0]])))
    for start, end in zip(edges[::2], edges[1::2]):
        if (end - start) * frame_time < 0.15:
            continue
        spans += 1
        for key in slides:
            stretch = places[key][start:end, side]
            flat = stretch[:, :2]
            slides[key].append(float(np.linalg.norm(flat - flat[0], axis=1).max()))
            rises[key].append(float(np.ptp(stretch[:, 2])))
hundredths = lambda values: {"mean": round(100 * float(np.mean(values)) / height, 3), "worst": round(100 * float(np.max(values)) / height, 3)}
print(json.dumps({"clip": os.path.basename(clip), "stands": spans, "slide": {k: hundredths(v) for k, v in slides.items()},
                  "up_and_down": {k: hundredths(v) for k, v in rises.items()}}), flush=True)
os._exit(0)  # Blender as a module can hang at exit

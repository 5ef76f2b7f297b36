//! Avatars of placed models, of faces and of fitted bodies.

use super::*;

/// A head with ARKit's shapes on a body of few joints.
#[test]
fn faces_become_expressions() {
    let work = tempfile::tempdir().unwrap();
    let path = |name: &str| work.path().join(name);
    let (folder, _guard) = exports();
    let head = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/head.obj").display().to_string();
    json(work.path(), &["face", &head, "--arkit", "--all-joints", "-o", "head.glb"]);
    let human = on_a_body(load_model(&RealDisk, &path("head.glb")).unwrap());
    let settings = GltfWriteSettings { all_joints: true, bind_unweighted: true, ..GltfWriteSettings::default() };
    store_model(&RealDisk, &path("human.glb"), &human, &settings).unwrap();
    let vrm = folder.join("face.vrm");
    let output = vrm.display().to_string();
    let answer = json(work.path(), &["animate", "human.glb", "human.glb", "--author", "Ann Example", "-o", &output]);
    assert_eq!(answer["vrm"]["look_at"], "bone", "{answer}");
    let written = Written::read(&vrm);
    written.check_pose();
    let expressions = &written.vrm()["expressions"];
    let presets = expressions["preset"].as_object().unwrap();
    // A neutral face is a face at rest.
    let wanted: Vec<&str> = schema::PRESETS.into_iter().filter(|name| *name != "neutral").collect();
    let mut names: Vec<&str> = presets.keys().map(String::as_str).collect();
    names.sort_unstable();
    assert_eq!(names, wanted);
    assert_eq!(expressions["custom"].as_object().unwrap().len(), 51);

    // Binds have the morph targets that they mean.
    let model = load_model(&RealDisk, &vrm).unwrap();
    let targets = |expression: &Value| -> Vec<(String, f64)> {
        let binds = expression["morphTargetBinds"].as_array().unwrap().iter();
        let mut found: Vec<(String, f64)> = binds
            .map(|bind| {
                let mesh = written.document["nodes"][bind["node"].as_u64().unwrap() as usize]["mesh"].as_u64().unwrap();
                let names = &written.document["meshes"][mesh as usize]["extras"]["targetNames"];
                let name = names[bind["index"].as_u64().unwrap() as usize].as_str().unwrap().to_owned();
                (name, bind["weight"].as_f64().unwrap())
            })
            .collect();
        found.sort_by(|a, b| a.0.cmp(&b.0));
        found.dedup();
        found
    };
    let one = |name: &str| (name.to_owned(), 1.0);
    assert_eq!(targets(&presets["blink"]), [one("eyeBlinkLeft"), one("eyeBlinkRight")]);
    assert_eq!(targets(&presets["blinkLeft"]), [one("eyeBlinkLeft")]);
    assert_eq!(targets(&presets["lookLeft"]), [one("eyeLookInRight"), one("eyeLookOutLeft")]);
    assert!(targets(&presets["aa"]).iter().any(|(name, weight)| name == "jawOpen" && *weight > 0.0));
    assert!(targets(&presets["happy"]).iter().any(|(name, weight)| name == "mouthSmileLeft" && *weight == 1.0));
    assert_eq!(targets(&expressions["custom"]["jawOpen"]), [one("jawOpen")]);

    // The middle of the eyes in the head's space.
    let eyes = written.place("leftEye").midpoint(written.place("rightEye"));
    let offset = &written.vrm()["lookAt"]["offsetFromHeadBone"];
    let offset = Vec3::from_array([0, 1, 2].map(|at| offset[at].as_f64().unwrap() as f32));
    let head = written.globals[written.node("head")];
    assert!(head.transform_point(offset).distance(eyes) < 1e-4, "{offset}");
    assert!(model.objects.iter().any(|object| object.morph_names.len() == 51));
}

/// The model of a head below a trunk with limbs in an A-pose, with a clip that turns it.
fn on_a_body(mut head: Model) -> Model {
    let globals = at_rest(&head);
    let root = head.nodes.iter().position(|node| node.parent.is_none()).unwrap();
    assert_eq!(head.nodes.iter().filter(|node| node.parent.is_none()).count(), 1);
    let (low, high) = lowest(&head.points);
    let (base, size) = (globals[root].translation, high - low);
    let at = |x: f32, y: f32, z: f32| base + Vec3::new(x, y, z) * size;
    let (hips, spine) = (at(0.0, -2.0, 0.0), at(0.0, -1.4, 0.0));
    let node = |name: &str, parent: Option<usize>, place: Vec3, above: Vec3| Node {
        name: name.to_owned(),
        parent,
        rest: Trs { translation: place - above, ..Trs::IDENTITY },
        joint: true,
        ..Node::default()
    };
    let mut nodes = vec![node("hips", None, hips, Vec3::ZERO), node("spine", Some(0), spine, hips)];
    for mut own in head.nodes.drain(..) {
        own.parent = Some(own.parent.map_or(1, |parent| parent + 2));
        if own.parent == Some(1) {
            own.rest.translation -= spine;
        }
        nodes.push(own);
    }
    for (side, x) in [("l", 1.0), ("r", -1.0)] {
        let arm = [
            ("upper_arm", at(0.5 * x, -0.2, 0.0)),
            ("forearm", at(1.2 * x, -0.9, 0.0)),
            ("hand", at(1.8 * x, -1.5, 0.1)),
        ];
        let leg =
            [("thigh", at(0.3 * x, -2.1, 0.0)), ("shin", at(0.4 * x, -3.6, 0.05)), ("foot", at(0.4 * x, -5.0, 0.0))];
        for (chain, mut parent, mut above) in [(arm, 1, spine), (leg, 0, hips)] {
            for (name, place) in chain {
                nodes.push(node(&format!("{name}_{side}"), Some(parent), place, above));
                (parent, above) = (nodes.len() - 1, place);
            }
        }
    }
    head.nodes = nodes;
    for joint in head.skins.iter_mut().flat_map(|skin| &mut skin.joints) {
        *joint += 2;
    }
    for joint in head.weights.iter_mut().flat_map(|weights| &mut weights.joints) {
        *joint += 2;
    }
    // Bodies have a skin, whose joints are those of the head; further joints are listed so that readers know them.
    let globals = at_rest(&head);
    for (at, global) in globals.iter().enumerate() {
        if !head.skins[0].joints.contains(&at) {
            head.skins[0].joints.push(at);
            head.skins[0].inverse_binds.push(Mat4::from(global.affine()).inverse());
        }
    }
    let half = (0.15_f32).sin_cos();
    head.clips = vec![Clip {
        name: "nod".to_owned(),
        channels: vec![Channel {
            target: ChannelTarget::Rotation(1),
            interpolation: Interpolation::Linear,
            times: vec![0.0, 0.5],
            values: vec![0.0, 0.0, 0.0, 1.0, half.0, 0.0, 0.0, half.1],
        }],
        extras: None,
    }];
    head
}

#[test]
fn placed_models_look_as_before() {
    let work = tempfile::tempdir().unwrap();
    // A scaled root and a scaled arm, so that spaces differ.
    let scaled = FIGURE
        .replacen(
            r#"(label: "hips", translation: (0, 1, 0))"#,
            r#"(label: "hips", translation: (0, 1, 0), scale: (2, 2, 2))"#,
            1,
        )
        .replacen("translation: (0.15, 0.15, 0))", "translation: (0.15, 0.15, 0), scale: (0.5, 0.5, 0.5))", 1);
    fs::write(work.path().join("figure.rig.ron"), scaled).unwrap();
    json(work.path(), &["build", "figure.rig.ron", "--all-joints", "-o", "a.glb"]);
    let mut model = load_model(&RealDisk, &work.path().join("a.glb")).unwrap();
    assert!(model.nodes.iter().any(|node| node.rest.scale != Vec3::ONE));
    let node = |name: &str| model.nodes.iter().position(|node| node.name == name).unwrap();
    let channel = |target, interpolation, values: &[f32]| Channel {
        target,
        interpolation,
        times: vec![0.0, 1.0],
        values: values.to_vec(),
    };
    let channels = vec![
        channel(
            ChannelTarget::Translation(node("hips")),
            Interpolation::CubicSpline,
            &[0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.5, -1.0, 2.0, 0.0, 1.0, 0.5, 1.2, 0.3, 0.0, 0.0, 0.0],
        ),
        channel(
            ChannelTarget::Rotation(node("hips")),
            Interpolation::Linear,
            &[0.0, 0.0, 0.0, 1.0, 0.0, 0.6, 0.0, 0.8],
        ),
        channel(
            ChannelTarget::Translation(node("forearm_l")),
            Interpolation::Linear,
            &[0.2, -0.2, 0.0, 0.3, 0.1, 0.05],
        ),
        channel(ChannelTarget::Scale(node("upper_arm_l")), Interpolation::Linear, &[0.5, 0.5, 0.5, 1.5, 1.5, 1.5]),
        channel(
            ChannelTarget::Rotation(node("upper_arm_l")),
            Interpolation::Step,
            &[0.0, 0.0, 0.0, 1.0, 0.6, 0.0, 0.0, 0.8],
        ),
    ];
    model.clips = vec![Clip { name: "move".to_owned(), channels, extras: None }];
    let by = Similarity {
        scale: 0.1,
        rotation: Quat::from_axis_angle(Vec3::new(1.0, 2.0, -0.5).normalize(), 1.1),
        translation: Vec3::new(3.0, -1.0, 2.0),
    };
    let mut placed = model.clone();
    placed.place(&by);
    assert!(placed.nodes.iter().all(|node| node.rest.scale == Vec3::ONE));
    let motions = [motion_of(&model, &model.clips[0]), motion_of(&placed, &placed.clips[0])];
    for time in [0.0, 0.25, 0.9, 1.0] {
        let [was, is] = [&motions[0], &motions[1]].map(|motion| motion.globals_at(time));
        for (at, (was, is)) in was.iter().zip(&is).enumerate() {
            let off = by.point(was.translation).distance(is.translation);
            assert!(off < 1e-4, "{} at {time}: {off}", model.nodes[at].name);
        }
        // What is bound to a joint moves with it.
        let skins = [&model.skins[0], &placed.skins[0]];
        for (slot, joint) in skins[0].joints.iter().enumerate() {
            let point = Vec3::new(0.2, 0.7, -0.1);
            let before = was[*joint].affine() * Affine3A::from_mat4(skins[0].inverse_binds[slot]);
            let after = is[*joint].affine() * Affine3A::from_mat4(skins[1].inverse_binds[slot]);
            let off = by.point(before.transform_point3(point)).distance(after.transform_point3(by.point(point)));
            assert!(off < 1e-3, "{} at {time}: {off}", model.nodes[*joint].name);
        }
    }
}

/// Bodies that the template was fitted into, for the validator.
#[test]
fn fitted_bodies_are_avatars() {
    let Some(data) = test_data() else { return };
    let (folder, _guard) = exports();
    for name in ["male_young", "female_heavy_tpose"] {
        let body = data.join("bodies").join(name).join("body.obj").display().to_string();
        let vrm = folder.join(format!("fit_{name}.vrm"));
        let output = vrm.display().to_string();
        let answer = json(&folder, &["fit", &body, "--template", "biped", "--author", "Ann Example", "-o", &output]);
        assert_eq!(answer["vrm"]["authors"][0], "Ann Example");
        Written::read(&vrm).check_pose();
        let model = load_model(&RealDisk, &vrm).unwrap();
        let (low, high) = lowest(&skinned(&model, &at_rest(&model)));
        assert!(low.abs() < 5e-3 * (high - low), "{name} stands on the ground: {low}");
    }
}

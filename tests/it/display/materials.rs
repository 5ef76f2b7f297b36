//! Materials, pictures and broken numbers of a displayed mesh.

use super::*;

#[test]
fn pictures_go_with_their_meshes() {
    let (mut bench, _) = held_bench();
    bench.show(MeshDisplay { wireframe: true, ..default() });
    bench.mesh_mut().remove::<RigMesh>();
    bench.app.update();
    bench.app.update();
    for kind in [DisplayPiece::Surface, DisplayPiece::Edges] {
        assert!(bench.entities(kind).is_empty());
    }
    let (mut bench, _) = held_bench();
    let rig = bench.rig;
    bench.app.world_mut().despawn(rig);
    bench.app.update();
    assert!(bench.entities(DisplayPiece::Surface).is_empty());
}

/// Two by two pixels.
const PNG: [u8; 75] = [
    137, 80, 78, 71, 13, 10, 26, 10, 0, 0, 0, 13, 73, 72, 68, 82, 0, 0, 0, 2, 0, 0, 0, 2, 8, 2, 0, 0, 0, 253, 212, 154,
    115, 0, 0, 0, 18, 73, 68, 65, 84, 120, 156, 99, 248, 207, 192, 192, 0, 194, 12, 255, 129, 0, 0, 31, 238, 5, 251,
    11, 217, 104, 139, 0, 0, 0, 0, 73, 69, 78, 68, 174, 66, 96, 130,
];

fn textured(bytes: Vec<u8>) -> Model {
    let mut model = field(2);
    model.parts[0].uvs = vec![vec![Vec2::ZERO; 9]];
    model.parts[0].material = Some(0);
    model.material_set.images = vec![ModelImage { name: "skin.png".into(), bytes, ..default() }];
    model.material_set.textures = vec![json!({ "source": 0 })];
    model.material_set.materials = vec![json!({
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.5, 0.25, 1.0, 0.5],
            "baseColorTexture": { "index": 0 },
            "metallicFactor": 0.25,
        },
        "emissiveFactor": [1.0, 0.5, 0.0],
        "alphaMode": "MASK",
        "alphaCutoff": 0.75,
        "doubleSided": true,
        "extensions": { "KHR_materials_unlit": {}, "KHR_materials_emissive_strength": { "emissiveStrength": 2.0 } },
    })];
    model
}

#[test]
fn materials_are_the_files() {
    let mut bench = Bench::new(textured(PNG.to_vec()));
    let material = bench.materials().swap_remove(0);
    assert_eq!(material.base_color.to_linear(), LinearRgba::new(0.5, 0.25, 1.0, 0.5));
    assert_eq!((material.metallic, material.perceptual_roughness), (0.25, 1.0));
    assert_eq!(material.emissive, LinearRgba::rgb(2.0, 1.0, 0.0));
    assert_eq!(material.alpha_mode, AlphaMode::Mask(0.75));
    assert!(material.double_sided && material.cull_mode.is_none() && material.unlit);
    let images = bench.app.world().resource::<Assets<Image>>();
    let image = images.get(&material.base_color_texture.unwrap()).expect("the texture is there");
    assert_eq!((image.width(), image.height(), image.texture_descriptor.mip_level_count), (2, 2, 2));
    assert_eq!(image.data.as_ref().map(Vec::len), Some(4 * 5));

    bench.show(MeshDisplay { xray: true, ..default() });
    let material = bench.materials().swap_remove(0);
    // Sums of light do not depend on the order of triangles; what is black in the file is seen by its own light.
    assert!(material.base_color.alpha() < 0.5 && material.alpha_mode == AlphaMode::Add);
    assert!(material.emissive.red > 0.0 && material.emissive_texture.is_none());
    bench.show(MeshDisplay { weights: WeightColors::AllJoints, ..default() });
    assert!(bench.materials().swap_remove(0).base_color_texture.is_none());
}

#[test]
fn broken_images_are_noted_and_left_out() {
    let mut huge = PNG.to_vec();
    huge[16..24].copy_from_slice(&[0, 0, 250, 0, 0, 0, 250, 0]);
    let mut cut = PNG.to_vec();
    cut.truncate(50);
    let cases = [(Vec::new(), "not found"), (b"GIF89a".to_vec(), "neither"), (cut, "skin.png"), (huge, "256 MiB")];
    for (bytes, wanted) in cases {
        let mut bench = Bench::new(textured(bytes));
        assert!(bench.materials().swap_remove(0).base_color_texture.is_none());
        let notes = &bench.app.world().resource::<Notes>().0;
        assert!(notes.len() == 1 && notes[0].contains(wanted), "{wanted}: {notes:?}");
    }
}

#[test]
fn wrong_numbers_draw_nothing_and_break_nothing() {
    let mut bench = Bench::new(field(1));
    let mut broken = RigMesh::new(MESH, field(2), Vec::new());
    let mut model = field(2);
    model.parts[0].triangles.push([0, 1, 99]);
    model.parts[0].vertices[8] = 4000;
    model.parts[0].material = Some(7);
    broken.rest = Arc::new(model);
    bench.mesh_mut().insert(broken);
    bench.settle();
    // The corner that is gone belongs to one quad, and two triangles met there.
    assert_eq!(triangles(&bench.meshes(DisplayPiece::Surface)), 8 - 2);
    let joints = bench.chain(&[[0.0; 3], [0.0, 1.0, 0.0]]);
    let mut weights = Weights::default();
    weights.push([(77, 1.0)]);
    bench.bind(SkinData { joints, weights, at_rest: true, ..Default::default() });
    bench.show(MeshDisplay { wireframe: true, weights: WeightColors::AllJoints, ..default() });
    assert_eq!(triangles(&bench.meshes(DisplayPiece::Surface)), 8 - 2);
}

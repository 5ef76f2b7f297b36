//! Files of templates that are saved in every way, whole and broken.

use super::*;

/// True once the app has told that the file is broken.
static BROKEN_SEEN: AtomicBool = AtomicBool::new(false);

/// Longest time of a save whose writer ran without long interruptions.
const UNDISTURBED: Duration = Duration::from_millis(250);

/// Writes in pieces, with a pause after each.
fn slowly(path: &Path, text: &str, pause: u64) {
    use std::io::Write as _;
    let mut file = fs::File::create(path).unwrap();
    for piece in text.as_bytes().chunks(text.len() / 4 + 1) {
        sleep(Duration::from_millis(pause));
        file.write_all(piece).unwrap();
        file.flush().unwrap();
    }
}

#[test]
fn a_file_is_taken_over_once_however_it_is_saved() {
    let patterns: [(&str, fn(&Path, &str)); 12] = [
        ("in place", |path, text| fs::write(path, text).unwrap()),
        ("emptied, and filled after a pause", |path, text| {
            fs::write(path, "").unwrap();
            sleep(Duration::from_millis(120));
            fs::write(path, text).unwrap();
        }),
        ("slowly", |path, text| slowly(path, text, 40)),
        ("beside and renamed", |path, text| {
            fs::write(path.with_extension("tmp"), text).unwrap();
            fs::rename(path.with_extension("tmp"), path).unwrap();
        }),
        ("renamed from an old file", |path, text| {
            let beside = path.with_extension("old");
            fs::write(&beside, text).unwrap();
            let old = fs::File::options().write(true).open(&beside).unwrap();
            old.set_modified(std::time::SystemTime::now() - Duration::from_secs(86_400)).unwrap();
            sleep(Duration::from_millis(50));
            fs::rename(beside, path).unwrap();
        }),
        ("moved away and written anew, as vim does", |path, text| {
            let backup = path.with_file_name("t.rig.ron~");
            fs::rename(path, &backup).unwrap();
            sleep(Duration::from_millis(15));
            fs::write(path, text).unwrap();
            fs::remove_file(backup).unwrap();
        }),
        ("with a lock and a backup, as emacs does", |path, text| {
            let (lock, backup) = (path.with_file_name(".#t.rig.ron"), path.with_file_name("t.rig.ron~"));
            fs::write(&lock, "").unwrap();
            fs::copy(path, backup).unwrap();
            fs::write(path, text).unwrap();
            fs::remove_file(lock).unwrap();
        }),
        ("with a backup that is another template", |path, text| {
            fs::write(path.with_file_name("t.rig.ron~"), "(format: 2)").unwrap();
            fs::write(path, text).unwrap();
        }),
        ("twenty times in a row", |path, text| {
            for number in 0..20 {
                fs::write(path, if number % 2 == 0 { "(format: 2, na" } else { &text[..text.len() - 3] }).unwrap();
                sleep(Duration::from_millis(3));
            }
            fs::write(path, text).unwrap();
        }),
        ("deleted and made again", |path, text| {
            fs::remove_file(path).unwrap();
            sleep(Duration::from_millis(60));
            fs::write(path, text).unwrap();
        }),
        ("copied over a network", |path, text| {
            // The time of the file is that of the source, and so it may stand still.
            let time = fs::metadata(path).unwrap().modified().unwrap();
            slowly(path, text, 20);
            fs::File::options().write(true).open(path).unwrap().set_modified(time).unwrap();
        }),
        ("broken, then good", |path, text| {
            // Each is whole at once, so that nothing else is told however slow the machine is.
            save_whole(path, &text[..text.len() / 2]);
            while !BROKEN_SEEN.load(Ordering::Acquire) {
                sleep(Duration::from_millis(1));
            }
            save_whole(path, text);
        }),
    ];
    let folder = tempfile::tempdir().unwrap();
    let path = saved(folder.path(), TWO);
    let mut game = AppBench::live_game();
    let instance = game.open(&path, InstanceMode::Hierarchy);
    let (control, end) = (game.node(instance, "ctl_b"), game.node(instance, "a_end"));
    game.app.world_mut().get_mut::<Transform>(control).unwrap().translation.x += 0.25;
    let mut failed = 0;
    for (number, (name, save)) in patterns.iter().enumerate() {
        let height = 1.0 + number as f32 * 0.25;
        let text = TWO.replace("(0, 1, 0)", &format!("(0, {height:?}, 0)"));
        let text = if number == 0 { text.replace("two", "three") } else { text };
        let (path, text, save) = (path.clone(), text, *save);
        let is_broken = *name == "broken, then good";
        BROKEN_SEEN.store(false, Ordering::Release);
        let writer = std::thread::spawn(move || {
            let start = Instant::now();
            save(&path, &text);
            start.elapsed()
        });
        if is_broken {
            game.until(name, |told| told.failed.len() > failed);
            BROKEN_SEEN.store(true, Ordering::Release);
        }
        game.until(name, |told| told.updated.len() == number + 1);
        let took = writer.join().unwrap();
        // Nothing comes after it.
        game.go_on(Duration::from_millis(60));
        assert_eq!(game.instance_report().updated.len(), number + 1, "{name}");
        // A writer that the machine stopped in the middle of a file leaves a broken file, which is told.
        if is_broken {
            assert_eq!(game.instance_report().failed.len(), failed + 1, "{name}: {:?}", game.instance_report().failed);
        } else if took < UNDISTURBED {
            assert_eq!(game.instance_report().failed.len(), failed, "{name}: {:?}", game.instance_report().failed);
        }
        failed = game.instance_report().failed.len();
        let world = game.app.world();
        let place = world.get::<GlobalTransform>(end).unwrap().translation();
        assert!((place.y - height - 0.5).abs() < 1e-5, "{name}: {place}");
        let posed = world.get::<GlobalTransform>(control).unwrap().translation();
        assert!((posed.x - 1.25).abs() < 1e-5, "{name}: the pose stays, {posed}");
    }
    let told = game.instance_report().failed.last().unwrap();
    assert!(told.contains("t.rig.ron") && told.contains("line "), "{told}");
}

#[test]
fn a_thousand_broken_saves_change_nothing_and_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let mut game = AppBench::still_game();
    let instance = game.open(&saved(folder.path(), CHAIN), InstanceMode::Direct);
    game.app.update();
    let before = game.places(instance);
    let mut mutator = Mutator::new(7, &[b"joints", b"(", b"]"], 1 << 16);
    let dice = &mut Dice(UidSource::seeded(8));
    let broken = (0..).map(|number: u32| match number % 4 {
        // Cut short, mutated, a command that fails, another uid twice.
        0 => CHAIN.as_bytes()[..dice.below(CHAIN.len() as u64 - 3) as usize].to_vec(),
        1 => mutator.mutate(CHAIN.as_bytes(), TWO.as_bytes()),
        2 => CHAIN.replace("shape: \"cube\"", &format!("shape: \"no such shape {number}\"")).into_bytes(),
        _ => CHAIN.replace("parent: \"tail_1\"", &format!("parent: \"tail_{number}\"")).into_bytes(),
    });
    let mut count = 0;
    for content in broken {
        // A mutation may be a good file after all.
        if read_template(&content).is_ok() && !content.windows(7).any(|text| text == b"no such") {
            continue;
        }
        game.offer(instance, &content);
        count += 1;
        game.until("the report", |told| told.failed.len() == count);
        if count == 1000 {
            break;
        }
    }
    assert_eq!(game.instance_report().failed.len(), 1000);
    assert!(game.instance_report().updated.is_empty());
    assert!(game.instance_report().failed.iter().all(|told| told.contains("line ")), "each has a place");
    assert_eq!(game.places(instance), before);
    game.offer(instance, CHAIN.replace("(0, 1, 0)", "(0, 2, 0)").as_bytes());
    game.until("the next good save", |told| told.updated.len() == 1);
    assert_eq!(game.instance_report().failed.len(), 1000);
    game.app.update();
    assert_ne!(game.places(instance), before);
}

//! Remote calls: any body gets an answer, the app changes only where the answer is no error, and no file outside of the folder is
//! touched.

use std::{
    fs,
    io::{Read, Write},
    net::{SocketAddr, TcpStream},
    path::{Path, PathBuf},
    sync::{
        atomic::{AtomicU64, Ordering},
        mpsc,
    },
    thread,
    time::{Duration, Instant},
};

use bevy::prelude::*;
use rigsmith::{
    headless::headless_app,
    instance::RigInstancePlugin,
    plugins::commands::RigModules,
    remote::{RemotePlugin, RemoteSettings},
    rig::{Rig, template::write_template},
    test_app::strict_app,
};
use serde_json::Value;

use super::{edits::bytes, limited};
use crate::generate::{Choices, calls::call, template::template};

const TOKEN: &str = "a-token-for-tests-only";

/// Calls of one input, at most.
const MOST: usize = 12;

/// Wait that only an app reaches that never answers.
const HANG: Duration = Duration::from_secs(60);

/// Error code of a call that the app did not answer in time.
const TIMEOUT: i64 = -32004;

/// Folder that is removed again.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Self {
        static NUMBER: AtomicU64 = AtomicU64::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("rigsmith-calls-{}-{number}", std::process::id()));
        fs::create_dir_all(path.join("allowed/sub")).expect("a folder for files");
        Self(path)
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.0.join(name), text).expect("a file");
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// An app that answers calls.
struct RemoteApp {
    app: App,
    address: SocketAddr,
}

impl RemoteApp {
    fn new(folder: &Path) -> Self {
        let settings = RemoteSettings {
            token: Some(TOKEN.to_owned()),
            folders: vec![folder.join("allowed")],
            read_timeout: HANG,
            answer_timeout: HANG / 3,
            ..default()
        };
        let remote = RemotePlugin::bind(settings).expect("a free port");
        let address = remote.address();
        let mut app = headless_app(1);
        app.insert_resource(RigModules(limited()));
        app.add_plugins((RigInstancePlugin::default(), remote));
        Self { app: strict_app(app), address }
    }

    /// Sends a body and runs frames until the answer has come.
    fn post(&mut self, body: &str) -> Value {
        let head = format!(
            "POST / HTTP/1.1\r\nHost: {}\r\nAuthorization: Bearer {TOKEN}\r\nContent-Length: {}\r\n\r\n",
            self.address,
            body.len()
        );
        let (told, answer) = mpsc::channel();
        let (address, sent) = (self.address, head + body);
        let client = thread::spawn(move || {
            let mut stream = TcpStream::connect(address).expect("a connection");
            stream.set_read_timeout(Some(HANG)).expect("a timeout");
            let _ = stream.write_all(sent.as_bytes());
            let mut bytes = Vec::new();
            let _ = stream.read_to_end(&mut bytes);
            let _ = told.send(String::from_utf8_lossy(&bytes).into_owned());
        });
        let start = Instant::now();
        let answer = loop {
            self.app.update();
            match answer.recv_timeout(Duration::from_millis(1)) {
                Ok(answer) => break answer,
                Err(mpsc::RecvTimeoutError::Timeout) => assert!(start.elapsed() < HANG, "no answer: {body}"),
                Err(mpsc::RecvTimeoutError::Disconnected) => panic!("the client has failed: {body}"),
            }
        };
        client.join().expect("a client");
        assert!(answer.starts_with("HTTP/1.1 200 OK\r\n"), "{answer}");
        let json = answer.split_once("\r\n\r\n").map(|(_, json)| json).unwrap_or_default();
        serde_json::from_str(json).unwrap_or_else(|error| panic!("{error}: {answer}"))
    }

    /// The documents, each with its entity.
    fn documents(&mut self) -> Vec<(Entity, Rig)> {
        let world = self.app.world_mut();
        let mut rigs = world.query::<(Entity, &Rig)>();
        let mut found: Vec<(Entity, Rig)> = rigs.iter(world).map(|(entity, rig)| (entity, rig.clone())).collect();
        found.sort_unstable_by_key(|(entity, _)| *entity);
        found
    }

    fn state(&mut self) -> Vec<(Entity, String)> {
        self.documents().into_iter().map(|(entity, rig)| (entity, bytes(&rig))).collect()
    }
}

/// Sends calls to an app.
pub fn check(bytes_of_choices: &[u8]) {
    let choices = &mut Choices::new(bytes_of_choices);
    let folder = Folder::new();
    for name in ["allowed/t.rig.ron", "allowed/u.rig.ron"] {
        folder.write(name, &template(choices, &limited(), false).text);
    }
    let secret = write_template(&Rig::default());
    folder.write("secret.rig.ron", &secret);
    let mut remote = RemoteApp::new(&folder.0);
    let load = r#"{"jsonrpc":"2.0","id":0,"method":"rig.template.load","params":{"path":"t.rig.ron"}}"#;
    remote.post(load);
    for number in 0..MOST as u64 {
        if choices.is_over() {
            break;
        }
        let documents = remote.documents();
        let at = choices.below(documents.len());
        let rig = documents.get(at).map(|(entity, rig)| (entity.to_bits(), rig));
        let body = call(choices, rig, &limited(), number);
        let before = remote.state();
        let answer = remote.post(&body);
        let is_error = answer.get("error").is_some();
        assert_ne!(is_error, answer.get("result").is_some(), "{answer}");
        if is_error {
            let code = answer["error"]["code"].as_i64();
            assert_ne!(code, Some(TIMEOUT), "{body}: {answer}");
            assert!(answer["error"]["message"].as_str().is_some_and(|text| !text.is_empty()), "{answer}");
            // A template that could not be loaded is gone in the next frame.
            remote.app.update();
            assert_eq!(remote.state(), before, "an error, but something changed: {body}: {answer}");
        }
    }
    assert_eq!(fs::read_to_string(folder.0.join("secret.rig.ron")).ok(), Some(secret), "a file outside was touched");
    let mut names: Vec<String> = fs::read_dir(&folder.0)
        .expect("the folder")
        .filter_map(|entry| Some(entry.ok()?.file_name().to_string_lossy().into_owned()))
        .collect();
    names.sort();
    assert_eq!(names, ["allowed", "secret.rig.ron"], "files outside of the folder");
}

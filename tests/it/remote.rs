//! Remote control of an app over its socket.

use std::{
    fs,
    io::{Read, Write},
    net::{Shutdown, SocketAddr, TcpStream},
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
        mpsc,
    },
    thread,
    time::{Duration, Instant},
};

use bevy::prelude::*;
use rigsmith::{
    headless::headless_app,
    instance::{RigInstancePlugin, RigSource},
    plugins::commands::BuildResult,
    prelude::*,
    remote::{RemoteError, RemotePlugin, RemoteServer, RemoteSettings},
    rig::template::{read_template, write_template},
    test_app::strict_app,
};
use serde_json::{Value, json};

use super::{
    bench::{AppBench, HANG},
    template_text::CHAIN,
};

const TOKEN: &str = "a-token-for-tests-only";

struct Remote {
    base: AppBench,
    address: SocketAddr,
    folder: tempfile::TempDir,
}

impl Remote {
    fn new() -> Self {
        Self::reading_for(HANG)
    }

    /// An app that refuses calls which do not arrive within a time.
    fn reading_for(read_timeout: Duration) -> Self {
        Self::timed(read_timeout, HANG)
    }

    fn timed(read_timeout: Duration, answer_timeout: Duration) -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("allowed")).unwrap();
        fs::write(folder.path().join("allowed/t.rig.ron"), CHAIN).unwrap();
        fs::write(folder.path().join("secret.rig.ron"), CHAIN).unwrap();
        let settings = RemoteSettings {
            token: Some(TOKEN.to_owned()),
            folders: vec![folder.path().join("allowed")],
            read_timeout,
            answer_timeout,
            ..default()
        };
        let remote = RemotePlugin::bind(settings).unwrap();
        let address = remote.address();
        assert!(address.ip().is_loopback());
        let mut app = headless_app(1);
        app.add_plugins((RigInstancePlugin::default(), remote));
        Self { base: AppBench::bare(strict_app(app)), address, folder }
    }

    fn file(&self, name: &str) -> std::path::PathBuf {
        self.folder.path().join("allowed").join(name)
    }

    /// Sends bytes from another thread, and runs frames until the answer has come.
    fn exchange(&mut self, send: impl FnOnce(TcpStream) -> String + Send + 'static) -> String {
        let (told, answer) = mpsc::channel();
        let address = self.address;
        let client = thread::spawn(move || {
            let stream = TcpStream::connect(address).unwrap();
            stream.set_read_timeout(Some(HANG)).unwrap();
            told.send(send(stream)).unwrap();
        });
        let answer = loop {
            self.base.app.update();
            match answer.recv_timeout(Duration::from_millis(1)) {
                Ok(answer) => break answer,
                Err(mpsc::RecvTimeoutError::Timeout) => {}
                Err(mpsc::RecvTimeoutError::Disconnected) => panic!("the client has failed"),
            }
        };
        client.join().unwrap();
        answer
    }

    fn post(&mut self, head: String, body: Vec<u8>) -> String {
        self.exchange(move |mut stream| {
            // A refused request may be answered before all of it is sent.
            let _ = stream.write_all(head.as_bytes()).and_then(|()| stream.write_all(&body));
            rest(stream)
        })
    }

    fn head(&self, length: usize) -> String {
        format!(
            "POST / HTTP/1.1\r\nHost: {}\r\nAuthorization: Bearer {TOKEN}\r\nContent-Length: {length}\r\n\r\n",
            self.address
        )
    }

    fn answer(&mut self, method: &str, params: Value) -> Value {
        let body = json!({"jsonrpc": "2.0", "id": 7, "method": method, "params": params}).to_string();
        let answer = self.post(self.head(body.len()), body.into_bytes());
        assert!(answer.starts_with("HTTP/1.1 200 OK\r\n"), "{answer}");
        let answer: Value = serde_json::from_str(answer.split_once("\r\n\r\n").unwrap().1).unwrap();
        assert_eq!((&answer["jsonrpc"], &answer["id"]), (&json!("2.0"), &json!(7)));
        answer
    }

    #[track_caller]
    fn call(&mut self, method: &str, params: Value) -> Value {
        let answer = self.answer(method, params);
        assert!(answer.get("error").is_none(), "{method}: {answer}");
        answer["result"].clone()
    }

    #[track_caller]
    fn refusal(&mut self, method: &str, params: Value) -> (i64, String) {
        let answer = self.answer(method, params);
        assert!(answer.get("result").is_none(), "{method}: {answer}");
        let error = &answer["error"];
        (error["code"].as_i64().unwrap(), error["message"].as_str().unwrap().to_owned())
    }

    fn text(&mut self, rig: &Value) -> String {
        self.call("rig.describe", json!({"rig": rig, "text": true}))["text"].as_str().unwrap().to_owned()
    }

    fn load(&mut self) -> Value {
        self.call("rig.template.load", json!({"path": "t.rig.ron"}))["rig"].clone()
    }
}

#[test]
fn a_call_may_wait_for_ever() {
    let mut remote = Remote::timed(Duration::MAX, Duration::MAX);
    assert!(remote.load().is_string() || remote.load().is_number(), "the call is answered");
}

fn rest(mut stream: TcpStream) -> String {
    let mut text = Vec::new();
    let _ = stream.read_to_end(&mut text);
    String::from_utf8_lossy(&text).into_owned()
}

fn entity(rig: &Value) -> Entity {
    Entity::from_bits(rig.as_u64().unwrap())
}

#[test]
fn every_verb_drives_a_running_app() {
    let mut remote = Remote::new();
    assert_eq!(remote.call("rig.list", json!({})), json!([]));
    let rig = remote.load();
    let listed = remote.call("rig.list", json!({}));
    assert_eq!(listed.as_array().unwrap().len(), 1);
    assert_eq!((&listed[0]["rig"], &listed[0]["joints"], &listed[0]["is_built"]), (&rig, &json!(3), &json!(true)));
    let name = listed[0]["name"].clone();

    let told = remote.call("rig.describe", json!({"rig": name}));
    let joints: Vec<&str> =
        told["joints"].as_array().unwrap().iter().map(|j| j["joint"]["label"].as_str().unwrap()).collect();
    assert_eq!(joints, ["tail_1", "tail_2", "tail_3"]);
    let commands = told["commands"].as_array().unwrap().len();
    assert!(commands > 0 && told["commands"][0]["state"] == "done");
    assert!(told["nodes"].as_array().unwrap().iter().any(|node| node["is_control"] == true));

    // An edit is a step, which can be undone.
    let before = remote.text(&rig);
    let tip = told["joints"][2]["joint"]["uid"].clone();
    let edited = remote.call("rig.edit", json!({"rig": rig, "edits": [{"SetLabel": [tip, "tip"]}]}));
    assert_eq!((&edited["changed"], &edited["step"]), (&json!(true), &json!("Remote edit")));
    assert!(remote.base.get::<Rig>(entity(&rig)).unwrap().find_label("tip").is_some());
    remote.call("rig.edit", json!({"rig": rig, "history": "undo"}));
    assert_eq!(remote.text(&rig), before);
    remote.call("rig.edit", json!({"rig": rig, "history": "redo"}));
    assert_ne!(remote.text(&rig), before);

    let ran = remote.call("rig.build", json!({"rig": rig, "restart": true}));
    assert_eq!((ran["executed"].as_array().unwrap().len(), &ran["cursor"]), (commands, &json!(commands)));
    assert_eq!(remote.call("rig.build", json!({"rig": rig}))["executed"], json!([]));
    assert_eq!(remote.call("rig.step", json!({"rig": rig, "to": "back"}))["cursor"], json!(commands - 1));
    assert_eq!(remote.call("rig.step", json!({"rig": rig, "to": "forward"}))["cursor"], json!(commands));
    assert_eq!(remote.call("rig.step", json!({"rig": rig, "to": 1}))["cursor"], json!(1));
    let nodes = |remote: &Remote| remote.base.get::<BuildResult>(entity(&rig)).unwrap().0.nodes.len();
    let few = nodes(&remote);
    assert_eq!(remote.call("rig.step", json!({"rig": rig, "to": "run"}))["cursor"], json!(commands));
    assert!(nodes(&remote) > few);

    // Saved over the text it came from, with its comments.
    let saved = remote.call("rig.template.save", json!({"rig": rig, "path": "copy.rig.ron"}));
    assert_eq!(saved["notes"], json!([]));
    let copy = fs::read_to_string(remote.file("copy.rig.ron")).unwrap();
    assert!(copy.contains("// half as big"), "{copy}");
    let saved_rig = write_template(&read_template(copy.as_bytes()).unwrap().rig);
    assert_eq!(saved_rig, write_template(remote.base.get::<Rig>(entity(&rig)).unwrap()));
    let base = |remote: &Remote| remote.base.get::<RigSource>(entity(&rig)).unwrap().base().unwrap().clone();
    assert!(base(&remote).find_label("tip").is_none());
    remote.call("rig.template.save", json!({"rig": rig}));
    assert_eq!(fs::read_to_string(remote.file("t.rig.ron")).unwrap(), copy);
    assert!(base(&remote).find_label("tip").is_some(), "the saved file is the base of the next update");
    assert_eq!(remote.call("rig.template.update", json!({"rig": rig}))["changes"], json!([]));

    // The file changes; what was changed here stays.
    let middle = told["joints"][1]["joint"]["uid"].clone();
    remote.call("rig.edit", json!({"rig": rig, "edits": [{"SetLocked": [middle, true]}]}));
    fs::write(remote.file("t.rig.ron"), copy.replace("(0, 1, 0)", "(0, 1.5, 0)")).unwrap();
    let text = remote.text(&rig);
    let offer = remote.call("rig.template.update", json!({"rig": rig, "dry_run": true}));
    assert_eq!(offer["changes"].as_array().unwrap().len(), 1, "{offer}");
    assert_eq!(remote.text(&rig), text, "nothing changes");
    let updated = remote.call("rig.template.update", json!({"rig": rig}));
    assert_eq!(updated["changes"], offer["changes"]);
    assert_eq!(updated["changes"][0]["field"], json!("translation"));
    let document = remote.base.get::<Rig>(entity(&rig)).unwrap();
    let root = document.joint(document.find_label("tail_1").unwrap()).unwrap();
    assert_eq!(root.data.rest.translation.y, 1.5);
    assert!(document.joint(serde_json::from_value(middle).unwrap()).unwrap().data.locked);
    assert_eq!(remote.call("rig.template.update", json!({"rig": rig}))["changes"], json!([]));
}

#[test]
fn a_conflict_is_decided_by_the_call() {
    for (take, height) in [("mine", 2.0), ("theirs", 1.5)] {
        let mut remote = Remote::new();
        let rig = remote.load();
        let root = remote.call("rig.describe", json!({"rig": rig}))["joints"][0]["joint"].clone();
        let mut rest = root["rest"].clone();
        rest["translation"] = json!([0.0, 2.0, 0.0]);
        remote.call("rig.edit", json!({"rig": rig, "edits": [{"SetRest": [root["uid"], rest]}]}));
        let file = CHAIN.replace("(0, 1, 0)", "(0, 1.5, 0)").replace("relative_size: 0.5", "relative_size: 0.75");
        fs::write(remote.file("t.rig.ron"), file).unwrap();
        let updated = remote.call("rig.template.update", json!({"rig": rig, "take": take}));
        assert_eq!(updated["changes"].as_array().unwrap().len(), 2);
        assert_eq!(updated["changes"][0]["conflict"], json!(true));
        let document = remote.base.get::<Rig>(entity(&rig)).unwrap();
        assert_eq!(document.joint(document.find_label("tail_1").unwrap()).unwrap().data.rest.translation.y, height);
        assert!(write_template(document).contains("0.75"));
    }
}

#[test]
fn a_field_of_a_part_that_changes_nothing_of_the_rig_is_taken_over() {
    let mut remote = Remote::new();
    let part = r#"(format: 2, name: "link", kind: "part", joints: [(label: "tip", tags: [control])])"#;
    let hand = r#"(
        format: 2,
        name: "hand",
        joints: [(label: "palm", tags: [control])],
        parts: [(part: "link.rig.ron", name: "index", parent: "palm")],
    )"#;
    fs::write(remote.file("link.rig.ron"), part).unwrap();
    fs::write(remote.file("t.rig.ron"), hand).unwrap();
    let rig = remote.load();
    let text = remote.text(&rig);
    let sided = hand.replace("parent: \"palm\"", "parent: \"palm\", mirror: true");
    fs::write(remote.file("t.rig.ron"), sided).unwrap();
    for dry_run in [true, false] {
        let updated = remote.call("rig.template.update", json!({"rig": rig, "dry_run": dry_run}));
        assert_eq!(updated["changes"][0]["field"], json!("part index mirror"), "{updated}");
    }
    assert_eq!(remote.text(&rig), text);
    assert!(remote.base.get::<RigSource>(entity(&rig)).unwrap().taken_over().parts[0].mirror);
    assert_eq!(remote.call("rig.template.update", json!({"rig": rig}))["changes"], json!([]));
}

#[test]
fn the_schema_names_every_method_and_its_parameters() {
    let mut remote = Remote::new();
    let rig = remote.load();
    let document = remote.call("rpc.discover", json!({}));
    assert_eq!(document["openrpc"], json!("1.3.2"));
    let methods = document["methods"].as_array().unwrap().clone();
    assert_eq!(methods.len(), 9);
    for method in methods {
        let name = method["name"].as_str().unwrap();
        // Each parameter that the schema has is known, and one that it has not is refused.
        for param in method["params"].as_array().unwrap() {
            let given = json!({param["name"].as_str().unwrap(): {"no": "such"}});
            let (code, message) = remote.refusal(name, given);
            assert!(code == -32602 && !message.contains("unknown field"), "{name}: {message}");
        }
        if name != "rpc.discover" {
            let (code, message) = remote.refusal(name, json!({"rig": rig, "surplus": 1}));
            assert!(code == -32602 && message.contains("unknown field"), "{name}: {message}");
        }
    }
}

/// A call with the given head lines and body.
type Hostile = (&'static str, Box<dyn FnOnce(&mut Remote, &Value) -> String>, &'static str);

#[test]
fn hostile_calls_are_refused_and_change_nothing() {
    fn edit(rig: &Value) -> String {
        json!({"jsonrpc": "2.0", "id": 1, "method": "rig.edit", "params": {"rig": rig, "history": "undo"}}).to_string()
    }
    fn with(change: impl Fn(String) -> String + 'static) -> Box<dyn FnOnce(&mut Remote, &Value) -> String> {
        Box::new(move |remote, rig| {
            let body = edit(rig);
            remote.post(change(remote.head(body.len())), body.into_bytes())
        })
    }
    fn body(of: impl Fn(&Value) -> String + 'static) -> Box<dyn FnOnce(&mut Remote, &Value) -> String> {
        Box::new(move |remote, rig| {
            let body = of(rig);
            remote.post(remote.head(body.len()), body.into_bytes())
        })
    }
    let call = |method: &'static str, params: Value| {
        body(move |rig| {
            let text = json!({"jsonrpc": "2.0", "id": 1, "method": method, "params": params}).to_string();
            text.replace("\"RIG\"", &rig.to_string())
        })
    };
    let calls: Vec<Hostile> = vec![
        ("wrong token", with(|head| head.replace(TOKEN, "a-token-for-tests-onlx")), "HTTP/1.1 401"),
        ("no token", with(|head| head.replace("Authorization", "X-Authorization")), "HTTP/1.1 401"),
        ("foreign host", with(|head| head.replace("Host: 127.0.0.1", "Host: evil.example")), "HTTP/1.1 403"),
        ("no host", with(|head| head.replace("Host:", "X-Host:")), "HTTP/1.1 403"),
        (
            "foreign origin",
            with(|head| head.replace("\r\nHost", "\r\nOrigin: https://evil.example\r\nHost")),
            "HTTP/1.1 403",
        ),
        ("opaque origin", with(|head| head.replace("\r\nHost", "\r\nOrigin: null\r\nHost")), "HTTP/1.1 403"),
        ("two lengths", with(|head| head.replace("\r\n\r\n", "\r\nContent-Length: 5\r\n\r\n")), "HTTP/1.1 400"),
        ("chunks", with(|head| head.replace("\r\n\r\n", "\r\nTransfer-Encoding: chunked\r\n\r\n")), "HTTP/1.1 411"),
        ("read with GET", with(|head| head.replace("POST", "GET")), "HTTP/1.1 405"),
        (
            "long head",
            with(|head| head.replace("\r\n\r\n", &format!("\r\nX: {}\r\n\r\n", "x".repeat(20_000)))),
            "HTTP/1.1 431",
        ),
        ("too large", body(|rig| edit(rig) + &" ".repeat(1 << 20)), "HTTP/1.1 413"),
        (
            "truncated",
            Box::new(|remote, rig| {
                let (head, body) = (remote.head(edit(rig).len() + 1), edit(rig));
                remote.exchange(move |mut stream| {
                    stream.write_all(head.as_bytes()).and_then(|()| stream.write_all(body.as_bytes())).unwrap();
                    stream.shutdown(Shutdown::Write).unwrap();
                    rest(stream)
                })
            }),
            "HTTP/1.1 400",
        ),
        ("not JSON", body(|_| "rig.edit please".to_owned()), "-32700"),
        ("deep JSON", body(|_| "[".repeat(100_000) + &"]".repeat(100_000)), "-32700"),
        ("a list of calls", body(|rig| format!("[{}]", edit(rig))), "-32600"),
        ("unknown method", call("rig.delete", json!({"rig": "RIG"})), "-32601"),
        ("edit of an unknown rig", call("rig.edit", json!({"rig": 123_456, "history": "undo"})), "-23402"),
        (
            "edits of which one is refused",
            call(
                "rig.edit",
                json!({"rig": "RIG", "edits": [
                    {"AddLocalGroup": [{"uid": "00c0ffee00c0ffee", "name": "g", "color": [1.0, 0.0, 0.0], "enabled": true}, 0]},
                    {"RemoveJoint": "0123456789abcdef"}
                ]}),
            ),
            "error",
        ),
        ("a number that is none", call("rig.edit", json!({"rig": "RIG", "edits": [{"SetLabel": [3, "x"]}]})), "-32602"),
        ("a path outside", call("rig.template.save", json!({"rig": "RIG", "path": "../secret.rig.ron"})), "-32002"),
        ("a file outside", call("rig.template.load", json!({"path": "../secret.rig.ron"})), "-32002"),
        ("an absolute path", call("rig.template.load", json!({"path": "/etc/passwd.rig.ron"})), "-32002"),
        ("another kind of file", call("rig.template.save", json!({"rig": "RIG", "path": "x.sh"})), "-32002"),
    ];
    let mut remote = Remote::new();
    let rig = remote.load();
    // Something that an undo would take back.
    let tip = remote.call("rig.describe", json!({"rig": rig}))["joints"][2]["joint"]["uid"].clone();
    remote.call("rig.edit", json!({"rig": rig, "edits": [{"SetLabel": [tip, "tip"]}]}));
    let before = remote.text(&rig);
    let files = |remote: &Remote| -> Vec<(String, Vec<u8>)> {
        let list = |folder: &Path| fs::read_dir(folder).unwrap().map(|file| file.unwrap().path());
        let all = list(remote.folder.path()).chain(list(&remote.folder.path().join("allowed")));
        let mut all: Vec<_> = all
            .filter(|path| path.is_file())
            .map(|path| (path.display().to_string(), fs::read(&path).unwrap()))
            .collect();
        all.sort();
        all
    };
    let on_disk = files(&remote);
    for (what, send, answer) in calls {
        let told = send(&mut remote, &rig);
        assert!(told.contains(answer) && !told.contains("\"result\""), "{what}: {told}");
        assert_eq!(remote.text(&rig), before, "{what}");
        assert_eq!(files(&remote), on_disk, "{what}");
        assert_eq!(remote.call("rig.list", json!({})).as_array().unwrap().len(), 1, "{what}");
    }
    #[cfg(unix)]
    {
        // Links in the folder that lead out of it, one of them in the place of the file that was loaded.
        fs::remove_file(remote.file("t.rig.ron")).unwrap();
        let secret = remote.folder.path().join("secret.rig.ron");
        let link = |name: &str| std::os::unix::fs::symlink(&secret, remote.file(name));
        link("link.rig.ron").and_then(|()| link("t.rig.ron")).unwrap();
        for (method, params) in [
            ("rig.template.load", json!({"path": "link.rig.ron"})),
            ("rig.template.save", json!({"rig": rig, "path": "link.rig.ron"})),
            ("rig.template.save", json!({"rig": rig})),
            ("rig.template.update", json!({"rig": rig})),
        ] {
            assert_eq!(remote.refusal(method, params).0, -32002);
        }
        assert_eq!(fs::read_to_string(secret).unwrap(), CHAIN);
    }
}

#[test]
fn a_call_that_arrives_too_slowly_is_refused_and_changes_nothing() {
    let mut remote = Remote::reading_for(Duration::from_millis(300));
    // Something that an undo would take back.
    let world = remote.base.app.world_mut();
    let rig = world.spawn(Rig::new(Uid(1), "slow")).id();
    world.write_message(EditRequest::operation(rig, Operation::Place { position: Vec3::ONE, parent: None }));
    remote.base.app.update();
    let before = remote.base.get::<Rig>(rig).unwrap().clone();
    assert_eq!(before.len(), 1);
    let params = json!({"rig": rig.to_bits(), "history": "undo"});
    let body = json!({"jsonrpc": "2.0", "id": 1, "method": "rig.edit", "params": params}).to_string();
    let head = remote.head(body.len());
    let told = remote.exchange(move |mut stream| {
        for byte in head.bytes().chain(body.bytes()) {
            if stream.write_all(&[byte]).is_err() {
                break;
            }
            thread::sleep(Duration::from_millis(5));
        }
        rest(stream)
    });
    assert!(told.contains("HTTP/1.1 408") && !told.contains("\"result\""), "{told}");
    assert_eq!(remote.base.get::<Rig>(rig), Some(&before));
}

#[test]
fn silent_connections_hold_up_nobody() {
    let mut remote = Remote::new();
    let _silent: Vec<TcpStream> = (0..4).map(|_| TcpStream::connect(remote.address).unwrap()).collect();
    assert_eq!(remote.call("rig.list", json!({})), json!([]));
}

#[test]
fn templates_that_cannot_be_read_leave_nothing_behind() {
    let mut remote = Remote::new();
    fs::write(remote.file("broken.rig.ron"), "(format: 2, name: \"x\", joints: [(label: 3)])").unwrap();
    let (code, message) = remote.refusal("rig.template.load", json!({"path": "broken.rig.ron"}));
    assert!(code == -32003 && message.contains("broken.rig.ron"), "{message}");
    assert_eq!(remote.refusal("rig.template.load", json!({"path": "none.rig.ron"})).0, -32002);
    remote.base.app.update();
    assert_eq!(remote.call("rig.list", json!({})), json!([]));
    let rig = remote.load();
    let before = remote.text(&rig);
    fs::write(remote.file("t.rig.ron"), &CHAIN[..CHAIN.len() / 2]).unwrap();
    assert_eq!(remote.refusal("rig.template.update", json!({"rig": rig})).0, -32003);
    assert_eq!(remote.text(&rig), before);
    assert_eq!(
        remote.refusal("rig.edit", json!({"rig": rig, "history": "undo"})).1.matches("nothing to undo").count(),
        1
    );
}

#[test]
fn listening_ends_with_the_app_and_waiting_calls_wake_it() {
    let mut remote = Remote::new();
    let woken = Arc::new(AtomicUsize::new(0));
    let counted = woken.clone();
    remote.base.app.world().resource::<RemoteServer>().set_wake(move || {
        counted.fetch_add(1, Ordering::SeqCst);
    });
    remote.call("rig.list", json!({}));
    assert!(woken.load(Ordering::SeqCst) > 0);
    let taken = RemotePlugin::bind(RemoteSettings { port: remote.address.port(), ..default() });
    assert!(matches!(taken, Err(RemoteError::Port { .. })));
    let address = remote.address;
    drop(remote);
    // The thread closes the port when it has seen the end.
    let start = Instant::now();
    while TcpStream::connect(address).is_ok() {
        assert!(start.elapsed() < HANG, "it still listens");
        thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn a_token_is_random_or_long() {
    let short = RemotePlugin::bind(RemoteSettings { token: Some("short".into()), ..default() });
    assert!(matches!(short, Err(RemoteError::Token)));
    let token = || {
        let remote = RemotePlugin::bind(RemoteSettings::default()).unwrap();
        assert!(!format!("{remote:?}").contains(remote.token()), "no log shows the token");
        remote.token().to_owned()
    };
    let (a, b) = (token(), token());
    assert!(a.len() == 32 && b.len() == 32 && a != b);
}

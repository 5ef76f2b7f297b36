//! Remote control of a running app: JSON-RPC 2.0 over HTTP, in the shape of the Bevy Remote Protocol.
//!
//! A thread listens on the loopback interface and nowhere else. Before the body of a request is looked at, its method, its host,
//! its origin, its token and its length are checked, and a request that arrives slowly is cut off. Calls are handed to the
//! main world, one at a time, which carries them out between two frames: edits are steps of the history, builds are build
//! requests, and templates are read and saved in the folders that the app allows. `rpc.discover` describes all methods.
//!
//! ```no_run
//! use bevy::prelude::*;
//! use rigsmith::{plugins::RigPlugins, remote::{RemotePlugin, RemoteSettings}};
//!
//! let remote = RemotePlugin::bind(RemoteSettings { folders: vec!["characters".into()], ..default() })?;
//! println!("http://{}, token {}", remote.address(), remote.token());
//! App::new().add_plugins((DefaultPlugins, RigPlugins, remote)).run();
//! # Ok::<(), rigsmith::remote::RemoteError>(())
//! ```

mod answers;
mod error;
mod http;
mod rpc;
mod schema;
mod verbs;

use std::{
    hash::{BuildHasher, RandomState},
    net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream},
    path::PathBuf,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, AtomicUsize, Ordering},
        mpsc::{Receiver, Sender, channel},
    },
    thread,
    time::{Duration, Instant},
};

use bevy::{app::MainScheduleOrder, ecs::schedule::ScheduleLabel, prelude::*};
use serde_json::Value;

pub use self::error::RemoteError;
use self::{answers::PendingCall, error::CallError, schema::Verb};
use crate::{
    files::AllowedFolders,
    instance::{RigInstancePlugin, UpdateInstances},
    plugins::{
        commands::{BuildDone, BuildRequest},
        document::{EditRefusal, EditReport, EditRequest},
    },
};

/// Environment variable with the token of remote control.
pub const TOKEN_VARIABLE: &str = "RIGSMITH_REMOTE_TOKEN";

/// Smallest number of characters of a token.
pub const MIN_TOKEN: usize = 16;

/// Settings of remote control.
#[derive(Debug, Clone)]
pub struct RemoteSettings {
    /// Port on 127.0.0.1; 0 for a free one.
    pub port: u16,
    /// Token that every request carries; without one that of [`TOKEN_VARIABLE`], or else a random one.
    pub token: Option<String>,
    /// Folders in which templates may be read and saved; none without any. Relative paths are those below the first.
    pub folders: Vec<PathBuf>,
    /// Time in which a request has to arrive.
    pub read_timeout: Duration,
    /// Time in which the app has to answer a call.
    pub answer_timeout: Duration,
}

impl Default for RemoteSettings {
    fn default() -> Self {
        Self {
            port: 0,
            token: None,
            folders: Vec::new(),
            read_timeout: Duration::from_secs(2),
            answer_timeout: Duration::from_secs(30),
        }
    }
}

/// Plugin of remote control. Add it after [`RigPlugins`](crate::plugins::RigPlugins) and [`RigInstancePlugin`], which it adds if
/// it is missing.
#[derive(Debug, Clone)]
pub struct RemotePlugin {
    gate: Arc<Gate>,
}

/// State that the thread and the app share.
struct Gate {
    listener: TcpListener,
    address: SocketAddr,
    token: String,
    /// True if the token was neither set nor in the environment.
    is_random: bool,
    folders: AllowedFolders,
    read_timeout: Duration,
    answer_timeout: Duration,
    has_ended: AtomicBool,
    wake: Mutex<Option<Wake>>,
    /// Number of connections that are being answered.
    open: AtomicUsize,
    /// Held by the call that the app carries out.
    turn: Mutex<()>,
}

type Wake = Box<dyn Fn() + Send + Sync>;

impl std::fmt::Debug for Gate {
    /// Debug text without the token.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Gate").field("address", &self.address).field("folders", &self.folders).finish_non_exhaustive()
    }
}

impl RemotePlugin {
    /// Takes the port. Requests are answered once the plugin is in an app.
    ///
    /// # Errors
    /// A port that is in use, a folder that does not exist, a token that is easy to guess.
    pub fn bind(settings: RemoteSettings) -> Result<Self, RemoteError> {
        let RemoteSettings { port, token, folders, read_timeout, answer_timeout } = settings;
        let given = token.or_else(|| std::env::var(TOKEN_VARIABLE).ok().filter(|token| !token.is_empty()));
        let is_random = given.is_none();
        let token = given.unwrap_or_else(random_token);
        if token.len() < MIN_TOKEN || !token.bytes().all(|byte| byte.is_ascii_graphic()) {
            return Err(RemoteError::Token);
        }
        let folders = AllowedFolders::new(folders)?;
        let bound = TcpListener::bind((Ipv4Addr::LOCALHOST, port));
        let listener = bound.map_err(|source| RemoteError::Port { port, source })?;
        let address = listener.local_addr().map_err(|source| RemoteError::Port { port, source })?;
        let gate = Gate {
            listener,
            address,
            token,
            is_random,
            folders,
            read_timeout,
            answer_timeout,
            has_ended: AtomicBool::new(false),
            wake: Mutex::new(None),
            open: AtomicUsize::new(0),
            turn: Mutex::new(()),
        };
        Ok(Self { gate: Arc::new(gate) })
    }

    /// The address that is listened on.
    pub fn address(&self) -> SocketAddr {
        self.gate.address
    }

    /// The token.
    pub fn token(&self) -> &str {
        &self.gate.token
    }

    /// True if the token was made at random, so that somebody has to be told.
    pub fn has_random_token(&self) -> bool {
        self.gate.is_random
    }
}

/// 128 bits from the operating system's random numbers, which key the hashers.
fn random_token() -> String {
    let bits = || RandomState::new().hash_one(Instant::now());
    format!("{:016x}{:016x}", bits(), bits())
}

/// Schedule in which calls are carried out, right before `Update`.
#[derive(ScheduleLabel, Debug, Clone, PartialEq, Eq, Hash)]
struct RemoteCalls;

/// Schedule in which calls are answered, right after [`UpdateInstances`].
#[derive(ScheduleLabel, Debug, Clone, PartialEq, Eq, Hash)]
struct RemoteAnswers;

impl Plugin for RemotePlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<RigInstancePlugin>() {
            app.add_plugins(RigInstancePlugin::default());
        }
        let (sender, calls) = channel();
        let gate = self.gate.clone();
        let thread = thread::Builder::new().name("remote control".to_owned());
        if let Err(error) = thread.spawn(move || http::serve(&gate, &sender)) {
            error!("there is no remote control, because no thread can be started: {error}");
        }
        app.add_message::<EditRequest>()
            .add_message::<EditReport>()
            .add_message::<EditRefusal>()
            .add_message::<BuildRequest>()
            .add_message::<BuildDone>()
            .insert_resource(RemoteServer {
                gate: self.gate.clone(),
                calls: Mutex::new(calls),
                pending: Vec::new(),
                signs: Vec::new(),
            })
            .init_schedule(RemoteCalls)
            .init_schedule(RemoteAnswers);
        let mut order = app.world_mut().resource_mut::<MainScheduleOrder>();
        order.insert_before(Update, RemoteCalls);
        order.insert_after(UpdateInstances, RemoteAnswers);
        app.add_systems(RemoteCalls, verbs::take_calls).add_systems(RemoteAnswers, answers::answer_calls);
        answers::observe(app);
    }
}

/// Remote control of the app. Listening ends when it is removed.
#[derive(Resource)]
pub struct RemoteServer {
    gate: Arc<Gate>,
    calls: Mutex<Receiver<Call>>,
    pending: Vec<PendingCall>,
    /// Events of instances since the last look.
    signs: Vec<answers::Sign>,
}

impl RemoteServer {
    /// The address that is listened on.
    pub fn address(&self) -> SocketAddr {
        self.gate.address
    }

    /// Sets a function that lets an app which sleeps run a frame. The thread calls it while a call waits.
    pub fn set_wake(&self, wake: impl Fn() + Send + Sync + 'static) {
        *self.gate.wake.lock().unwrap_or_else(PoisonError::into_inner) = Some(Box::new(wake));
    }

    fn received(&self) -> Vec<Call> {
        self.calls.lock().unwrap_or_else(PoisonError::into_inner).try_iter().collect()
    }
}

impl Drop for RemoteServer {
    fn drop(&mut self) {
        self.gate.has_ended.store(true, Ordering::SeqCst);
        // The thread waits for a connection, and ends at this one.
        let _ = TcpStream::connect_timeout(&self.gate.address, Duration::from_secs(1));
    }
}

type Answer = Result<Value, CallError>;

/// A call for the main world.
struct Call {
    verb: Verb,
    params: Value,
    reply: Sender<Answer>,
    /// Time after which nobody waits for the answer.
    until: Instant,
}

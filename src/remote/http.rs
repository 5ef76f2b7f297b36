//! HTTP/1.1 as far as calls need it: one request a connection, checked before its body is read.

use std::{
    io::{ErrorKind, Read, Write},
    net::{Shutdown, SocketAddr, TcpStream},
    sync::{Arc, atomic::Ordering, mpsc::Sender},
    thread,
    time::{Duration, Instant},
};

use bevy::log::warn;

use super::{Call, Gate, error::HttpRefusal, rpc};
use crate::rig::format::json::json_text;

/// Largest length of the head of a request, in bytes.
pub(super) const MAX_HEAD: usize = 16 << 10;
/// Largest length of the body of a request, in bytes.
pub(super) const MAX_BODY: usize = 1 << 20;
/// Time in which an answer has to be taken.
const WRITE_TIMEOUT: Duration = Duration::from_secs(5);
/// Largest number of connections that are read at once.
const MAX_OPEN: usize = 16;
/// Time, and number of bytes, that a refused request is read on, so that its sender reads the answer.
const DRAIN: Duration = Duration::from_millis(250);
const DRAIN_BYTES: usize = 4 << 20;
/// Longest time that is waited for anything.
const YEAR: Duration = Duration::from_secs(365 * 24 * 60 * 60);

/// Answers connections until the app has ended. Each one is read on a thread of its own, so that a silent one holds up nobody.
pub(super) fn serve(gate: &Arc<Gate>, calls: &Sender<Call>) {
    for stream in gate.listener.incoming() {
        if gate.has_ended.load(Ordering::SeqCst) {
            return;
        }
        match stream {
            Ok(stream) => admit(stream, gate, calls),
            // The system has no more connections to give at the moment.
            Err(_) => thread::sleep(Duration::from_millis(10)),
        }
    }
}

/// Answers a connection on another thread, or on this one where there are many already.
fn admit(stream: TcpStream, gate: &Arc<Gate>, calls: &Sender<Call>) {
    let open = OpenConnection::new(gate.clone());
    if open.number > MAX_OPEN {
        return converse(stream, gate, calls);
    }
    let calls = calls.clone();
    let thread = thread::Builder::new().name("remote call".to_owned());
    let spawned = thread.spawn(move || converse(stream, &open.gate, &calls));
    if let Err(error) = spawned {
        warn!("a remote call is dropped, because no thread can be started: {error}");
    }
}

/// A connection that is being answered.
struct OpenConnection {
    gate: Arc<Gate>,
    /// Number of connections when it came, with itself.
    number: usize,
}

impl OpenConnection {
    fn new(gate: Arc<Gate>) -> Self {
        let number = gate.open.fetch_add(1, Ordering::SeqCst) + 1;
        Self { gate, number }
    }
}

impl Drop for OpenConnection {
    fn drop(&mut self) {
        self.gate.open.fetch_sub(1, Ordering::SeqCst);
    }
}

fn converse(stream: TcpStream, gate: &Gate, calls: &Sender<Call>) {
    let mut request = Request { stream, until: end_of(gate.read_timeout), bytes: Vec::new() };
    let (status, answer, is_whole) = match request.body(gate) {
        Ok(body) => ("200 OK", rpc::answer(&body, gate, calls), true),
        Err(refusal) => (refusal.status(), rpc::refused(refusal), false),
    };
    let body = json_text(&answer).unwrap_or_else(|_| answer.to_string());
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: application/json\r\nContent-Length: {}\r\nCache-Control: no-store\r\n\
         X-Content-Type-Options: nosniff\r\nConnection: close\r\n\r\n",
        body.len()
    );
    // The other side may have gone; then nobody reads the answer.
    let _ = request.stream.set_write_timeout(Some(WRITE_TIMEOUT));
    let _ = request.stream.write_all(head.as_bytes()).and_then(|()| request.stream.write_all(body.as_bytes()));
    let _ = request.stream.shutdown(Shutdown::Write);
    if !is_whole {
        request.drain();
    }
}

/// End of a time that begins now, of a year at most: a clock reaches no end of a time that is longer than it counts.
pub(super) fn end_of(time: Duration) -> Instant {
    let now = Instant::now();
    now.checked_add(time.min(YEAR)).unwrap_or(now)
}

/// A request that arrives.
struct Request {
    stream: TcpStream,
    until: Instant,
    bytes: Vec<u8>,
}

impl Request {
    /// The body, once everything else about the request is in order.
    fn body(&mut self, gate: &Gate) -> Result<Vec<u8>, HttpRefusal> {
        let end = loop {
            let found = self.bytes.windows(4).position(|window| window == b"\r\n\r\n");
            match found {
                Some(at) if at <= MAX_HEAD => break at,
                None if self.bytes.len() <= MAX_HEAD => self.more()?,
                _ => return Err(HttpRefusal::HeadTooLarge),
            }
        };
        let head = Head::of(&self.bytes[..end])?;
        let length = head.check(&gate.token, gate.address)?;
        if head.expects_continue {
            let sent = self.stream.write_all(b"HTTP/1.1 100 Continue\r\n\r\n");
            sent.map_err(|_| HttpRefusal::Truncated)?;
        }
        let start = end + 4;
        while self.bytes.len() < start + length {
            self.more()?;
        }
        Ok(self.bytes[start..start + length].to_vec())
    }

    /// Reads what is there, or waits for more.
    fn more(&mut self) -> Result<(), HttpRefusal> {
        let mut block = [0; 8192];
        loop {
            let left = self.until.saturating_duration_since(Instant::now());
            if left.is_zero() || self.stream.set_read_timeout(Some(left)).is_err() {
                return Err(HttpRefusal::Slow);
            }
            match self.stream.read(&mut block) {
                Ok(0) => return Err(HttpRefusal::Truncated),
                Ok(read) => {
                    self.bytes.extend_from_slice(&block[..read]);
                    return Ok(());
                }
                Err(error) => match error.kind() {
                    ErrorKind::Interrupted => {}
                    ErrorKind::WouldBlock | ErrorKind::TimedOut => return Err(HttpRefusal::Slow),
                    _ => return Err(HttpRefusal::Truncated),
                },
            }
        }
    }

    /// Reads on for a moment: a connection that is closed with bytes unread would take the answer with it.
    fn drain(&mut self) {
        self.until = Instant::now() + DRAIN;
        let mut read = 0;
        while read < DRAIN_BYTES {
            self.bytes.clear();
            if self.more().is_err() {
                return;
            }
            read += self.bytes.len();
        }
    }
}

/// The head of a request, as far as it matters here.
#[derive(Default)]
struct Head<'a> {
    is_post: bool,
    host: Option<&'a str>,
    origin: Option<&'a str>,
    authorization: Option<&'a str>,
    length: Option<&'a str>,
    is_encoded: bool,
    expects_continue: bool,
}

impl<'a> Head<'a> {
    fn of(bytes: &'a [u8]) -> Result<Self, HttpRefusal> {
        let text = std::str::from_utf8(bytes).map_err(|_| HttpRefusal::Malformed("the head is no text"))?;
        let mut lines = text.split("\r\n");
        let mut words = lines.next().unwrap_or_default().split(' ');
        let (method, path, version) = (words.next(), words.next(), words.next());
        if path.is_none_or(str::is_empty) || version != Some("HTTP/1.1") || words.next().is_some() {
            return Err(HttpRefusal::Malformed("the first line is not `POST / HTTP/1.1`"));
        }
        let mut head = Self { is_post: method == Some("POST"), ..Self::default() };
        for line in lines {
            let parts = line.split_once(':').filter(|(name, _)| !name.is_empty() && !name.contains([' ', '\t']));
            let (name, value) = parts.ok_or(HttpRefusal::Malformed("a header has no name"))?;
            let value = value.trim_matches([' ', '\t']);
            let place = match name.to_ascii_lowercase().as_str() {
                "host" => &mut head.host,
                "origin" => &mut head.origin,
                "authorization" => &mut head.authorization,
                "content-length" => &mut head.length,
                "transfer-encoding" => {
                    head.is_encoded = true;
                    continue;
                }
                "expect" => {
                    head.expects_continue |= value.eq_ignore_ascii_case("100-continue");
                    continue;
                }
                _ => continue,
            };
            if place.replace(value).is_some() {
                return Err(HttpRefusal::Malformed("a header is there twice"));
            }
        }
        Ok(head)
    }

    /// Length of the body of a request that may be answered.
    fn check(&self, token: &str, address: SocketAddr) -> Result<usize, HttpRefusal> {
        let own = [address.to_string(), format!("localhost:{}", address.port())];
        if !self.host.is_some_and(|host| own.iter().any(|own| own.eq_ignore_ascii_case(host))) {
            return Err(HttpRefusal::Host);
        }
        let is_own = |origin: &str| own.iter().any(|own| origin.strip_prefix("http://") == Some(own));
        if self.origin.is_some_and(|origin| !is_own(origin)) {
            return Err(HttpRefusal::Origin);
        }
        let given = self.authorization.and_then(|given| given.split_once(' '));
        let given = given.filter(|(scheme, _)| scheme.eq_ignore_ascii_case("bearer")).map(|(_, token)| token);
        if !given.is_some_and(|given| is_equal(given.as_bytes(), token.as_bytes())) {
            return Err(HttpRefusal::Token);
        }
        if !self.is_post {
            return Err(HttpRefusal::NotPost);
        }
        let length = self.length.filter(|_| !self.is_encoded).ok_or(HttpRefusal::NoLength)?;
        if length.is_empty() || !length.bytes().all(|digit| digit.is_ascii_digit()) {
            return Err(HttpRefusal::Malformed("the length of the body is no number"));
        }
        match length.parse::<usize>() {
            Ok(length) if length <= MAX_BODY => Ok(length),
            _ => Err(HttpRefusal::TooLarge),
        }
    }
}

/// Compares in a time that does not depend on the content.
fn is_equal(a: &[u8], b: &[u8]) -> bool {
    a.len() == b.len() && a.iter().zip(b).fold(0, |differs, (a, b)| differs | (a ^ b)) == 0
}

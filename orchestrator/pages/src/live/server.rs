//! The page of a run that goes on, served on the loopback address alone.

use std::io::{self, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::scene::Scene;
use super::tap::Tap;
use super::tuning::Tuning;

const PAGE: &str = include_str!("assets/live.html");
const SCRIPT: &str = include_str!("assets/live.js");
const HTML: &str = "text/html; charset=utf-8";
const STYLE: &str = include_str!("../report/assets/report.css");
const UPLOT_STYLE: &str = include_str!("../report/assets/uPlot.min.css");
const UPLOT_SCRIPT: &str = include_str!("../report/assets/uPlot.iife.min.js");
/// Rows of one answer.
const MOST_ROWS: usize = 5000;
/// Connections that are answered at a time.
const MOST_CONNECTIONS: usize = 64;
/// Longest that a client may take to ask, and to take its answer.
const PATIENCE: Duration = Duration::from_secs(1);
/// Longest request, bytes.
const LONGEST: usize = 16 * 1024;
/// How long the last rows wait for a client that has asked before.
const FAREWELL: Duration = Duration::from_secs(3);

/// A running server; it ends when it is dropped.
pub struct Server {
    address: SocketAddr,
    /// What an address begins with: other accounts of this machine do not know it.
    token: Arc<str>,
    tuning_token: Option<Arc<str>>,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

struct Shared {
    token: Arc<str>,
    /// Parameters that may be changed, and what the address of those who may begins with.
    tuning: Option<(Arc<str>, Tuning)>,
    scene: String,
    tap: Arc<Tap>,
    stop: AtomicBool,
    /// Whether anybody has asked for rows.
    watched: AtomicBool,
    /// Whether the end of the run has been told.
    told: AtomicBool,
    connections: AtomicUsize,
}

impl Server {
    /// Serves the page of `tap` at a port of 127.0.0.1, any free one for 0; with `tuning` also a page that
    /// changes parameters, at an address of its own.
    ///
    /// # Errors
    /// A port that is taken, or a system that has no random numbers; the message names the port.
    pub fn start(
        scene: &Scene,
        tap: Arc<Tap>,
        tuning: Option<Tuning>,
        port: u16,
    ) -> io::Result<Self> {
        Self::listening(scene, tap, tuning, port).map_err(|error| {
            let reason = format!("cannot listen on port {port} of 127.0.0.1: {error}");
            io::Error::new(error.kind(), reason)
        })
    }

    fn listening(
        scene: &Scene,
        tap: Arc<Tap>,
        tuning: Option<Tuning>,
        port: u16,
    ) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
        let address = listener.local_addr()?;
        let word = || getrandom::u64().map_err(|error| io::Error::other(error.to_string()));
        let token =
            || -> io::Result<Arc<str>> { Ok(format!("{:016x}{:016x}", word()?, word()?).into()) };
        let tuning = match tuning {
            Some(tuning) => Some((token()?, tuning)),
            None => None,
        };
        let tuning_token = tuning.as_ref().map(|(token, _)| Arc::clone(token));
        let token = token()?;
        let shared = Arc::new(Shared {
            token: Arc::clone(&token),
            tuning,
            scene: serde_json::json!(scene).to_string(),
            tap,
            stop: AtomicBool::new(false),
            watched: AtomicBool::new(false),
            told: AtomicBool::new(false),
            connections: AtomicUsize::new(0),
        });
        let own = Arc::clone(&shared);
        let thread = std::thread::spawn(move || listen(&listener, &own));
        Ok(Self {
            address,
            token,
            tuning_token,
            shared,
            thread: Some(thread),
        })
    }

    /// Where the page is.
    #[must_use]
    pub fn url(&self) -> String {
        format!("http://{}/{}/", self.address, self.token)
    }

    /// Where the page is that changes parameters; none where nothing may be changed.
    #[must_use]
    pub fn tuning_url(&self) -> Option<String> {
        let token = self.tuning_token.as_ref()?;
        Some(format!("http://{}/{token}/", self.address))
    }

    /// Waits until a client that has been watching knows of the end; not long.
    pub fn farewell(&self) {
        let begun = Instant::now();
        while self.shared.watched.load(Ordering::Relaxed)
            && !self.shared.told.load(Ordering::Relaxed)
            && begun.elapsed() < FAREWELL
        {
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        // The listener waits for a connection: this is one.
        let _ = TcpStream::connect(self.address);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn listen(listener: &TcpListener, shared: &Arc<Shared>) {
    for stream in listener.incoming() {
        if shared.stop.load(Ordering::Relaxed) {
            return;
        }
        let Ok(stream) = stream else { continue };
        if shared.connections.fetch_add(1, Ordering::Relaxed) >= MOST_CONNECTIONS {
            shared.connections.fetch_sub(1, Ordering::Relaxed);
            continue;
        }
        let own = Arc::clone(shared);
        std::thread::spawn(move || {
            // A client that goes away is no fault of the run.
            let _ = answer(&stream, &own);
            own.connections.fetch_sub(1, Ordering::Relaxed);
        });
    }
}

/// What a client asks for.
struct Asked {
    method: String,
    target: String,
    headers: Vec<(String, String)>,
    body: String,
}

impl Asked {
    /// Reads it, however slowly it comes: no longer than [`PATIENCE`].
    fn read(mut stream: &TcpStream) -> io::Result<Self> {
        let (begun, mut bytes) = (Instant::now(), Vec::new());
        let mut more = |bytes: &mut Vec<u8>| {
            let left = PATIENCE.saturating_sub(begun.elapsed());
            if left.is_zero() || bytes.len() > LONGEST {
                return Err(io::Error::from(io::ErrorKind::TimedOut));
            }
            stream.set_read_timeout(Some(left))?;
            let mut some = [0; 1024];
            match stream.read(&mut some)? {
                0 => Err(io::ErrorKind::UnexpectedEof.into()),
                count => {
                    bytes.extend(&some[..count]);
                    Ok(())
                }
            }
        };
        let end = loop {
            let found = bytes.windows(4).position(|end| end == b"\r\n\r\n");
            match found {
                Some(found) => break found,
                None => more(&mut bytes)?,
            }
        };
        let head = String::from_utf8_lossy(&bytes[..end]).into_owned();
        let mut lines = head.split("\r\n");
        let mut words = lines.next().unwrap_or("").split(' ');
        let (method, target) = (words.next().unwrap_or(""), words.next().unwrap_or(""));
        let headers = lines.filter_map(|line| line.split_once(':'));
        let headers = headers
            .map(|(name, value)| (name.trim().to_ascii_lowercase(), value.trim().to_string()));
        let headers: Vec<(String, String)> = headers.collect();
        let length = headers.iter().find(|(name, _)| name == "content-length");
        let length = length.map_or(Some(0), |(_, value)| value.parse::<usize>().ok());
        let length = length.filter(|length| *length <= LONGEST);
        let length = length.ok_or(io::ErrorKind::InvalidData)?;
        while bytes.len() < end + 4 + length {
            more(&mut bytes)?;
        }
        let body = String::from_utf8_lossy(&bytes[end + 4..end + 4 + length]).into_owned();
        Ok(Self {
            method: method.to_string(),
            target: target.to_string(),
            headers,
            body,
        })
    }

    /// The values of a header.
    fn all(&self, name: &str) -> Vec<&str> {
        let own = self.headers.iter().filter(|(own, _)| own == name);
        own.map(|(_, value)| value.as_str()).collect()
    }

    /// Whether it comes from a page of this server or from no page: another name for this address is a
    /// page from elsewhere that wants to read the run.
    fn is_own(&self, port: u16) -> bool {
        let own = [format!("127.0.0.1:{port}"), format!("localhost:{port}")];
        let is_host = matches!(self.all("host")[..], [host] if own.iter().any(|own| own == host));
        let origins = self.all("origin");
        let mut origins = origins.iter().map(|origin| origin.strip_prefix("http://"));
        is_host && origins.all(|origin| own.iter().any(|own| origin == Some(own)))
    }
}

const REFUSED: &str = "only at the address that --watch printed";

fn answer(stream: &TcpStream, shared: &Shared) -> io::Result<()> {
    const TEXT: &str = "text/plain; charset=utf-8";
    const JSON: &str = "application/json";
    stream.set_write_timeout(Some(PATIENCE))?;
    let asked = Asked::read(stream)?;
    let is_own = asked.is_own(stream.local_addr()?.port());
    let (path, query) = asked.target.split_once('?').unwrap_or((&asked.target, ""));
    let below = |token: &str| path.strip_prefix('/')?.strip_prefix(token);
    let tuned = shared.tuning.as_ref();
    let tuned = tuned.and_then(|(token, tuning)| Some((below(token)?, tuning)));
    let page_of = |may_change| page(shared, may_change);
    match (asked.method.as_str(), below(&shared.token), tuned) {
        _ if !is_own => reply(stream, "403 Forbidden", TEXT, REFUSED),
        ("GET", Some("/"), _) => reply(stream, "200 OK", HTML, &page_of(false)),
        ("GET", _, Some(("/", _))) => reply(stream, "200 OK", HTML, &page_of(true)),
        ("GET", Some("/rows"), _) | ("GET", _, Some(("/rows", _))) => {
            let from = query.strip_prefix("from=").and_then(|n| n.parse().ok());
            reply(stream, "200 OK", JSON, &rows(shared, from.unwrap_or(0)))
        }
        ("POST", _, Some(("/tune", tuning))) => match tuning.ask(&asked.body) {
            Ok(done) => reply(stream, "200 OK", JSON, &done),
            Err((status, reason)) => reply(stream, status, TEXT, &reason),
        },
        ("GET", None, None) | ("POST", _, None) => reply(stream, "403 Forbidden", TEXT, REFUSED),
        ("GET" | "POST", _, _) => reply(stream, "404 Not Found", TEXT, "there is / and /rows"),
        _ => reply(stream, "403 Forbidden", TEXT, REFUSED),
    }
}

fn rows(shared: &Shared, from: usize) -> String {
    // First, so that rows written since are told before the end is.
    let ended = shared.tap.ended();
    let rows = shared.tap.rows(from, MOST_ROWS);
    shared.watched.store(true, Ordering::Relaxed);
    let is_last = from + rows.len() >= shared.tap.len();
    let ended = ended.filter(|_| is_last);
    if ended.is_some() {
        shared.told.store(true, Ordering::Relaxed);
    }
    let mut all = serde_json::json!({"rows": rows, "ended": ended});
    if let Some((_, tuning)) = &shared.tuning {
        all["tuning"] = tuning.state();
    }
    all.to_string()
}

fn page(shared: &Shared, may_change: bool) -> String {
    let tuning = shared.tuning.as_ref();
    let tuning = tuning.map_or("null".to_string(), |(_, own)| own.controls(may_change));
    let inside = |json: &str| json.replace('<', "\\u003c");
    PAGE.replace("/*style*/", &format!("{UPLOT_STYLE}\n{STYLE}"))
        .replace("/*plots*/", UPLOT_SCRIPT)
        .replace("/*tuning*/", &inside(&tuning))
        .replace("/*scene*/", &inside(&shared.scene))
        .replace("/*script*/", SCRIPT)
}

fn reply(mut stream: &TcpStream, status: &str, kind: &str, body: &str) -> io::Result<()> {
    write!(
        stream,
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\n\
         Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\nConnection: close\r\n\r\n",
        body.len()
    )?;
    stream.write_all(body.as_bytes())?;
    stream.flush()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::UnitSystem;
    use fmi_master::{Panel, Tunable};
    use fmi_system::System;

    fn ask(server: &Server, request: &str) -> String {
        let mut stream = TcpStream::connect(server.address).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    }

    fn scene() -> Scene {
        Scene {
            title: "a </script> b".into(),
            duration: Some(1.0),
            plots: Vec::new(),
            step: None,
            tripped: None,
            cause: None,
        }
    }

    /// What the server reads of these parts, sent one after another, and how long it took.
    fn read(parts: &[&[u8]]) -> (io::Result<Asked>, Duration) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let mut client = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        let (stream, _) = listener.accept().unwrap();
        std::thread::scope(|scope| {
            let begun = Instant::now();
            let asked = scope.spawn(move || (Asked::read(&stream), begun.elapsed()));
            for part in parts {
                // The server may have closed it.
                let _ = client.write_all(part);
                std::thread::sleep(Duration::from_millis(50));
            }
            let _ = client.shutdown(std::net::Shutdown::Write);
            asked.join().unwrap()
        })
    }

    #[test]
    fn a_body_that_comes_after_its_head_is_read_to_its_end() {
        let head = b"POST /set HTTP/1.1\r\nContent-Length: 5\r\n\r\n";
        let asked = read(&[head, b"ab", b"cde and more"]).0.unwrap();
        assert_eq!((&*asked.method, &*asked.body), ("POST", "abcde"));
        let gone = read(&[head, b"ab"]).0;
        assert_eq!(gone.err().unwrap().kind(), io::ErrorKind::UnexpectedEof);
    }

    #[test]
    fn a_head_without_an_end_is_refused_before_patience_ends() {
        let head = vec![b'x'; 2 * LONGEST];
        let (refused, time) = read(&[&head]);
        assert_eq!(refused.err().unwrap().kind(), io::ErrorKind::TimedOut);
        assert!(time < PATIENCE / 2, "{time:?}");
        // One that has the greatest length and comes whole is not too long.
        let mut whole = b"GET / HTTP/1.1\r\nx: ".to_vec();
        whole.resize(LONGEST - 4, b'y');
        whole.extend(b"\r\n\r\n");
        let asked = read(&[&whole]).0.unwrap();
        assert_eq!(asked.target, "/");
        let long = b"POST / HTTP/1.1\r\nContent-Length: 16385\r\n\r\n";
        let refused = read(&[long]).0.err().unwrap();
        assert_eq!(refused.kind(), io::ErrorKind::InvalidData);
    }

    #[test]
    fn rows_are_served_to_this_machine_only() {
        let tap = Arc::new(Tap::new(vec![0], 3));
        let server = Server::start(&scene(), Arc::clone(&tap), None, 0).unwrap();
        assert!(server.address.ip().is_loopback());
        let host = server.address;
        let token = server.token.to_string();
        let get = |path: &str| format!("GET /{token}{path} HTTP/1.1\r\nHost: {host}\r\n\r\n");
        assert_eq!(server.url(), format!("http://{host}/{token}/"));
        let page = ask(&server, &get("/"));
        assert!(page.starts_with("HTTP/1.1 200") && page.contains("a \\u003c/script> b"));
        tap.push(0.0, &[7.5]);
        let rows = ask(&server, &get("/rows?from=0"));
        assert!(
            rows.ends_with(r#"{"ended":null,"rows":[[0.0,7.5]]}"#),
            "{rows}"
        );
        tap.push(0.5, &[-1.0]);
        tap.finish("complete");
        let rows = ask(&server, &get("/rows?from=1"));
        assert!(
            rows.ends_with(r#"{"ended":"complete","rows":[[0.5,-1.0]]}"#),
            "{rows}"
        );
        server.farewell();
        let own = format!("Host: {host}\r\n");
        for other in [
            get("/").replace(&own, "Host: elsewhere.example\r\n"),
            get("/").replace(&own, &format!("Host: elsewhere.example\r\n{own}")),
            get("/").replace(&own, &format!("{own}{own}")),
            get("/").replace(&own, ""),
            get("/").replace("GET", "POST"),
            get("/").replace(&token, &"0".repeat(token.len())),
            get("/rows").replace(&format!("/{token}"), ""),
        ] {
            let said = ask(&server, &other);
            assert!(said.starts_with("HTTP/1.1 403"), "{other}: {said}");
        }
        assert!(ask(&server, &get("/etc/passwd")).starts_with("HTTP/1.1 404"));
    }

    #[test]
    fn clients_that_never_end_their_request_shut_nobody_out() {
        let tap = Arc::new(Tap::new(vec![0], 3));
        let server = Server::start(&scene(), Arc::clone(&tap), None, 0).unwrap();
        let other = Server::start(&scene(), tap, None, 0).unwrap();
        assert_ne!(server.token, other.token);
        let host = server.address;
        let is_cut = || {
            let mut slow = TcpStream::connect(host).unwrap();
            (0..1000).any(|_| {
                std::thread::sleep(Duration::from_millis(20));
                slow.write_all(b"G").is_err()
            })
        };
        std::thread::scope(|scope| {
            let all: Vec<_> = (0..MOST_CONNECTIONS + 8)
                .map(|_| scope.spawn(is_cut))
                .collect();
            assert!(all.into_iter().all(|own| own.join().unwrap()));
        });
        let get = format!("GET /{}/ HTTP/1.1\r\nHost: {host}\r\n\r\n", server.token);
        assert!(ask(&server, &get).starts_with("HTTP/1.1 200"));
    }
    #[test]
    fn the_farewell_waits_for_a_client_that_has_asked_until_it_is_told_of_the_end() {
        let tap = Arc::new(Tap::new(vec![0], 3));
        let server = Server::start(&scene(), Arc::clone(&tap), None, 0).unwrap();
        let rows = format!(
            "GET /{}/rows?from=0 HTTP/1.1\r\nHost: {}\r\n\r\n",
            server.token, server.address
        );
        let begun = Instant::now();
        server.farewell();
        assert!(begun.elapsed() < FAREWELL / 2, "nobody has asked");
        ask(&server, &rows);
        std::thread::scope(|scope| {
            let farewell = scope.spawn(|| server.farewell());
            std::thread::sleep(Duration::from_millis(100));
            assert!(!farewell.is_finished());
            tap.finish("complete");
            let begun = Instant::now();
            ask(&server, &rows);
            farewell.join().unwrap();
            assert!(begun.elapsed() < FAREWELL / 2);
        });
    }

    #[test]
    fn the_end_is_told_with_the_last_rows_only() {
        let tap = Arc::new(Tap::new(vec![0], MOST_ROWS + 1));
        let server = Server::start(&scene(), Arc::clone(&tap), None, 0).unwrap();
        for n in 0..=MOST_ROWS {
            tap.push(n as f64, &[0.0]);
        }
        tap.finish("complete");
        assert!(
            rows(&server.shared, 0).starts_with(r#"{"ended":null,"rows":[[0.0,0.0],[1.0,0.0]"#)
        );
        assert!(!server.shared.told.load(Ordering::Relaxed));
        assert_eq!(
            rows(&server.shared, MOST_ROWS),
            r#"{"ended":"complete","rows":[[5000.0,0.0]]}"#
        );
        assert!(server.shared.told.load(Ordering::Relaxed));
    }

    #[test]
    fn parameters_are_changed_at_the_address_of_their_own_only() {
        let gain = Tunable {
            variable: "control.gain".into(),
            start: 2.0,
            low: 1.0,
            high: 4.0,
        };
        let panel = Arc::new(Panel::new(vec![gain], 500));
        let none = System {
            name: "none".into(),
            description: String::new(),
            components: Vec::new(),
            connections: Vec::new(),
            tables: Vec::new(),
            start: 0.0,
            end: None,
            notes: Vec::new(),
            stop: None,
        };
        let tuning = Tuning::new(&none, Arc::clone(&panel), 1.0, UnitSystem::Us);
        let tap = Arc::new(Tap::new(vec![0], 3));
        let server = Server::start(&scene(), tap, Some(tuning), 0).unwrap();
        let host = server.address;
        let (watching, tuning) = (server.url(), server.tuning_url().unwrap());
        assert_ne!(watching, tuning);
        let post = |url: &str, path: &str, body: &str, headers: &str| {
            let token = url.rsplit('/').nth(1).unwrap();
            let length = body.len();
            ask(
                &server,
                &format!(
                    "POST /{token}{path} HTTP/1.1\r\nHost: {host}\r\n{headers}Content-Length: {length}\r\n\r\n{body}"
                ),
            )
        };
        let three = r#"{"variable": "control.gain", "value": 3}"#;
        let own = format!("Origin: http://{host}\r\n");
        let done = post(&tuning, "/tune", three, &own);
        assert!(
            done.starts_with("HTTP/1.1 200") && done.ends_with(r#""variable":"control.gain"}"#),
            "{done}"
        );
        let elsewhere = "Origin: http://elsewhere.example\r\n";
        for (said, status, words) in [
            (post(&watching, "/tune", three, ""), 403, "--watch"),
            (post(&tuning, "/tune", three, elsewhere), 403, "--watch"),
            (post(&tuning, "/rows", three, ""), 404, "/rows"),
            (
                post(&tuning, "/tune", &three.replace('3', "4.1"), ""),
                409,
                "expected 1.000 to 4.000",
            ),
            (
                post(&tuning, "/tune", &three.replace("gain", "mass"), ""),
                409,
                "`control.mass`",
            ),
            (
                post(&tuning, "/tune", &three.replace('3', "\"3\""), ""),
                400,
                "NUMBER",
            ),
            (post(&tuning, "/tune", "{}", ""), 400, "variable"),
        ] {
            assert!(said.starts_with(&format!("HTTP/1.1 {status}")), "{said}");
            assert!(said.contains(words), "{said}");
        }
        let token = watching.rsplit('/').nth(1).unwrap();
        let rows = ask(
            &server,
            &format!("GET /{token}/rows HTTP/1.1\r\nHost: {host}\r\n\r\n"),
        );
        assert!(
            rows.contains(r#""tuning":{"changes":[],"values":[2.0]}"#),
            "{rows}"
        );
        let page = |token: &str| {
            ask(
                &server,
                &format!("GET /{token}/ HTTP/1.1\r\nHost: {host}\r\n\r\n"),
            )
        };
        assert!(page(token).contains(r#""may_change":false"#));
        assert!(page(tuning.rsplit('/').nth(1).unwrap()).contains(r#""may_change":true"#));
    }
}

//! The page of a run that goes on, served on the loopback address alone.

use std::io::{self, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::scene::Scene;
use super::tap::Tap;

const PAGE: &str = include_str!("assets/live.html");
const SCRIPT: &str = include_str!("assets/live.js");
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
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

struct Shared {
    token: Arc<str>,
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
    /// Serves the page of `tap` at a port of 127.0.0.1, any free one for 0.
    ///
    /// # Errors
    /// A port that is taken, or a system that has no random numbers; the message names the port.
    pub fn start(scene: &Scene, tap: Arc<Tap>, port: u16) -> io::Result<Self> {
        Self::listening(scene, tap, port).map_err(|error| {
            let reason = format!("cannot listen on port {port} of 127.0.0.1: {error}");
            io::Error::new(error.kind(), reason)
        })
    }

    fn listening(scene: &Scene, tap: Arc<Tap>, port: u16) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
        let address = listener.local_addr()?;
        let word = || getrandom::u64().map_err(|error| io::Error::other(error.to_string()));
        let token: Arc<str> = format!("{:016x}{:016x}", word()?, word()?).into();
        let shared = Arc::new(Shared {
            token: Arc::clone(&token),
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
            shared,
            thread: Some(thread),
        })
    }

    /// Where the page is.
    #[must_use]
    pub fn url(&self) -> String {
        format!("http://{}/{}/", self.address, self.token)
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

/// The lines of a request up to the empty one. However slowly it comes: no longer than [`PATIENCE`].
fn request(mut stream: &TcpStream) -> io::Result<Vec<String>> {
    let (begun, mut bytes) = (Instant::now(), Vec::new());
    while !bytes.windows(4).any(|end| end == b"\r\n\r\n") {
        let left = PATIENCE.saturating_sub(begun.elapsed());
        if left.is_zero() || bytes.len() > LONGEST {
            return Err(io::ErrorKind::TimedOut.into());
        }
        stream.set_read_timeout(Some(left))?;
        let mut some = [0; 1024];
        match stream.read(&mut some)? {
            0 => return Err(io::ErrorKind::UnexpectedEof.into()),
            count => bytes.extend(&some[..count]),
        }
    }
    let text = String::from_utf8_lossy(&bytes);
    let lines = text.split("\r\n").take_while(|line| !line.is_empty());
    Ok(lines.map(str::to_string).collect())
}

fn answer(stream: &TcpStream, shared: &Shared) -> io::Result<()> {
    stream.set_write_timeout(Some(PATIENCE))?;
    let lines = request(stream)?;
    let hosts: Vec<&str> = lines
        .iter()
        .filter_map(|line| line.split_once(':'))
        .filter(|(name, _)| name.eq_ignore_ascii_case("host"))
        .map(|(_, value)| value.trim())
        .collect();
    let mut words = lines.first().map_or("", String::as_str).split(' ');
    let (method, target) = (words.next().unwrap_or(""), words.next().unwrap_or(""));
    // Another name for this address is a page from elsewhere that wants to read the run.
    let port = stream.local_addr()?.port();
    let own = [format!("127.0.0.1:{port}"), format!("localhost:{port}")];
    let is_own = matches!(hosts[..], [host] if own.iter().any(|own| own == host));
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
    let path = path
        .strip_prefix('/')
        .and_then(|path| path.strip_prefix(&*shared.token));
    let Some(path) = path.filter(|_| method == "GET" && is_own) else {
        return reply(
            stream,
            "403 Forbidden",
            "text/plain",
            "only at the address that --watch printed",
        );
    };
    match path {
        "/" => reply(stream, "200 OK", "text/html; charset=utf-8", &page(shared)),
        "/rows" => {
            let from = query.strip_prefix("from=").and_then(|n| n.parse().ok());
            reply(
                stream,
                "200 OK",
                "application/json",
                &rows(shared, from.unwrap_or(0)),
            )
        }
        _ => reply(
            stream,
            "404 Not Found",
            "text/plain",
            "there is / and /rows",
        ),
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
    serde_json::json!({"rows": rows, "ended": ended}).to_string()
}

fn page(shared: &Shared) -> String {
    PAGE.replace("/*style*/", &format!("{UPLOT_STYLE}\n{STYLE}"))
        .replace("/*plots*/", UPLOT_SCRIPT)
        .replace("/*scene*/", &shared.scene.replace('<', "\\u003c"))
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

    #[test]
    fn rows_are_served_to_this_machine_only() {
        let tap = Arc::new(Tap::new(vec![0], 3));
        let server = Server::start(&scene(), Arc::clone(&tap), 0).unwrap();
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
        let server = Server::start(&scene(), Arc::clone(&tap), 0).unwrap();
        let other = Server::start(&scene(), tap, 0).unwrap();
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
}

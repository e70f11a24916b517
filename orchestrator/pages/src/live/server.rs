//! The page of a run that goes on, served on the loopback address alone.

use std::io::{self, BufRead, BufReader, Write};
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
const MOST_CONNECTIONS: usize = 16;
/// Longest that a client may take to ask.
const PATIENCE: Duration = Duration::from_secs(2);
/// How long the last rows wait for a client that has asked before.
const FAREWELL: Duration = Duration::from_secs(3);

/// A running server; it ends when it is dropped.
pub struct Server {
    address: SocketAddr,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

struct Shared {
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
    /// A port that is taken.
    pub fn start(scene: &Scene, tap: Arc<Tap>, port: u16) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
        let address = listener.local_addr()?;
        let shared = Arc::new(Shared {
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
            shared,
            thread: Some(thread),
        })
    }

    /// Where the page is.
    #[must_use]
    pub fn url(&self) -> String {
        format!("http://{}/", self.address)
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

fn answer(stream: &TcpStream, shared: &Shared) -> io::Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let mut lines = BufReader::new(io::Read::take(stream, 16 * 1024)).lines();
    let request = lines.next().transpose()?.unwrap_or_default();
    let mut host = String::new();
    for line in lines {
        let line = line?;
        if line.is_empty() {
            break;
        }
        if let Some((name, value)) = line.split_once(':')
            && name.eq_ignore_ascii_case("host")
        {
            host = value.trim().to_string();
        }
    }
    let mut words = request.split(' ');
    let (method, target) = (words.next().unwrap_or(""), words.next().unwrap_or(""));
    // Another name for this address is a page from elsewhere that wants to read the run.
    let own = stream.local_addr()?.port();
    let is_own = [format!("127.0.0.1:{own}"), format!("localhost:{own}")].contains(&host);
    if method != "GET" || !is_own {
        return reply(
            stream,
            "403 Forbidden",
            "text/plain",
            "only for this machine",
        );
    }
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
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
    use std::io::Read;

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
            duration: 1.0,
            plots: Vec::new(),
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
        let get = |path: &str| format!("GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n");
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
        for other in [
            "GET / HTTP/1.1\r\nHost: elsewhere.example\r\n\r\n".to_string(),
            "GET / HTTP/1.1\r\n\r\n".to_string(),
            get("/").replace("GET", "POST"),
        ] {
            assert!(ask(&server, &other).starts_with("HTTP/1.1 403"));
        }
        assert!(ask(&server, &get("/etc/passwd")).starts_with("HTTP/1.1 404"));
    }
}

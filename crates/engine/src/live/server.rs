//! The server of the live page. It listens on the loopback address only.
//!
//! Any program of any user on the machine can connect to a loopback port, and any page in a browser can make the browser
//! send requests there. Therefore every path begins with a token of 128 random bits; requests must name the loopback
//! address as their host (a name that resolves to it is rejected) and, where the browser states their origin, come from our
//! own page; only a POST with a JSON body changes anything; and no other page may read an answer.

use std::collections::VecDeque;
use std::io::{self, Read};
use std::net::{Ipv4Addr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use report::page::Live;
use report::view::Views;
use serde_json::{Value, json};

use super::Steering;
use super::http::{self, Request, RequestError};
use super::pages::Pages;
use super::steering::{LiveCommand, RunContext};

/// Maximum number of requests of our own page served at once; more are rejected.
const CONNECTIONS_MAX: usize = 16;
/// Maximum number of connections that have not yet sent our address. A new one closes the oldest: a page sends its request
/// at once, so silent connections cannot block it.
const SILENT_MAX: usize = 64;
/// Maximum time for a browser to accept an answer.
const WRITE_TIMEOUT: Duration = Duration::from_secs(5);
/// Maximum time that the end waits for pages to fetch the result.
const RESULT_TIMEOUT: Duration = Duration::from_secs(5);
/// After reading the run the server pauses for this multiple of the time that the reading took, for any number of pages:
/// reading takes at most a tenth of a core. Building the answers comes on top, once for each request.
const PAUSE_FACTOR: u32 = 9;
const JSON: &str = "application/json";
const HTML: &str = "text/html";
const TEXT: &str = "text/plain";

/// The report of the run, and the earliest time of the next reading.
#[derive(Default)]
struct LiveReport {
    live: Option<Live>,
    not_before: Option<Instant>,
}

struct Shared {
    port: u16,
    token: String,
    steering: Arc<Steering>,
    views: Vec<Views>,
    /// Opened at the first request of a page.
    live: Mutex<LiveReport>,
    result: Mutex<Option<Arc<Vec<u8>>>>,
    pages: Mutex<Pages>,
    connections: AtomicUsize,
    /// Connections that have not sent a valid request, each with its number, the oldest first.
    silent: Mutex<VecDeque<(u64, TcpStream)>>,
}

/// A server in its own threads, which end with the program.
pub struct Server {
    shared: Arc<Shared>,
}

fn locked<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Server {
    /// Listens on `port` of 127.0.0.1, or on a free port where it is 0. The page has the figures of `views` besides those
    /// of the scenario.
    pub fn start(port: u16, steering: Arc<Steering>, views: &[Views]) -> io::Result<Server> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
        let mut bits = [0_u8; 16];
        std::fs::File::open("/dev/urandom")?.read_exact(&mut bits)?;
        let shared = Arc::new(Shared {
            port: listener.local_addr()?.port(),
            token: bits.iter().map(|byte| format!("{byte:02x}")).collect(),
            steering,
            views: views.to_vec(),
            live: Mutex::new(LiveReport::default()),
            result: Mutex::new(None),
            pages: Mutex::default(),
            connections: AtomicUsize::new(0),
            silent: Mutex::default(),
        });
        let server = Server { shared: shared.clone() };
        std::thread::Builder::new()
            .name("live".into())
            .spawn(move || accept(&listener, &shared))?;
        Ok(server)
    }

    /// The address of the page.
    pub fn url(&self) -> String {
        format!("http://127.0.0.1:{}/{}/", self.shared.port, self.shared.token)
    }

    /// Called when the run folder is complete. Waits for open pages to fetch the result, for a bounded time.
    pub fn finish(&self, how: String) {
        // The result is built here, with the priority of the run; the server's threads have a lower one.
        if locked(&self.shared.pages).has_pending(Instant::now()) {
            let _ = self.shared.finished_data();
        }
        self.shared.steering.end(how);
        let since = Instant::now();
        // An answer in transmission may be the result, or a page that will ask for it.
        let busy = || self.shared.connections.load(Ordering::Relaxed) > 0;
        while since.elapsed() < RESULT_TIMEOUT && (busy() || locked(&self.shared.pages).has_pending(Instant::now())) {
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

fn accept(listener: &TcpListener, shared: &Arc<Shared>) {
    // Threads that are started here inherit the lower priority: the run comes first.
    let _ = rustix::process::setpriority_process(None, 10);
    for number in 0.. {
        let Ok((mut stream, peer)) = listener.accept() else {
            // Probably out of file descriptors, which is temporary.
            std::thread::sleep(Duration::from_millis(50));
            continue;
        };
        let _ = stream.set_read_timeout(Some(Duration::from_secs(1)));
        let _ = stream.set_write_timeout(Some(WRITE_TIMEOUT));
        if !peer.ip().is_loopback() {
            continue;
        }
        let Ok(handle) = stream.try_clone() else { continue };
        shared.add_silent(number, handle);
        let mine = shared.clone();
        let spawned = std::thread::Builder::new().name("live".into()).spawn(move || {
            serve(&mut stream, number, &mine);
            mine.remove_silent(number);
        });
        if spawned.is_err() {
            shared.remove_silent(number);
        }
    }
}

/// An answer: status, content type, body.
type Response = (u16, &'static str, Vec<u8>);

fn serve(stream: &mut TcpStream, number: u64, shared: &Shared) {
    let request = match http::read_request(stream, Instant::now() + http::REQUEST_TIMEOUT) {
        Ok(request) => request,
        Err(RequestError::Rejected(status, text)) => {
            let _ = http::write_response(stream, status, TEXT, format!("{text}\n").as_bytes());
            return;
        }
        Err(RequestError::Disconnected) => return,
    };
    let subpath = match authorize(&request, shared) {
        Err((status, text)) => {
            let _ = write_within(stream, status, TEXT, format!("{text}\n").as_bytes());
            return;
        }
        Ok(subpath) => subpath,
    };
    shared.remove_silent(number);
    let busy = shared.connections.fetch_add(1, Ordering::Relaxed);
    let (status, kind, body) = if busy < CONNECTIONS_MAX {
        route(&request, subpath, shared)
    } else {
        text(503, "too many connections")
    };
    let sent = write_within(stream, status, kind, &body);
    if let (Ok(()), 200, Some(id)) = (sent, status, page_id(&request))
        && request.path.ends_with("/result")
    {
        locked(&shared.pages).serve_result(id);
    }
    shared.connections.fetch_sub(1, Ordering::Relaxed);
}

/// Limits the total time of an answer, so that a browser that reads a few bytes at a time cannot keep its connection for
/// ever.
fn write_within(stream: &mut TcpStream, status: u16, kind: &str, body: &[u8]) -> io::Result<()> {
    let mut bytes = Vec::with_capacity(body.len() + 1024);
    http::write_response(&mut bytes, status, kind, body)?;
    let until = Instant::now() + WRITE_TIMEOUT;
    let mut rest = &bytes[..];
    while !rest.is_empty() {
        let left = until.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(io::ErrorKind::TimedOut.into());
        }
        stream.set_write_timeout(Some(left))?;
        match io::Write::write(stream, rest)? {
            0 => return Err(io::ErrorKind::WriteZero.into()),
            count => rest = &rest[count..],
        }
    }
    stream.shutdown(Shutdown::Write)?;
    // Closing while bytes are in transit would reset the connection: the server waits for the browser to close first.
    let _ = stream.set_read_timeout(Some(Duration::from_millis(200)));
    let _ = stream.read(&mut [0; 64]);
    Ok(())
}

/// The path after the token, for a request that may be answered.
fn authorize<'a>(request: &'a Request, shared: &Shared) -> Result<&'a str, (u16, &'static str)> {
    let port = shared.port;
    let ours = [format!("127.0.0.1:{port}"), format!("localhost:{port}")];
    if !request
        .header("host")
        .is_some_and(|host| ours.iter().any(|known| known == host))
    {
        return Err((403, "this server answers to 127.0.0.1 alone"));
    }
    let origin = request.header("origin");
    let from_us = origin.is_some_and(|origin| ours.iter().any(|host| origin.strip_prefix("http://") == Some(host)));
    if (request.has("origin") || request.method != "GET") && !from_us {
        return Err((403, "this request comes from another page"));
    }
    if request.has("sec-fetch-site") && !matches!(request.header("sec-fetch-site"), Some("same-origin" | "none")) {
        return Err((403, "this request comes from another page"));
    }
    let mut parts = request.path.splitn(3, '/').skip(1);
    let token = parts.next().unwrap_or_default();
    if !constant_time_eq(token.as_bytes(), shared.token.as_bytes()) {
        return Err((
            404,
            "there is nothing here: use the whole address that the run has printed",
        ));
    }
    parts.next().ok_or((404, "the address ends with a slash"))
}

/// Compares two texts in constant time.
fn constant_time_eq(a: &[u8], b: &[u8]) -> bool {
    a.len() == b.len() && a.iter().zip(b).fold(0, |difference, (x, y)| difference | (x ^ y)) == 0
}

fn page_id(request: &Request) -> Option<&str> {
    let id = request.parameter("page")?;
    (id.len() <= 32 && id.bytes().all(|byte| byte.is_ascii_alphanumeric())).then_some(id)
}

fn text(status: u16, text: &str) -> Response {
    (status, TEXT, format!("{text}\n").into_bytes())
}

fn route(request: &Request, subpath: &str, shared: &Shared) -> Response {
    match (request.method.as_str(), subpath) {
        ("GET", "") => shared.page(),
        ("GET", "news") => shared.updates(request),
        ("GET", "result") => shared.result(),
        ("POST", "control") => shared.control(request),
        (_, "" | "news" | "result" | "control") => text(405, "not with this method"),
        _ => text(404, "there is nothing here"),
    }
}

/// CPU time of this thread: on a loaded machine, wall-clock time would lengthen the pauses.
fn thread_cpu_time() -> Duration {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Duration::new(
        now.tv_sec.unsigned_abs(),
        u32::try_from(now.tv_nsec).unwrap_or_default(),
    )
}

/// The page before the first sample.
const WAITING_PAGE: &[u8] =
    b"<!DOCTYPE html><meta charset=utf-8><meta http-equiv=refresh content=1><title>Escapement</title>\
<body style='font-family:system-ui;margin:4rem;color:#667'>The run is about to begin.";

impl Shared {
    /// Adds connection `number`; closes the oldest silent one if there are too many.
    fn add_silent(&self, number: u64, stream: TcpStream) {
        let mut silent = locked(&self.silent);
        silent.push_back((number, stream));
        if silent.len() > SILENT_MAX
            && let Some((_, oldest)) = silent.pop_front()
        {
            // The thread of that connection reads end of file, and ends.
            let _ = oldest.shutdown(Shutdown::Both);
        }
    }

    /// Removes connection `number`: it has sent a request of our page, or is closed.
    fn remove_silent(&self, number: u64) {
        locked(&self.silent).retain(|(silent, _)| *silent != number);
    }

    /// Calls `act` with the live report; `None` as long as there is nothing to report.
    fn with_live<T>(
        &self,
        act: impl FnOnce(&mut Live, &RunContext) -> Result<T, report::page::ReportError>,
    ) -> Result<Option<T>, report::page::ReportError> {
        let Some(course) = self.steering.context() else {
            return Ok(None);
        };
        let mut report_state = locked(&self.live);
        // A request that comes too early waits here, and so do all behind it: the load on the run is bounded, however many
        // pages ask.
        if let Some(rest) = report_state
            .not_before
            .map(|when| when.saturating_duration_since(Instant::now()))
        {
            std::thread::sleep(rest);
        }
        let began = thread_cpu_time();
        if report_state.live.is_none() {
            let duration = course.plan.timebase.seconds(course.plan.end);
            report_state.live = Some(Live::open(&course.folder, duration, &self.views)?);
        }
        let live = report_state.live.as_mut().expect("just made");
        let done = match live.is_ready() {
            Ok(true) => act(live, course).map(Some),
            Ok(false) => Ok(None),
            Err(error) => Err(error),
        };
        report_state.not_before = Some(Instant::now() + thread_cpu_time().saturating_sub(began) * PAUSE_FACTOR);
        done
    }

    fn page(&self) -> Response {
        let about = |course: &RunContext| {
            let participants = course.plan.participants.iter();
            let participants: Vec<Value> = participants
                .map(|participant| json!({ "name": participant.name, "period_s": participant.period.seconds() }))
                .collect();
            json!({
                "participants": participants,
                "duration_s": course.plan.timebase.seconds(course.plan.end),
                "state": self.steering.state(),
            })
        };
        let page = match self.with_live(|live, course| live.page(&about(course))) {
            Ok(page) => page,
            Err(error) => return text(500, &error.to_string()),
        };
        locked(&self.pages).page_sent(page.is_none(), Instant::now());
        (
            200,
            HTML,
            page.map_or_else(|| WAITING_PAGE.to_vec(), String::into_bytes),
        )
    }

    fn updates(&self, request: &Request) -> Response {
        if let Some(id) = page_id(request) {
            locked(&self.pages).request_received(id, Instant::now());
        }
        let have = request.parameter("have").unwrap_or_default();
        let have: Vec<u64> = have.split('-').filter_map(|number| number.parse().ok()).collect();
        // The state is read first, so that everything it reports is on the tape by the time the tape is read.
        let state = self.steering.state();
        match self.with_live(|live, _| live.update(&have)) {
            Ok(news) => {
                let mut news = news.unwrap_or_else(|| json!({}));
                news["state"] = state;
                (200, JSON, news.to_string().into_bytes())
            }
            Err(error) => text(500, &error.to_string()),
        }
    }

    /// The data of the page of the finished run.
    fn result(&self) -> Response {
        if self.steering.ended().is_none() {
            return text(409, "the run is not over");
        }
        match self.finished_data() {
            Ok(bytes) => (200, JSON, bytes.to_vec()),
            Err(reason) => text(500, &reason),
        }
    }

    /// The data of a run whose folder is complete; built once.
    fn finished_data(&self) -> Result<Arc<Vec<u8>>, String> {
        let course = self.steering.context().ok_or("there was no run")?;
        let mut result = locked(&self.result);
        if let Some(made) = &*result {
            return Ok(made.clone());
        }
        let data = Live::result(&course.folder, &self.views).map_err(|error| error.to_string())?;
        Ok(result.insert(Arc::new(data.to_string().into_bytes())).clone())
    }

    fn control(&self, request: &Request) -> Response {
        if request.header("content-type") != Some(JSON) {
            return text(415, "a command comes as application/json");
        }
        let command = match command(&request.body) {
            Ok(command) => command,
            Err(reason) => return text(400, &reason),
        };
        match self.steering.execute(&command) {
            Ok(()) => (200, JSON, self.steering.state().to_string().into_bytes()),
            Err(reason) => text(409, &reason),
        }
    }
}

/// `{"do": "pause"}`, `{"do": "resume"}`, `{"do": "step", "participant": "plant"}`, `{"do": "step", "time": "10 ms"}`
fn command(body: &[u8]) -> Result<LiveCommand, String> {
    let body: Value = serde_json::from_slice(body).map_err(|error| format!("not JSON: {error}"))?;
    let part = |key: &str| body.get(key).and_then(Value::as_str);
    match (part("do"), part("participant"), part("time")) {
        (Some("pause"), None, None) => Ok(LiveCommand::Pause),
        (Some("resume"), None, None) => Ok(LiveCommand::Resume),
        (Some("step"), Some(name), None) => Ok(LiveCommand::StepOf(name.to_owned())),
        (Some("step"), None, Some(time)) => {
            let time = time
                .parse()
                .map_err(|error: lockstep::time::TimeError| error.to_string())?;
            Ok(LiveCommand::StepBy(time))
        }
        _ => Err("not a command: write pause, resume, or step with a participant or a time".into()),
    }
}

/// The error of `--live` when its port is not available.
pub fn refusal(port: u16, error: &io::Error) -> String {
    let address = SocketAddr::from((Ipv4Addr::LOCALHOST, port));
    format!("--live: cannot listen on {address}: {error}; name another port, or none for any that is free")
}

#[cfg(test)]
mod tests;

//! The server of the page. It listens on the loopback address alone.
//!
//! Any program of any user on the machine can connect to a loopback port, and any page that a browser shows can make it send
//! requests there. So: everything stands below a path with 128 random bits; requests must name the loopback address as their
//! host (a name that was bound to it afterwards is refused) and, where the browser says where they come from, come from
//! our own page; only a POST with a JSON body changes anything; and no answer may be read by another page.

use std::collections::{BTreeMap, VecDeque};
use std::io::{self, Read};
use std::net::{Ipv4Addr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use report::page::Live;
use report::view::Views;
use serde_json::{Value, json};

use super::Steering;
use super::http::{self, Bad, Request};
use super::steering::{Course, Wish};

/// Requests of our own page that are answered at once; more are turned away.
const CONNECTIONS: usize = 16;
/// Connections at once that have not sent our address yet. The oldest is closed for a new one: a page sends its request at once, and
/// a silent connection cannot block it.
const SILENT: usize = 64;
/// How long a browser may take to accept an answer.
const WRITE: Duration = Duration::from_secs(5);
/// A page that has not asked for this long is closed.
const ABSENT: Duration = Duration::from_secs(3);
/// How long the end waits for pages to fetch the result.
const FAREWELL: Duration = Duration::from_secs(5);
/// How many times as long as it has read the run the server rests before it reads it again, whoever asks: a tenth of a core is the
/// most that reading takes. Making the answers comes on top, once for each page that asks.
const RESTS: u32 = 9;
/// Pages that are remembered.
const PAGES: usize = 32;
const JSON: &str = "application/json";
const HTML: &str = "text/html";
const TEXT: &str = "text/plain";

/// A page that has asked.
struct Page {
    seen: Instant,
    has_result: bool,
}

/// The run as it is shown, and when it may be looked at again.
#[derive(Default)]
struct Watched {
    live: Option<Live>,
    not_before: Option<Instant>,
}

struct Shared {
    port: u16,
    token: String,
    steering: Arc<Steering>,
    views: Vec<Views>,
    /// Opened when the first page asks.
    live: Mutex<Watched>,
    result: Mutex<Option<Arc<Vec<u8>>>>,
    pages: Mutex<BTreeMap<String, Page>>,
    connections: AtomicUsize,
    /// Connections without a request so far, each with its number, the oldest first.
    silent: Mutex<VecDeque<(u64, TcpStream)>>,
}

/// A server in threads of its own, which end with the program.
pub struct Server {
    shared: Arc<Shared>,
}

fn locked<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Server {
    /// Listens on `port` of 127.0.0.1, or on one that the system chooses where it is 0. The page has the figures of `views`
    /// besides those of the scenario.
    pub fn start(port: u16, steering: Arc<Steering>, views: &[Views]) -> io::Result<Server> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
        let mut bits = [0_u8; 16];
        std::fs::File::open("/dev/urandom")?.read_exact(&mut bits)?;
        let shared = Arc::new(Shared {
            port: listener.local_addr()?.port(),
            token: bits.iter().map(|byte| format!("{byte:02x}")).collect(),
            steering,
            views: views.to_vec(),
            live: Mutex::new(Watched::default()),
            result: Mutex::new(None),
            pages: Mutex::new(BTreeMap::new()),
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

    /// The run folder is complete. Waits for open pages to fetch what it holds, but not for long.
    pub fn finish(&self, how: String) {
        // What pages will ask for is made here, with the priority of the run; the server's threads have a lower one.
        if !locked(&self.shared.pages).is_empty() {
            let _ = self.shared.whole();
        }
        self.shared.steering.end(how);
        let since = Instant::now();
        let waits = |page: &Page| !page.has_result && page.seen.elapsed() < ABSENT;
        while since.elapsed() < FAREWELL && locked(&self.shared.pages).values().any(waits) {
            std::thread::sleep(Duration::from_millis(10));
        }
        // The answer that was begun last is on its way.
        while since.elapsed() < FAREWELL && self.shared.connections.load(Ordering::Relaxed) > 0 {
            std::thread::sleep(Duration::from_millis(2));
        }
    }
}

fn accept(listener: &TcpListener, shared: &Arc<Shared>) {
    // Threads that are started here inherit it: the run comes first.
    let _ = rustix::process::setpriority_process(None, 10);
    for number in 0.. {
        let Ok((mut stream, peer)) = listener.accept() else {
            // Out of file descriptors, most likely: that passes.
            std::thread::sleep(Duration::from_millis(50));
            continue;
        };
        let _ = stream.set_read_timeout(Some(Duration::from_secs(1)));
        let _ = stream.set_write_timeout(Some(WRITE));
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

/// An answer: status, kind, body.
type Answer = (u16, &'static str, Vec<u8>);

fn serve(stream: &mut TcpStream, number: u64, shared: &Shared) {
    let request = match http::read(stream, Instant::now() + http::PATIENCE) {
        Ok(request) => request,
        Err(Bad::Answer(status, text)) => {
            let _ = http::answer(stream, status, TEXT, format!("{text}\n").as_bytes());
            return;
        }
        Err(Bad::Gone) => return,
    };
    let below = match allowed(&request, shared) {
        Err((status, text)) => {
            let _ = write_within(stream, status, TEXT, format!("{text}\n").as_bytes());
            return;
        }
        Ok(below) => below,
    };
    shared.remove_silent(number);
    let busy = shared.connections.fetch_add(1, Ordering::Relaxed);
    let (status, kind, body) = if busy < CONNECTIONS {
        route(&request, below, shared)
    } else {
        text(503, "too many connections")
    };
    let sent = write_within(stream, status, kind, &body);
    shared.connections.fetch_sub(1, Ordering::Relaxed);
    if let (Ok(()), 200, Some(id)) = (sent, status, page_id(&request))
        && request.path.ends_with("/result")
        && let Some(page) = locked(&shared.pages).get_mut(id)
    {
        page.has_result = true;
    }
}

/// A browser that accepts a few bytes now and then must not hold its place for ever.
fn write_within(stream: &mut TcpStream, status: u16, kind: &str, body: &[u8]) -> io::Result<()> {
    let mut bytes = Vec::with_capacity(body.len() + 1024);
    http::answer(&mut bytes, status, kind, body)?;
    let until = Instant::now() + WRITE;
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
    // Whoever closes first while bytes are under way breaks the connection: the other side is waited for.
    let _ = stream.set_read_timeout(Some(Duration::from_millis(200)));
    let _ = stream.read(&mut [0; 64]);
    Ok(())
}

/// What stands below the token of a request that may be answered.
fn allowed<'a>(request: &'a Request, shared: &Shared) -> Result<&'a str, (u16, &'static str)> {
    let port = shared.port;
    let ours = [format!("127.0.0.1:{port}"), format!("localhost:{port}")];
    if !request
        .header("host")
        .is_some_and(|host| ours.iter().any(|own| own == host))
    {
        return Err((403, "this server answers to 127.0.0.1 alone"));
    }
    let origin = request.header("origin");
    let from_us = origin.is_some_and(|origin| ours.iter().any(|own| origin.strip_prefix("http://") == Some(own)));
    if (request.has("origin") || request.method != "GET") && !from_us {
        return Err((403, "this request comes from another page"));
    }
    if request.has("sec-fetch-site") && !matches!(request.header("sec-fetch-site"), Some("same-origin" | "none")) {
        return Err((403, "this request comes from another page"));
    }
    let mut parts = request.path.splitn(3, '/').skip(1);
    let token = parts.next().unwrap_or_default();
    if !same(token.as_bytes(), shared.token.as_bytes()) {
        return Err((
            404,
            "there is nothing here: use the whole address that the run has printed",
        ));
    }
    parts.next().ok_or((404, "the address ends with a slash"))
}

/// Whether two texts are equal, in a time that does not tell where they differ.
fn same(a: &[u8], b: &[u8]) -> bool {
    a.len() == b.len() && a.iter().zip(b).fold(0, |difference, (x, y)| difference | (x ^ y)) == 0
}

fn page_id(request: &Request) -> Option<&str> {
    let id = request.parameter("page")?;
    (id.len() <= 32 && id.bytes().all(|byte| byte.is_ascii_alphanumeric())).then_some(id)
}

fn text(status: u16, text: &str) -> Answer {
    (status, TEXT, format!("{text}\n").into_bytes())
}

fn route(request: &Request, below: &str, shared: &Shared) -> Answer {
    match (request.method.as_str(), below) {
        ("GET", "") => shared.page(),
        ("GET", "news") => shared.news(request),
        ("GET", "result") => shared.result(),
        ("POST", "control") => shared.control(request),
        (_, "" | "news" | "result" | "control") => text(405, "not with this method"),
        _ => text(404, "there is nothing here"),
    }
}

/// Processor time of this thread: on a loaded machine a little work takes long, and is no reason to rest for longer still.
fn computed() -> Duration {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Duration::new(
        now.tv_sec.unsigned_abs(),
        u32::try_from(now.tv_nsec).unwrap_or_default(),
    )
}

/// What is shown until the first sample is there.
const SOON: &[u8] = b"<!DOCTYPE html><meta charset=utf-8><meta http-equiv=refresh content=1><title>Escapement</title>\
<body style='font-family:system-ui;margin:4rem;color:#667'>The run is about to begin.";

impl Shared {
    /// Adds connection `number`; closes the oldest silent one if there are too many.
    fn add_silent(&self, number: u64, stream: TcpStream) {
        let mut silent = locked(&self.silent);
        silent.push_back((number, stream));
        if silent.len() > SILENT
            && let Some((_, oldest)) = silent.pop_front()
        {
            // The thread of that connection reads its end, and ends.
            let _ = oldest.shutdown(Shutdown::Both);
        }
    }

    /// Removes connection `number`: its request is that of our page, or it is over.
    fn remove_silent(&self, number: u64) {
        locked(&self.silent).retain(|(silent, _)| *silent != number);
    }

    /// Does something with the live report; `None` while there is nothing to report.
    fn with_live<T>(
        &self,
        act: impl FnOnce(&mut Live, &Course) -> Result<T, report::page::ReportError>,
    ) -> Result<Option<T>, report::page::ReportError> {
        let Some(course) = self.steering.course() else {
            return Ok(None);
        };
        let mut watched = locked(&self.live);
        // Whoever asks too early waits here, and everybody behind it: the run has the machine, however many pages ask.
        if let Some(rest) = watched
            .not_before
            .map(|when| when.saturating_duration_since(Instant::now()))
        {
            std::thread::sleep(rest);
        }
        let began = computed();
        if watched.live.is_none() {
            let duration = course.plan.timebase.seconds(course.plan.end);
            watched.live = Some(Live::open(&course.folder, duration, &self.views)?);
        }
        let live = watched.live.as_mut().expect("just made");
        let done = match live.ready() {
            Ok(true) => act(live, course).map(Some),
            Ok(false) => Ok(None),
            Err(error) => Err(error),
        };
        watched.not_before = Some(Instant::now() + computed().saturating_sub(began) * RESTS);
        done
    }

    fn page(&self) -> Answer {
        let about = |course: &Course| {
            let own = course.plan.participants.iter();
            let participants: Vec<Value> = own
                .map(|own| json!({ "name": own.name, "period_s": own.period.seconds() }))
                .collect();
            json!({
                "participants": participants,
                "duration_s": course.plan.timebase.seconds(course.plan.end),
                "state": self.steering.state(),
            })
        };
        match self.with_live(|live, course| live.page(&about(course))) {
            Ok(Some(page)) => (200, HTML, page.into_bytes()),
            Ok(None) => (200, HTML, SOON.to_vec()),
            Err(error) => text(500, &error.to_string()),
        }
    }

    fn news(&self, request: &Request) -> Answer {
        if let Some(id) = page_id(request) {
            let mut pages = locked(&self.pages);
            pages.retain(|_, page| page.seen.elapsed() < ABSENT);
            if pages.len() < PAGES || pages.contains_key(id) {
                let page = pages.entry(id.to_owned()).or_insert(Page {
                    seen: Instant::now(),
                    has_result: false,
                });
                page.seen = Instant::now();
            }
        }
        let have = request.parameter("have").unwrap_or_default();
        let have: Vec<u64> = have.split('-').filter_map(|number| number.parse().ok()).collect();
        // The state first: what it says of the run is on the tape then.
        let state = self.steering.state();
        match self.with_live(|live, _| live.news(&have)) {
            Ok(news) => {
                let mut news = news.unwrap_or_else(|| json!({}));
                news["state"] = state;
                (200, JSON, news.to_string().into_bytes())
            }
            Err(error) => text(500, &error.to_string()),
        }
    }

    /// What the page of the finished run shows.
    fn result(&self) -> Answer {
        if self.steering.ended().is_none() {
            return text(409, "the run is not over");
        }
        match self.whole() {
            Ok(bytes) => (200, JSON, bytes.to_vec()),
            Err(reason) => text(500, &reason),
        }
    }

    /// The whole of a run whose folder is complete; made once.
    fn whole(&self) -> Result<Arc<Vec<u8>>, String> {
        let course = self.steering.course().ok_or("there was no run")?;
        let mut result = locked(&self.result);
        if let Some(made) = &*result {
            return Ok(made.clone());
        }
        let data = Live::result(&course.folder, &self.views).map_err(|error| error.to_string())?;
        Ok(result.insert(Arc::new(data.to_string().into_bytes())).clone())
    }

    fn control(&self, request: &Request) -> Answer {
        if request.header("content-type") != Some(JSON) {
            return text(415, "a wish comes as application/json");
        }
        let wish = match wish(&request.body) {
            Ok(wish) => wish,
            Err(reason) => return text(400, &reason),
        };
        match self.steering.obey(&wish) {
            Ok(()) => (200, JSON, self.steering.state().to_string().into_bytes()),
            Err(reason) => text(409, &reason),
        }
    }
}

/// `{"do": "pause"}`, `{"do": "resume"}`, `{"do": "step", "participant": "plant"}`, `{"do": "step", "time": "10 ms"}`
fn wish(body: &[u8]) -> Result<Wish, String> {
    let body: Value = serde_json::from_slice(body).map_err(|error| format!("not JSON: {error}"))?;
    let part = |key: &str| body.get(key).and_then(Value::as_str);
    match (part("do"), part("participant"), part("time")) {
        (Some("pause"), None, None) => Ok(Wish::Pause),
        (Some("resume"), None, None) => Ok(Wish::Resume),
        (Some("step"), Some(name), None) => Ok(Wish::StepOf(name.to_owned())),
        (Some("step"), None, Some(time)) => {
            let time = time
                .parse()
                .map_err(|error: lockstep::time::TimeError| error.to_string())?;
            Ok(Wish::StepBy(time))
        }
        _ => Err("not a wish: write pause, resume, or step with a participant or a time".into()),
    }
}

/// The port of `--live` and what to call it when it cannot be had.
pub fn refusal(port: u16, error: &io::Error) -> String {
    let address = SocketAddr::from((Ipv4Addr::LOCALHOST, port));
    format!("--live: cannot listen on {address}: {error}; name another port, or none for any that is free")
}

#[cfg(test)]
mod tests;

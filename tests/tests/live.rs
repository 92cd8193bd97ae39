//! A run that is followed and controlled from a page: the effect of its commands, and the rejection of every other access.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use escapement_tests::fixture::write_oscillator;
use escapement_tests::machine::processes_of;
use escapement_tests::page::LivePage;
use escapement_tests::program::{Folder, ProgramOutput, orchestrator, root, run_orchestrator, text, wait_for_output};
use serde_json::Value;

/// A run under way with the address of its page.
struct LiveRun {
    child: Option<Child>,
    stderr: BufReader<std::process::ChildStderr>,
    page: LivePage,
}

impl LiveRun {
    /// A run of `scenario` into `out` that is paused at 1 s.
    fn at_one_second(scenario: &Path, out: &Path) -> LiveRun {
        let (scenario, out) = (text(scenario), text(out));
        let pause = ["--quiet", "--live", "--pause-at", "1 s"];
        let run = LiveRun::start(&[&["run", scenario, "--out", out][..], &pause].concat());
        run.wait_for_pause_at(1.0);
        run
    }

    fn start(arguments: &[&str]) -> LiveRun {
        let mut child = Command::new(orchestrator())
            .args(arguments)
            .current_dir(root())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut stderr = BufReader::new(child.stderr.take().unwrap());
        let mut line = String::new();
        stderr.read_line(&mut line).unwrap();
        let page = LivePage::announced_in(&line).unwrap_or_else(|| panic!("{line}"));
        LiveRun {
            child: Some(child),
            stderr,
            page,
        }
    }

    /// Status and body of the answer to a request; `{host}`, `{path}` and `{origin}` stand for those of the page.
    fn ask(&self, request: &str) -> (u16, String) {
        self.page.try_request(request).unwrap()
    }

    fn get(&self, below: &str) -> (u16, String) {
        self.ask(&format!("GET {{path}}{below} HTTP/1.1\nHost: {{host}}\n\n"))
    }

    fn command(&self, body: &str) -> (u16, String) {
        self.page.try_command(body).unwrap()
    }

    fn state(&self) -> Value {
        let (status, body) = self.get("news?have=");
        assert_eq!(status, 200, "{body}");
        serde_json::from_str::<Value>(&body).unwrap()["state"].clone()
    }

    /// Waits until all participants are paused at this horizon.
    fn wait_for_pause_at(&self, seconds: f64) {
        let started = Instant::now();
        loop {
            let state = self.state();
            if state["resting"] == true && state["horizon"] == seconds {
                return;
            }
            assert!(started.elapsed() < Duration::from_secs(60), "{state}");
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// An open page fetches the result; there is none here, so the program ends at once.
    fn end(mut self) -> ProgramOutput {
        let mut output = wait_for_output(self.child.take().unwrap());
        self.stderr.read_to_string(&mut output.err).unwrap();
        output
    }
}

impl Drop for LiveRun {
    fn drop(&mut self) {
        if let Some(child) = &mut self.child {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// Waits until a stream has this many records on the disk.
fn wait_for_records(folder: &Path, stream: &str, records: u64, size: u64) {
    let started = Instant::now();
    loop {
        let length = std::fs::metadata(folder.join("tape").join(stream)).unwrap().len();
        if length == records * size {
            return;
        }
        assert!(
            length < records * size,
            "{stream}: {} records of {records}",
            length / size
        );
        assert!(started.elapsed() < Duration::from_secs(60), "{stream}: {length}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn page_pauses_steps_and_resumes_without_changing_the_tape() {
    let folder = Folder::new("live");
    let scenario = write_oscillator(&folder, "damper");
    let quiet = folder.path().join("quiet");
    assert_eq!(
        run_orchestrator(&["run", text(&scenario), "--out", text(&quiet), "--quiet"]).code,
        Some(0)
    );
    let out = folder.path().join("run");
    let run = LiveRun::at_one_second(&scenario, &out);
    wait_for_records(&out, "damper.push.bin", 100, 24);
    // The next activation of the damper is at 1 s, the following one at 1.01 s; the plant executes everything before it.
    assert_eq!(run.command(r#"{"do": "step", "participant": "damper"}"#).0, 200);
    run.wait_for_pause_at(1.001);
    wait_for_records(&out, "damper.push.bin", 101, 24);
    wait_for_records(&out, "plant.motion.bin", 1002, 24);
    assert_eq!(run.command(r#"{"do": "step", "participant": "damper"}"#).0, 200);
    run.wait_for_pause_at(1.011);
    wait_for_records(&out, "damper.push.bin", 102, 24);
    assert_eq!(run.command(r#"{"do": "step", "time": "1/300 s"}"#).0, 200);
    run.wait_for_pause_at(1.015);
    assert_eq!(run.command(r#"{"do": "step", "participant": "nobody"}"#).0, 409);
    assert_eq!(run.command(r#"{"do": "dance"}"#).0, 400);
    let (status, page) = run.get("");
    assert_eq!(status, 200);
    assert!(
        page.contains("connect-src 'self'") && page.contains("\"live\":{"),
        "it is a page that asks for news"
    );
    assert_eq!(run.get("result").0, 409, "there is no result yet");
    assert_eq!(run.command(r#"{"do": "resume"}"#).0, 200);
    let output = run.end();
    assert_eq!(output.code, Some(0), "{output:?}");
    for stream in ["plant.motion.bin", "damper.push.bin"] {
        let tape = |folder: &Path| std::fs::read(folder.join("tape").join(stream)).unwrap();
        assert!(tape(&quiet) == tape(&out), "{stream} is another one");
    }
    assert_eq!(processes_of(folder.path()), Vec::<String>::new(), "processes are left");
}

#[test]
fn run_in_one_process_is_steered_and_serves_its_result() {
    let folder = Folder::new("live-in-process");
    let out = folder.path().join("run");
    let scenario = root().join("scenarios/close.toml");
    let arguments = [
        "run",
        text(&scenario),
        "--duration",
        "2 s",
        "--in-process",
        "--out",
        text(&out),
        "--quiet",
    ];
    let run = LiveRun::start(&[&arguments[..], &["--live-stay", "--pause-at", "0.5 s"]].concat());
    run.wait_for_pause_at(0.5);
    assert_eq!(run.command(r#"{"do": "step", "time": "0.25 s"}"#).0, 200);
    run.wait_for_pause_at(0.75);
    wait_for_records(&out, "controller.command.bin", 75, 8 * 14);
    // The page's data of a paused run, compared with the tape: every n-th sample and the newest.
    let (_, news) = run.get("news?have=0-0");
    let news: Value = serde_json::from_str(&news).unwrap();
    assert_eq!(news["figures"]["base-torque"][0]["samples"], 75);
    assert_eq!(news["figures"]["position-error"][0]["samples"], 751);
    assert_eq!(run.command(r#"{"do": "resume"}"#).0, 200);
    let started = Instant::now();
    while run.state()["ended"] != "complete" {
        assert!(started.elapsed() < Duration::from_secs(60));
        std::thread::sleep(Duration::from_millis(2));
    }
    let (status, result) = run.get("result");
    assert_eq!(status, 200);
    let result: Value = serde_json::from_str(&result).unwrap();
    let digest = result["runs"][0]["digest"].as_str().unwrap().to_owned();
    let summary: Value = serde_json::from_slice(&std::fs::read(out.join("summary.json")).unwrap()).unwrap();
    assert_eq!(summary["tape_digest"], digest.as_str());
    assert_eq!(
        run.command(r#"{"do": "pause"}"#).0,
        409,
        "a run that is over cannot be paused"
    );
    let pid = rustix::process::Pid::from_raw(run.child.as_ref().unwrap().id() as i32).unwrap();
    rustix::process::kill_process(pid, rustix::process::Signal::INT).unwrap();
    assert!(matches!(run.end().code, Some(0 | 3)), "it stays until it is told to go");
}

#[test]
fn refused_run_has_no_address() {
    let folder = Folder::new("live-refused");
    let scenario = write_oscillator(&folder, "damper");
    let out = folder.path().join("run");
    std::fs::create_dir(&out).unwrap();
    std::fs::write(out.join("notes.txt"), "work of years").unwrap();
    let output = run_orchestrator(&["run", text(&scenario), "--out", text(&out), "--force", "--live"]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(output.err.contains("is not replaced"), "{output:?}");
    assert!(!output.err.contains("live: "), "{output:?}");
}

/// Requests that do not come from the page: their content, and the status that they receive.
fn foreign_requests() -> [(&'static str, String, u16); 10] {
    let resume = "Content-Type: application/json\nContent-Length: 16\n\n{\"do\": \"resume\"}";
    [
        (
            "rebinding",
            "GET {path} HTTP/1.1\nHost: evil.example\n\n".to_owned(),
            403,
        ),
        ("no token", "GET / HTTP/1.1\nHost: {host}\n\n".to_owned(), 404),
        (
            "a guessed token",
            "GET /00000000000000000000000000000000/ HTTP/1.1\nHost: {host}\n\n".to_owned(),
            404,
        ),
        (
            "another page reads",
            "GET {path}news HTTP/1.1\nHost: {host}\nOrigin: http://evil.example\n\n".to_owned(),
            403,
        ),
        (
            "another page posts",
            format!("POST {{path}}control HTTP/1.1\nHost: {{host}}\nOrigin: http://evil.example\n{resume}"),
            403,
        ),
        (
            "a page without origin",
            format!("POST {{path}}control HTTP/1.1\nHost: {{host}}\nOrigin: null\n{resume}"),
            403,
        ),
        (
            "no token posts",
            format!("POST /control HTTP/1.1\nHost: {{host}}\nOrigin: {{origin}}\n{resume}"),
            404,
        ),
        (
            "an image",
            "GET {path}control?do=resume HTTP/1.1\nHost: {host}\n\n".to_owned(),
            405,
        ),
        (
            "a form",
            format!(
                "POST {{path}}control HTTP/1.1\nHost: {{host}}\nOrigin: {{origin}}\n{}",
                resume.replace("application/json", "text/plain")
            ),
            415,
        ),
        ("garbage", "\u{1}\u{2}\u{3}\n\n".to_owned(), 400),
    ]
}

#[test]
fn only_clients_with_the_address_see_or_steer_the_run() {
    let folder = Folder::new("live-hostile");
    let scenario = write_oscillator(&folder, "damper");
    let out = folder.path().join("run");
    let run = LiveRun::at_one_second(&scenario, &out);
    for (what, request, status) in foreign_requests() {
        assert_eq!(run.ask(&request).0, status, "{what}");
    }
    let port: u16 = run.page.host.rsplit(':').next().unwrap().parse().unwrap();
    let open = std::fs::read_to_string("/proc/net/tcp").unwrap();
    let listens = open
        .lines()
        .filter(|line| line.contains(&format!(":{port:04X} 00000000:0000 0A")));
    let addresses: Vec<&str> = listens.filter_map(|line| line.split_whitespace().nth(1)).collect();
    assert_eq!(
        addresses,
        [format!("0100007F:{port:04X}")],
        "it listens on 127.0.0.1 alone"
    );
    let taken = format!("--live={port}");
    let other = run_orchestrator(&["run", text(&scenario), "--quiet", &taken]);
    assert_eq!(other.code, Some(2), "{other:?}");
    assert!(
        other.err.contains("--live") && other.err.contains("another port"),
        "{other:?}"
    );
    // None of these requests has advanced the run. The page does, while other clients hold connections and read nothing.
    run.wait_for_pause_at(1.0);
    let held: Vec<TcpStream> = (0..15).map(|_| run.page.connect().unwrap()).collect();
    for mut stream in held.iter().take(8) {
        let page = format!("GET {} HTTP/1.1\r\nHost: {}\r\n\r\n", run.page.path, run.page.host);
        stream.write_all(page.as_bytes()).unwrap();
    }
    assert_eq!(run.command(r#"{"do": "resume"}"#).0, 200);
    let output = run.end();
    assert_eq!(output.code, Some(0), "{output:?}");
    drop(held);
}

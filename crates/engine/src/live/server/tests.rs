//! Tests of the live page's server: which requests are accepted, and which are rejected.

use super::*;

fn shared() -> Shared {
    Shared {
        port: 4711,
        token: "0123456789abcdef".into(),
        steering: Arc::new(Steering::default()),
        views: Vec::new(),
        live: Mutex::new(LiveReport::default()),
        result: Mutex::new(None),
        pages: Mutex::default(),
        connections: AtomicUsize::new(0),
        silent: Mutex::default(),
    }
}

fn status(text: &str) -> u16 {
    let text = text.replace('\n', "\r\n") + "\r\n\r\n";
    let Ok(request) = http::read_request(&mut text.as_bytes(), Instant::now() + http::REQUEST_TIMEOUT) else {
        return 400;
    };
    let shared = shared();
    match authorize(&request, &shared) {
        Err((status, _)) => status,
        Ok(subpath) => route(&request, subpath, &shared).0,
    }
}

#[test]
fn server_answers_only_its_own_page() {
    let get = "GET /0123456789abcdef/ HTTP/1.1\nHost: 127.0.0.1:4711";
    assert_eq!(status(get), 200);
    assert_eq!(status(&get.replace("127.0.0.1", "localhost")), 200);
    for (what, host) in [
        ("rebound", "evil.example:4711"),
        ("another port", "127.0.0.1:80"),
        ("bare", "127.0.0.1"),
    ] {
        assert_eq!(status(&get.replace("127.0.0.1:4711", host)), 403, "{what}");
    }
    assert_eq!(status(&get.replace("\nHost: 127.0.0.1:4711", "")), 403, "no host");
    assert_eq!(status(&format!("{get}\nHost: 127.0.0.1:4711")), 403, "two hosts");
    assert_eq!(status(&format!("{get}\nOrigin: http://evil.example")), 403);
    assert_eq!(status(&format!("{get}\nOrigin: null")), 403);
    assert_eq!(status(&format!("{get}\nSec-Fetch-Site: cross-site")), 403);
    assert_eq!(status(&format!("{get}\nSec-Fetch-Site: none")), 200);
    for path in [
        "/",
        "/0123456789abcdee/",
        "/0123456789abcdef",
        "/0123456789abcdef/x",
        "/0123456789abcdef//",
    ] {
        assert_eq!(
            status(&get.replace("/0123456789abcdef/ ", &format!("{path} "))),
            404,
            "{path}"
        );
    }
}

#[test]
fn server_accepts_commands_only_from_its_own_page() {
    let head = "POST /0123456789abcdef/control HTTP/1.1\nHost: 127.0.0.1:4711";
    let ours = "Origin: http://127.0.0.1:4711";
    let body = "Content-Type: application/json\nContent-Length: 0";
    assert_eq!(status(&format!("{head}\n{body}")), 403, "without an origin");
    assert_eq!(
        status(&format!("{head}\nOrigin: http://127.0.0.1:80\n{body}")),
        403,
        "another port"
    );
    assert_eq!(
        status(&format!("{head}\n{ours}\nContent-Type: text/plain")),
        415,
        "what a form can send"
    );
    assert_eq!(status(&format!("{head}\n{ours}\n{body}")), 400, "an empty command");
    assert_eq!(status(&head.replace("POST", "GET")), 405);
    assert_eq!(status(&format!("{}\n{ours}", head.replace("control", "news"))), 405);
    assert_eq!(
        status(&format!("{}\n{ours}", head.replace("POST", "OPTIONS"))),
        405,
        "no preflight"
    );
}

#[test]
fn silent_connections_do_not_block_the_page() {
    let server = Server::start(0, Arc::new(Steering::default()), &[]).unwrap();
    let port = server.shared.port;
    let connect = || TcpStream::connect((Ipv4Addr::LOCALHOST, port)).unwrap();
    let silent: Vec<TcpStream> = (0..4 * SILENT_MAX).map(|_| connect()).collect();
    let mut stream = connect();
    let path = format!("/{}/", server.shared.token);
    let request = format!("GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n");
    io::Write::write_all(&mut stream, request.as_bytes()).unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 200 "), "{answer}");
    drop(silent);
}

#[test]
fn server_end_waits_for_page_without_a_request_yet() {
    let shared = shared();
    let start = Instant::now();
    let waits = || locked(&shared.pages).has_pending(start);
    assert!(!waits());
    let get = |subpath: &str| {
        let text = format!("GET /0123456789abcdef/{subpath} HTTP/1.1\r\nHost: 127.0.0.1:4711\r\n\r\n");
        let Ok(request) = http::read_request(&mut text.as_bytes(), Instant::now() + http::REQUEST_TIMEOUT) else {
            panic!("{text}");
        };
        let subpath = authorize(&request, &shared).unwrap();
        route(&request, subpath, &shared)
    };
    // The run has not begun, so this page asks for the report a second later.
    assert_eq!(get("").2, WAITING_PAGE);
    assert!(waits());
    get("news?page=a&have=");
    assert!(waits());
}

#[test]
fn live_commands_are_parsed_strictly() {
    assert_eq!(command(br#"{"do":"pause"}"#), Ok(LiveCommand::Pause));
    assert_eq!(
        command(br#"{"do":"step","participant":"plant"}"#),
        Ok(LiveCommand::StepOf("plant".into()))
    );
    assert_eq!(
        command(br#"{"do":"step","time":"10 ms"}"#),
        Ok(LiveCommand::StepBy(lockstep::time::Rational::from_millis(10)))
    );
    for body in [
        "",
        "[]",
        "{}",
        r#"{"do":"step"}"#,
        r#"{"do":"stop"}"#,
        r#"{"do":"step","time":"soon"}"#,
        r#"{"do":"step","participant":"a","time":"1 s"}"#,
    ] {
        assert!(command(body.as_bytes()).is_err(), "{body}");
    }
    assert_eq!(
        shared().steering.execute(&LiveCommand::Pause),
        Err("the run has not begun yet".into())
    );
}

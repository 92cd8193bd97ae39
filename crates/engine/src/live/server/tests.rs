//! Which requests are answered, and how.

use super::*;

fn shared() -> Shared {
    Shared {
        port: 4711,
        token: "0123456789abcdef".into(),
        steering: Arc::new(Steering::default()),
        views: Vec::new(),
        live: Mutex::new(Watched::default()),
        result: Mutex::new(None),
        pages: Mutex::default(),
        connections: AtomicUsize::new(0),
        silent: Mutex::default(),
    }
}

fn status(text: &str) -> u16 {
    let text = text.replace('\n', "\r\n") + "\r\n\r\n";
    let Ok(request) = http::read(&mut text.as_bytes(), Instant::now() + http::PATIENCE) else {
        return 400;
    };
    let shared = shared();
    match allowed(&request, &shared) {
        Err((status, _)) => status,
        Ok(below) => route(&request, below, &shared).0,
    }
}

#[test]
fn only_our_own_page_is_answered() {
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
fn only_a_post_of_our_own_page_changes_anything() {
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
    let silent: Vec<TcpStream> = (0..4 * SILENT).map(|_| connect()).collect();
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
fn the_end_waits_for_a_page_that_was_sent_and_has_asked_for_nothing_yet() {
    let shared = shared();
    let start = Instant::now();
    let waits = || locked(&shared.pages).wait(start);
    assert!(!waits());
    let get = |below: &str| {
        let text = format!("GET /0123456789abcdef/{below} HTTP/1.1\r\nHost: 127.0.0.1:4711\r\n\r\n");
        let Ok(request) = http::read(&mut text.as_bytes(), Instant::now() + http::PATIENCE) else {
            panic!("{text}");
        };
        let below = allowed(&request, &shared).unwrap();
        route(&request, below, &shared)
    };
    // The run has not begun, so this page asks for the report a second later.
    assert_eq!(get("").2, SOON);
    assert!(waits());
    get("news?page=a&have=");
    assert!(waits());
}

#[test]
fn commands_are_read_strictly() {
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
        shared().steering.obey(&LiveCommand::Pause),
        Err("the run has not begun yet".into())
    );
}

//! A subset of HTTP/1.1 for a page on the same machine: one request per connection, every size and time bounded.

use std::io::{self, Read, Write};
use std::time::{Duration, Instant};

/// Maximum length of the head of a request, bytes.
const HEAD_MAX: usize = 16 * 1024;
/// Maximum length of the body, bytes.
const BODY_MAX: usize = 4 * 1024;
/// Maximum time for a request to arrive.
pub const REQUEST_TIMEOUT: Duration = Duration::from_secs(5);

/// A request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Request {
    /// `GET`, `POST`, …
    pub method: String,
    /// The path, without the query.
    pub path: String,
    /// The query after the question mark.
    pub query: String,
    /// Header fields; names in lower case.
    headers: Vec<(String, String)>,
    /// The body.
    pub body: Vec<u8>,
}

impl Request {
    /// The value of the header of this name (lower case) where it occurs exactly once.
    pub fn header(&self, name: &str) -> Option<&str> {
        let mut found = self.headers.iter().filter(|(known, _)| known == name);
        let first = found.next()?;
        found.next().is_none().then_some(first.1.as_str())
    }

    /// Whether there is a header of this name (lower case).
    pub fn has(&self, name: &str) -> bool {
        self.headers.iter().any(|(known, _)| known == name)
    }

    /// The value of a key in the query. Nothing is decoded: our own page sends nothing that needs decoding.
    pub fn parameter(&self, key: &str) -> Option<&str> {
        let mut pairs = self.query.split('&').filter_map(|pair| pair.split_once('='));
        pairs.find_map(|(known, value)| (known == key).then_some(value))
    }
}

/// Why a request cannot be served.
#[derive(Debug)]
pub enum RequestError {
    /// Answer with this status and text.
    Rejected(u16, &'static str),
    /// The connection is closed; no answer is possible.
    Disconnected,
}

impl From<io::Error> for RequestError {
    fn from(_: io::Error) -> RequestError {
        RequestError::Disconnected
    }
}

/// Reads one request, and tolerates any input.
pub fn read_request(stream: &mut impl Read, until: Instant) -> Result<Request, RequestError> {
    let mut bytes = Vec::new();
    let mut chunk = [0; 2048];
    let end = loop {
        if let Some(end) = bytes.windows(4).position(|part| part == b"\r\n\r\n") {
            break end;
        }
        if bytes.len() > HEAD_MAX {
            return Err(RequestError::Rejected(431, "the head of the request is too long"));
        }
        if Instant::now() > until {
            return Err(RequestError::Rejected(408, "the request took too long"));
        }
        match stream.read(&mut chunk)? {
            0 => return Err(RequestError::Disconnected),
            count => bytes.extend_from_slice(&chunk[..count]),
        }
    };
    let mut request = parse_head(&bytes[..end])?;
    let length = match request.header("content-length") {
        _ if request.has("transfer-encoding") => {
            return Err(RequestError::Rejected(501, "a body comes with its length"));
        }
        None if request.has("content-length") => return Err(RequestError::Rejected(400, "two lengths")),
        None => 0,
        Some(text) => {
            let plain = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
            let length = text.parse::<usize>().ok().filter(|_| plain);
            length.ok_or(RequestError::Rejected(400, "the length is not a number"))?
        }
    };
    if length > BODY_MAX {
        return Err(RequestError::Rejected(413, "the body is too long"));
    }
    request.body = bytes.split_off(end + 4);
    while request.body.len() < length {
        if Instant::now() > until {
            return Err(RequestError::Rejected(408, "the request took too long"));
        }
        match stream.read(&mut chunk)? {
            0 => return Err(RequestError::Disconnected),
            count => request.body.extend_from_slice(&chunk[..count]),
        }
    }
    request.body.truncate(length);
    Ok(request)
}

fn parse_head(bytes: &[u8]) -> Result<Request, RequestError> {
    let malformed = RequestError::Rejected(400, "the request is malformed");
    let Ok(text) = std::str::from_utf8(bytes) else {
        return Err(malformed);
    };
    let mut lines = text.split("\r\n");
    let first: Vec<&str> = lines.next().unwrap_or_default().split(' ').collect();
    let [method, target, version] = first[..] else {
        return Err(malformed);
    };
    let token = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_alphanumeric() || b"-_".contains(&b));
    let plain = target.starts_with('/') && target.bytes().all(|byte| byte.is_ascii_graphic());
    if !token(method) || !plain || !matches!(version, "HTTP/1.1" | "HTTP/1.0") {
        return Err(malformed);
    }
    let mut headers = Vec::new();
    for line in lines {
        let Some((name, value)) = line.split_once(':').filter(|(name, _)| token(name)) else {
            return Err(malformed);
        };
        if value.bytes().any(|byte| byte < b' ' && byte != b'\t') {
            return Err(malformed);
        }
        headers.push((name.to_ascii_lowercase(), value.trim().to_owned()));
    }
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
    Ok(Request {
        method: method.to_owned(),
        path: path.to_owned(),
        query: query.to_owned(),
        headers,
        body: Vec::new(),
    })
}

/// Writes an answer. Its headers forbid other pages to cache, sniff, frame or read it.
pub fn write_response(stream: &mut impl Write, status: u16, kind: &str, body: &[u8]) -> io::Result<()> {
    let reason = match status {
        200 => "OK",
        204 => "No Content",
        400 => "Bad Request",
        403 => "Forbidden",
        404 => "Not Found",
        405 => "Method Not Allowed",
        408 => "Request Timeout",
        409 => "Conflict",
        413 => "Content Too Large",
        415 => "Unsupported Media Type",
        431 => "Request Header Fields Too Large",
        501 => "Not Implemented",
        503 => "Service Unavailable",
        _ => "Error",
    };
    let head = format!(
        "HTTP/1.1 {status} {reason}\r\n\
         Content-Type: {kind}; charset=utf-8\r\n\
         Content-Length: {}\r\n\
         Connection: close\r\n\
         Cache-Control: no-store\r\n\
         Content-Security-Policy: default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; \
         img-src data: blob:; connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'\r\n\
         Cross-Origin-Opener-Policy: same-origin\r\n\
         Cross-Origin-Resource-Policy: same-origin\r\n\
         Referrer-Policy: no-referrer\r\n\
         X-Content-Type-Options: nosniff\r\n\
         X-Frame-Options: DENY\r\n\r\n",
        body.len()
    );
    stream.write_all(head.as_bytes())?;
    stream.write_all(body)?;
    stream.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &[u8]) -> Result<Request, RequestError> {
        read_request(&mut &text[..], Instant::now() + REQUEST_TIMEOUT)
    }

    fn status(text: &[u8]) -> u16 {
        match parse(text) {
            Ok(_) => 200,
            Err(RequestError::Rejected(status, _)) => status,
            Err(RequestError::Disconnected) => 0,
        }
    }

    #[test]
    fn request_is_parsed_into_its_parts() {
        let request = parse(b"POST /a/b?x=1&y= HTTP/1.1\r\nHost: h\r\ncontent-LENGTH: 3\r\n\r\nabcdef").unwrap();
        assert_eq!((request.method.as_str(), request.path.as_str()), ("POST", "/a/b"));
        assert_eq!(
            (request.parameter("x"), request.parameter("y"), request.parameter("z")),
            (Some("1"), Some(""), None)
        );
        assert_eq!((request.header("host"), &request.body[..]), (Some("h"), &b"abc"[..]));
    }

    #[test]
    fn malformed_request_is_rejected() {
        for text in [
            &b"GET\r\n\r\n"[..],
            b"GET / HTTP/2\r\n\r\n",
            b"GET  / HTTP/1.1\r\n\r\n",
            b"GET http://x/ HTTP/1.1\r\n\r\n",
            b"G\x00T / HTTP/1.1\r\n\r\n",
            b"GET /\xff HTTP/1.1\r\n\r\n",
            b"GET / HTTP/1.1\r\nno colon\r\n\r\n",
            b"GET / HTTP/1.1\r\nHost : x\r\n\r\n",
            b"GET / HTTP/1.1\r\n folded: x\r\n\r\n",
            b"GET / HTTP/1.1\r\nA: b\nC: d\r\n\r\n",
            b"POST / HTTP/1.1\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\nab",
            b"POST / HTTP/1.1\r\nContent-Length: +1\r\n\r\na",
            b"POST / HTTP/1.1\r\nContent-Length: 99999999999999999999\r\n\r\na",
        ] {
            assert_eq!(status(text), 400, "{}", String::from_utf8_lossy(text));
        }
        assert_eq!(
            status(b"POST / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n"),
            501
        );
        assert_eq!(status(b"POST / HTTP/1.1\r\nContent-Length: 5000\r\n\r\n"), 413);
        assert_eq!(status(&[b'a'; 20_000]), 431);
        assert_eq!(status(b"GET / HTTP/1.1\r\n"), 0, "nobody is there any more");
        let late = read_request(&mut &b"GET / HT"[..], Instant::now() - REQUEST_TIMEOUT);
        assert!(matches!(late, Err(RequestError::Rejected(408, _))), "{late:?}");
    }

    #[test]
    fn request_parser_never_panics() {
        let stream = lockstep::random::Stream::new(7, "http");
        let good = b"POST /t/control?x=1 HTTP/1.1\r\nHost: 127.0.0.1:1\r\nContent-Length: 2\r\n\r\n{}".to_vec();
        for round in 0..20_000_u64 {
            let mut text = good.clone();
            for change in 0..4 {
                let draw = stream.bits(4 * round + change);
                let at = (draw >> 8) as usize % text.len();
                match draw % 3 {
                    0 => text[at] = (draw >> 40) as u8,
                    1 => text.truncate(at.max(1)),
                    _ => text.insert(at, (draw >> 40) as u8),
                }
            }
            let _ = parse(&text);
        }
    }
}

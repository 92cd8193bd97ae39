//! The page of a run under `--live`, queried as by a browser.

use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::time::Duration;

/// The address of a page.
#[derive(Debug, Clone)]
pub struct LivePage {
    /// Address and port.
    pub host: String,
    /// The path, with the secret of the run.
    pub path: String,
}

impl LivePage {
    /// The page announced by the orchestrator in `stderr`.
    pub fn announced_in(stderr: &str) -> Option<LivePage> {
        let url = stderr
            .lines()
            .find_map(|line| line.trim().strip_prefix("live: http://"))?;
        let (host, path) = url.split_once('/')?;
        Some(LivePage {
            host: host.to_owned(),
            path: format!("/{path}"),
        })
    }

    /// Status and body of the answer to a request; `{host}`, `{path}` and `{origin}` stand for those of the page.
    ///
    /// # Errors
    /// When the server has ended, or does not answer.
    pub fn try_request(&self, request: &str) -> io::Result<(u16, String)> {
        let request = request.replace("{host}", &self.host).replace("{path}", &self.path);
        let request = request.replace("{origin}", &format!("http://{}", self.host));
        let mut stream = self.connect()?;
        stream.write_all(request.replace('\n', "\r\n").as_bytes())?;
        let mut answer = String::new();
        stream.read_to_string(&mut answer)?;
        let status = answer.split(' ').nth(1).and_then(|word| word.parse().ok());
        let body = answer.split_once("\r\n\r\n").map(|(_, body)| body.to_owned());
        let status = status.ok_or_else(|| io::Error::other(format!("no answer: {answer}")))?;
        Ok((status, body.unwrap_or_default()))
    }

    /// A connection to the server.
    ///
    /// # Errors
    /// When there is no connection.
    pub fn connect(&self) -> io::Result<TcpStream> {
        let stream = TcpStream::connect(&self.host)?;
        stream.set_read_timeout(Some(Duration::from_secs(60)))?;
        Ok(stream)
    }

    /// A command, such as `{"do": "pause"}`, as the page sends it.
    ///
    /// # Errors
    /// As of [`LivePage::try_request`].
    pub fn try_command(&self, body: &str) -> io::Result<(u16, String)> {
        let length = body.len();
        self.try_request(&format!(
            "POST {{path}}control HTTP/1.1\nHost: {{host}}\nOrigin: {{origin}}\nContent-Type: application/json\n\
             Content-Length: {length}\n\n{body}"
        ))
    }
}

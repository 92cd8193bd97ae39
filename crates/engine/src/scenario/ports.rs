//! Names of ports, and of fields of ports, as written in a scenario.

/// An end of a connection: participant, port, and field or element if one is named.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ConnectionEnd<'a> {
    pub(super) participant: &'a str,
    pub(super) port: &'a str,
    pub(super) field: Option<&'a str>,
}

impl ConnectionEnd<'_> {
    /// Splits `PARTICIPANT.PORT` or `PARTICIPANT.PORT.FIELD`.
    pub(super) fn of(text: &str) -> Option<ConnectionEnd<'_>> {
        let mut parts = text.splitn(3, '.');
        let end = ConnectionEnd {
            participant: parts.next()?,
            port: parts.next()?,
            field: parts.next(),
        };
        let empty = [Some(end.participant), Some(end.port), end.field].contains(&Some(""));
        (!empty).then_some(end)
    }

    pub(super) fn owned(&self) -> (String, String) {
        (self.participant.to_owned(), self.port.to_owned())
    }
}

/// `PARTICIPANT.PORT` of an end.
pub(crate) fn port_of(text: &str) -> &str {
    let dots = text.match_indices('.').nth(1);
    dots.map_or(text, |(at, _)| &text[..at])
}

pub(super) fn parse_port(text: &str) -> Option<(String, String)> {
    let (participant, port) = text.split_once('.')?;
    (!participant.is_empty() && !port.is_empty()).then(|| (participant.to_owned(), port.to_owned()))
}

pub(super) fn not_a_port(text: &str) -> String {
    format!("`{text}` is not a port: write \"PARTICIPANT.PORT\"")
}

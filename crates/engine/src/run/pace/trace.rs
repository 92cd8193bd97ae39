//! The trace: what every participant did when, as a file of JSON trace events, which Perfetto and Chrome's `about:tracing` open.
//!
//! A process of the trace is a participant, a thread of it a core. The file is bounded: after [`SPANS_MAX`] spans only the number of
//! missing ones is written. The memory is bounded too: spans are written as they come.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use lockstep::plan::Plan;
use lockstep::span::{Span, SpanActivity, now_ns};
use serde_json::{Value, json};
use tape::folder::record_outputs;

use super::traced::TraceSummary;
use crate::run::outcome::RunFailure;

/// The most spans of a file: about 200 MB.
const SPANS_MAX: u64 = 1_000_000;

/// A trace that is being written.
pub(crate) struct Trace {
    path: PathBuf,
    file: BufWriter<File>,
    begin_ns: u64,
    /// The bound on `written`.
    span_limit: u64,
    written: u64,
    /// Spans that are missing in the file: those after the bound, and those that were lost on their way for lack of room.
    missing: u64,
    /// The participants and cores that have been named in the file.
    named_rows: Vec<(usize, u32)>,
    /// The first error; nothing is written after it.
    error: Option<io::Error>,
}

impl Trace {
    /// Begins the file.
    ///
    /// # Errors
    /// When it cannot be made.
    pub(crate) fn create(path: &Path, title: &str) -> Result<Trace, RunFailure> {
        let refuse = |error: io::Error| RunFailure::Option {
            option: "--trace",
            value: path.display().to_string(),
            reason: format!("cannot be written: {error}; name a file in a folder that is there"),
        };
        let mut file = BufWriter::new(File::create(path).map_err(refuse)?);
        let about = json!({ "run": title, "time": "ns of wall time since the beginning of the run" });
        write!(
            file,
            "{{\"displayTimeUnit\":\"ns\",\"otherData\":{about},\"traceEvents\":["
        )
        .map_err(refuse)?;
        // In the run's own folder it belongs to the run, also if the program is killed.
        record_outputs(&[path.to_owned()], true)?;
        Ok(Trace {
            path: path.to_owned(),
            file,
            begin_ns: now_ns(),
            span_limit: SPANS_MAX,
            written: 0,
            missing: 0,
            named_rows: Vec::new(),
            error: None,
        })
    }

    /// Writes spans of participant number `number`, after which `lost` spans are missing.
    pub(crate) fn take(&mut self, number: usize, lost: u64, spans: &[Span], plan: &Plan) {
        for span in spans {
            if self.written >= self.span_limit {
                self.missing += 1;
            } else {
                self.written += 1;
                self.write_span(number, span, plan);
            }
        }
        if lost > 0 {
            self.missing += lost;
            if let Some(last) = spans.last().filter(|_| self.written < self.span_limit) {
                let name = format!("cut: {lost} spans are missing from here on");
                self.write_gap_mark(number, last.core, last.end_ns, &name, lost);
            }
        }
    }

    fn write_span(&mut self, number: usize, span: &Span, plan: &Plan) {
        let participant = &plan.participants[number];
        self.name_row(number, span.core, &participant.name);
        let (name, kind, what) = match span.activity {
            SpanActivity::Computing { done } => {
                (format!("step {}", span.activation), "step", json!({ "complete": done }))
            }
            SpanActivity::Sample { link, index } => {
                let link = plan.links_into(number).nth(link as usize).map(|link| &plan.links[link]);
                let name = link.map_or("", |link| participant.interface.inputs[link.to.1].name.as_str());
                let source = link.map(|link| plan.output_name(link.from));
                let what = json!({ "input": name, "output": source, "sample": index });
                (format!("waits for `{name}`"), "wait", what)
            }
            SpanActivity::Room { output, consumer } => {
                let name = participant.interface.outputs.get(output as usize);
                let name = name.map_or("", |output| output.name.as_str());
                let consumer = plan
                    .links
                    .iter()
                    .filter(|link| link.from == (number, output as usize))
                    .nth(consumer as usize);
                let reader = consumer.map(|link| plan.participants[link.to.0].name.as_str());
                (
                    format!("waits for room behind `{name}`"),
                    "wait",
                    json!({ "output": name, "reader": reader }),
                )
            }
            SpanActivity::Recorder => ("waits for the recorder".to_owned(), "wait", json!({})),
            SpanActivity::Horizon => ("waits for granted time".to_owned(), "wait", json!({})),
        };
        let mut args = json!({ "activation": span.activation, "core": span.core });
        if span.activation < participant.activations {
            let at = participant.sample_time.instant(span.activation);
            args["t_s"] = json!(plan.timebase.seconds(at));
        }
        if span.sleeps > 0 {
            args["sleeps"] = json!(span.sleeps);
        }
        if let (Value::Object(args), Value::Object(what)) = (&mut args, what) {
            args.extend(what);
        }
        let ns = |at: u64| at.saturating_sub(self.begin_ns) as f64 * 1e-3;
        let begin = ns(span.begin_ns);
        let event = json!({
            "ph": "X", "name": name, "cat": kind, "pid": number + 1, "tid": span.core + 1,
            "ts": begin, "dur": ns(span.end_ns.max(span.begin_ns)) - begin, "args": args,
        });
        self.write_event(&event);
    }

    /// Names a participant and its core in the file, once.
    fn name_row(&mut self, number: usize, core: u32, name: &str) {
        if self.named_rows.contains(&(number, core)) {
            return;
        }
        if self.named_rows.iter().all(|(known, _)| *known != number) {
            self.write_event(
                &json!({ "ph": "M", "name": "process_name", "pid": number + 1, "args": { "name": name } }),
            );
        }
        self.named_rows.push((number, core));
        let thread = json!({
            "ph": "M", "name": "thread_name", "pid": number + 1, "tid": core + 1, "args": { "name": format!("core {core}") },
        });
        self.write_event(&thread);
    }

    fn write_gap_mark(&mut self, number: usize, core: u32, at_ns: u64, name: &str, missing: u64) {
        let ts = at_ns.saturating_sub(self.begin_ns) as f64 * 1e-3;
        let event = json!({
            "ph": "i", "s": "p", "name": name, "cat": "cut", "pid": number + 1, "tid": core + 1, "ts": ts, "args": { "missing": missing },
        });
        self.write_event(&event);
    }

    fn write_event(&mut self, event: &Value) {
        if self.error.is_none() {
            let comma = if self.named_rows.is_empty() { "" } else { "," };
            self.error = write!(self.file, "{comma}\n{event}").err();
        }
    }

    /// Ends the file.
    pub(crate) fn finish(mut self) -> TraceSummary {
        if self.missing > 0 {
            let name = format!("cut: {} spans are missing in this trace", self.missing);
            let event = json!({
                "ph": "i", "s": "g", "name": name, "cat": "cut", "pid": 0, "tid": 0,
                "ts": now_ns().saturating_sub(self.begin_ns) as f64 * 1e-3, "args": { "missing": self.missing },
            });
            self.write_event(&event);
        }
        let ended = self
            .error
            .take()
            .map_or_else(|| self.file.write_all(b"\n]}\n").and_then(|()| self.file.flush()), Err);
        // Where this fails, the note of its beginning remains.
        let _ = record_outputs(std::slice::from_ref(&self.path), false);
        TraceSummary {
            path: self.path,
            spans: self.written,
            missing: self.missing,
            error: ended.err().map(|error| error.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lockstep::participant::{Interface, Kind};
    use lockstep::plan::ParticipantSpec;
    use lockstep::time::Rational;

    #[test]
    fn trace_is_bounded_and_reports_missing_spans() {
        let spec = ParticipantSpec {
            name: "a".into(),
            period: Rational::from_millis(1),
            offset: Rational::ZERO,
            interface: Interface::new(Kind::Sampled),
        };
        let plan = Plan::build(vec![spec], &[], Rational::from_millis(100), 1).expect("a plan");
        let path = std::env::temp_dir().join(format!("escapement-trace-{}.json", std::process::id()));
        let mut trace = Trace::create(&path, "\"quoted\"").expect("it can be written");
        trace.span_limit = 10;
        let span = |activation| Span {
            activation,
            activity: SpanActivity::Computing { done: true },
            core: 1,
            sleeps: 0,
            begin_ns: 0,
            end_ns: 1,
        };
        trace.take(0, 3, &[span(0), span(1)], &plan);
        trace.take(0, 0, &(2..15).map(span).collect::<Vec<_>>(), &plan);
        let traced = trace.finish();
        assert_eq!((traced.spans, traced.missing, traced.error), (10, 3 + 5, None));
        let text = std::fs::read_to_string(&path).expect("it is there");
        std::fs::remove_file(&path).expect("it is there");
        let all: Value = serde_json::from_str(&text).expect("it is JSON");
        let events = all["traceEvents"].as_array().expect("a list");
        let of = |kind: &str| events.iter().filter(|event| event["ph"] == kind).collect::<Vec<_>>();
        assert_eq!((of("M").len(), of("X").len(), of("i").len()), (2, 10, 2));
        assert_eq!(
            (&of("i")[0]["args"]["missing"], &of("i")[1]["args"]["missing"]),
            (&json!(3), &json!(8))
        );
    }
}

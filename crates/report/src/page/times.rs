//! Breakdown of the participants' wall-clock time in a run.

use serde::Serialize;
use serde_json::Value;

/// The wall-clock time of a participant by activity; the parts add up to the wall-clock time of the run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct ParticipantTime {
    pub(crate) name: String,
    pub(crate) computing_s: f64,
    /// Seconds waited, with the reason.
    pub(crate) waiting: Vec<(String, f64)>,
    /// Before the first step, and after the last one.
    pub(crate) outside_s: f64,
}

/// `timing` of a summary has for each participant `total_ns`, from its first to its last step without pauses, and its
/// parts: waiting for inputs (one number per input, or by name), for room and for the recorder; the rest is computing.
/// `horizon_ns`, waiting for the clock, is not part of it, nor is the time before the run began.
pub(crate) fn participants(summary: &Value) -> Vec<ParticipantTime> {
    let seconds = |value: &Value| value.as_f64().map(|ns| ns * 1e-9);
    let wall = summary["wall_time_s"].as_f64();
    let entries = summary.get("timing").and_then(Value::as_object).into_iter().flatten();
    let times = entries.filter_map(|(name, entry)| {
        let mut waiting: Vec<(String, f64)> = match &entry["inputs_ns"] {
            Value::Array(inputs) => {
                let numbered = inputs.iter().enumerate();
                numbered
                    .filter_map(|(i, s)| Some((format!("input {}", i + 1), seconds(s)?)))
                    .collect()
            }
            Value::Object(inputs) => inputs
                .iter()
                .filter_map(|(on, s)| Some((on.clone(), seconds(s)?)))
                .collect(),
            _ => Vec::new(),
        };
        for (key, on) in [("room_ns", "room at a reader"), ("recorder_ns", "the recorder")] {
            waiting.extend(seconds(&entry[key]).map(|s| (on.to_owned(), s)));
        }
        let (total, clock) = (
            seconds(&entry["total_ns"])?,
            seconds(&entry["horizon_ns"]).unwrap_or(0.0),
        );
        let waited: f64 = waiting.iter().map(|(_, s)| s).sum();
        let rest = wall.map_or(clock, |wall| (wall - total).max(0.0));
        waiting.push(("the clock".to_owned(), clock.min(rest)));
        Some(ParticipantTime {
            name: name.clone(),
            computing_s: (total - waited).max(0.0),
            outside_s: rest - clock.min(rest),
            waiting,
        })
    });
    times.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn text_of(time: &ParticipantTime) -> String {
        let waiting: Vec<String> = time.waiting.iter().map(|(on, s)| format!("{on} {s:.2}")).collect();
        format!(
            "{:.2}, {}, outside {:.2}",
            time.computing_s,
            waiting.join(", "),
            time.outside_s
        )
    }

    #[test]
    fn time_parts_add_up_to_wall_time() {
        let summary = json!({ "wall_time_s": 9.0, "timing": {
            "paced": { "total_ns": 2_000_000_000_u64, "inputs_ns": { "b.out": 250_000_000 }, "room_ns": 0, "recorder_ns": 0, "horizon_ns": 6_500_000_000_u64 },
            "quick": { "total_ns": 5_000_000_000_u64, "inputs_ns": [1_000_000_000, 500_000_000], "room_ns": 250_000_000, "recorder_ns": 0, "horizon_ns": 7_000_000_000_u64 },
        }});
        let times = participants(&summary);
        assert_eq!(
            text_of(&times[0]),
            "1.75, b.out 0.25, room at a reader 0.00, the recorder 0.00, the clock 6.50, outside 0.50"
        );
        assert_eq!(
            text_of(&times[1]),
            "3.25, input 1 1.00, input 2 0.50, room at a reader 0.25, the recorder 0.00, the clock 4.00, outside 0.00"
        );
        for time in &times {
            let waited: f64 = time.waiting.iter().map(|(_, s)| s).sum();
            assert!((time.computing_s + waited + time.outside_s - 9.0).abs() < 1e-9);
        }
        assert!(participants(&json!({ "timing": { "x": {} } })).is_empty());
    }
}

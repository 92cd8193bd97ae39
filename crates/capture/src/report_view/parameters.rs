//! Parameters of participants, from a plan.

use toml::{Table, Value};

/// The parameters of all participants in a plan.
pub(super) fn parameters(plan: &Table) -> impl Iterator<Item = &Table> {
    let participants = plan.get("participants").and_then(Value::as_table);
    let entries = participants.into_iter().flatten();
    entries.filter_map(|(_, entry)| entry.as_table()?.get("parameters")?.as_table())
}

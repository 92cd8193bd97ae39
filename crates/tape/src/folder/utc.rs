//! Dates in UTC, as they appear in the names of folders and in files.

use std::time::{SystemTime, UNIX_EPOCH};

/// Year, month, day, hour, minute, second of an instant in UTC.
fn civil(time: SystemTime) -> (i64, i64, i64, i64, i64, i64) {
    let seconds = match time.duration_since(UNIX_EPOCH) {
        Ok(after) => after.as_secs() as i64,
        Err(before) => -(before.duration().as_secs() as i64) - i64::from(before.duration().subsec_nanos() > 0),
    };
    let (days, of_day) = (seconds.div_euclid(86_400), seconds.rem_euclid(86_400));
    // Years run from March to February here, so that the leap day is the last day of its year; 400 of them have 146,097 days.
    let from_march = days + 719_468;
    let (era, of_era) = (from_march.div_euclid(146_097), from_march.rem_euclid(146_097));
    let year_of_era = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * of_year + 2) / 153;
    let day = of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = (month_from_march + 2) % 12 + 1;
    let year = era * 400 + year_of_era + i64::from(month <= 2);
    (year, month, day, of_day / 3600, of_day / 60 % 60, of_day % 60)
}

/// An instant for the names of folders: `20261122T014819Z`.
pub fn utc_compact(time: SystemTime) -> String {
    let (year, month, day, hour, minute, second) = civil(time);
    format!("{year:04}{month:02}{day:02}T{hour:02}{minute:02}{second:02}Z")
}

/// An instant for users and files (RFC 3339, whole seconds): `2026-11-22T01:48:19Z`.
pub fn utc_text(time: SystemTime) -> String {
    let (year, month, day, hour, minute, second) = civil(time);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn check(seconds: i64, text: &str) {
        let time = if seconds < 0 {
            UNIX_EPOCH - Duration::from_secs(seconds.unsigned_abs())
        } else {
            UNIX_EPOCH + Duration::from_secs(seconds as u64)
        };
        assert_eq!(utc_text(time), text);
    }

    #[test]
    fn utc_text_matches_calendar() {
        check(0, "1970-01-01T00:00:00Z");
        check(-1, "1969-12-31T23:59:59Z");
        check(951_782_400, "2000-02-29T00:00:00Z");
        check(1_795_312_099, "2026-11-22T01:48:19Z");
        check(4_107_542_400, "2100-03-01T00:00:00Z");
        assert_eq!(utc_compact(UNIX_EPOCH), "19700101T000000Z");
    }
}

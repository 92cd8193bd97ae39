//! Invalid words in a ring of entries are rejected. In a separate file, because the tests of memory ordering include the entries file.

use super::entries::{EVENT_STREAM, committed, unpack};
use super::words::{LINE, Word};
use crate::transport::interface::TransportError;

/// The number of entries and of their words, or what is wrong.
fn count_entries(words: &[u64]) -> Result<(usize, usize), TransportError> {
    let mut count = 0;
    let used = unpack(words, |_| {
        count += 1;
        Ok::<(), TransportError>(())
    })?;
    Ok((count, used))
}

fn shared(words: &[u64]) -> Vec<Word> {
    words.iter().map(|&word| Word::new(word)).collect()
}

#[test]
fn invalid_record_is_rejected_with_reason() {
    let sample = [3, 9, 5, 50, 1, 2];
    assert_eq!(count_entries(&[sample, sample].concat()), Ok((2, 12)));
    for torn in [
        &[3, 17, 5, 50, 1, 2][..],
        &[3, u64::MAX, 5, 50, 1, 2],
        &[3, 1 << 63, 5, 50],
        &[3, 9, 5],
    ] {
        assert_eq!(count_entries(torn), Ok((0, 0)), "{torn:?}");
        assert_eq!(count_entries(&[&sample[..], torn].concat()), Ok((1, 6)), "{torn:?}");
    }
    for bad in [
        &[1 << 40, 0, 5, 50][..],               // a stream number out of range
        &[EVENT_STREAM, 8, 0, 0, 77],           // an unknown event
        &[EVENT_STREAM, 16, 0, 0, 0, u64::MAX], // an unbounded count
    ] {
        assert!(count_entries(bad).is_err(), "{bad:?}");
    }
    for (words, taken) in [
        (&[][..], 0),
        (&[8; LINE], 0),
        (&[5; 20], 6),
        (&[13; 20], 0),
        (&[u64::MAX; 20], 3),
    ] {
        assert!(committed(&shared(words), taken).is_err(), "{words:?} {taken}");
    }
    assert_eq!(committed(&shared(&[13; 20]), 4), Ok((12, 9)));
}

#[test]
fn record_decoder_never_panics_on_random_words() {
    let draws = crate::random::Stream::new(1, "records");
    for round in 0..20_000 {
        let word = |at: u64| draws.bits(64 * round + at);
        let words: Vec<u64> = (0..word(0) % 40)
            .map(|at| word(1 + at) >> (word(1 + at) % 64))
            .collect();
        let _ = count_entries(&words);
        let _ = committed(&shared(&words), 1);
    }
}

//! A ring of entries: what a participant sends to the tape, in words that the recorder holds.
//!
//! Appending a sample is a copy into shared memory, and one store commits the samples of an activation. From then on the recorder finds
//! them, whatever happens to the participant. The first word of the memory is the total number of words of entries ever committed; the
//! ring begins on the next cache line. The recorder also counts in words.
//!
//! An entry is a header of four 64-bit words (stream or [`EVENT_STREAM`], bytes, index, stamp), then the payload, padded to a multiple of
//! 8. At the end of the ring, an entry continues at the ring's beginning.

use std::ops::RangeInclusive;

use super::board::{Get, Set};
use super::room::Room;
use super::words::{LINE, Word, copy_in};
use crate::control::ParticipantEvent;
use crate::transport::interface::{Header, TransportError};
use crate::wire;

/// In the entry of an event, the number in place of the stream's.
pub(super) const EVENT_STREAM: u64 = u64::MAX;
/// Words of an entry's header.
const HEADER_WORDS: usize = 4;
/// The size of a ring where there is enough memory, words: enough for participants that exchange samples every microsecond while the
/// recorder sleeps, and small enough to stay in a core's own cache.
const RING_WORDS_MAX: usize = 1 << 17;
/// The minimum size of a ring, words: a longest event and those that may come with it.
const RING_WORDS_MIN: usize = 1 << 11;
/// The number of activations for which every ring has room.
const ACTIVATIONS_MIN: usize = 4;
/// Words that are taken at a time, if they contain a whole entry.
const BATCH_WORDS: usize = 1 << 12;
/// The longest failure reason of a participant, bytes: an event fits into a ring.
const REASON_BYTES_MAX: usize = 6 * 1024;

/// The words of an entry with a payload of `size` bytes.
fn entry_words(size: usize) -> usize {
    HEADER_WORDS + size.div_ceil(8)
}

/// The words of the entries of one activation with payloads of these sizes.
fn activation_words(sizes: &[usize]) -> usize {
    sizes.iter().map(|&size| entry_words(size)).sum()
}

/// The size of a record's ring, bytes, for a participant that appends payloads of `sizes` bytes in each of its `activations`: from the
/// minimum that it needs to the optimum. More than it ever records is never useful.
pub fn record_ring_bytes(sizes: &[usize], activations: u64) -> RangeInclusive<u64> {
    let activation = activation_words(sizes);
    let least = RING_WORDS_MIN.max(ACTIVATIONS_MIN * activation).next_multiple_of(LINE);
    // A continuous participant has one sample more than activations.
    let all = (activations.saturating_add(1)).saturating_mul(activation as u64);
    let all = usize::try_from(all.saturating_add(RING_WORDS_MIN as u64)).unwrap_or(usize::MAX);
    let best = all.min(RING_WORDS_MAX).next_multiple_of(LINE).max(least);
    8 * least as u64..=8 * best as u64
}

/// The words of the ring of a participant whose activations append payloads of `sizes` bytes and which may have `room` bytes: that, or
/// the size of four activations if that is more.
pub(crate) fn ring_words(sizes: &[usize], room: u32) -> usize {
    (room as usize / 8)
        .max(RING_WORDS_MIN)
        .max(ACTIVATIONS_MIN * activation_words(sizes))
        .next_multiple_of(LINE)
}

/// The sender's state of a ring.
pub(crate) struct EntrySender {
    /// Words of the ring.
    size: usize,
    /// The position in the ring of the next entry.
    at: usize,
    /// Total words written.
    written: u64,
    room: Room,
    /// The first stream of an activation, and the words of the entries of one activation.
    first: u32,
    activation: usize,
}

impl EntrySender {
    /// For a ring of `size` words, and activations that append payloads of `sizes` bytes, starting with that of stream `first`.
    pub(crate) fn new(size: usize, first: u32, sizes: &[usize]) -> EntrySender {
        EntrySender {
            size,
            at: 0,
            written: 0,
            room: Room::default(),
            first,
            activation: activation_words(sizes),
        }
    }

    /// Whether there is room for `words` more.
    fn has_room(&mut self, words: usize, count: &impl Get<u64>) -> Result<bool, TransportError> {
        self.room.fits(self.size as u64, self.written, words as u64, count)
    }

    /// Writes an entry for which there is room.
    fn append(&mut self, words: &[Word], head: [u64; HEADER_WORDS], payload: &[u8]) {
        let ring = &words[LINE..];
        for bytes in [bytemuck::cast_slice(&head), payload] {
            let (before, after) = bytes.split_at(bytes.len().min(8 * (self.size - self.at)));
            copy_in(&ring[self.at..], before);
            copy_in(ring, after);
            self.at += bytes.len().div_ceil(8);
            if self.at >= self.size {
                self.at -= self.size;
            }
        }
        self.written += entry_words(payload.len()) as u64;
    }

    /// Writes a sample to `words`, of which the recorder has taken as many as `count` says; `false` when there is no room.
    #[inline]
    pub(crate) fn try_append_sample(
        &mut self,
        words: &[Word],
        count: &impl Get<u64>,
        stream: u32,
        header: Header,
        payload: &[u8],
    ) -> Result<bool, TransportError> {
        // The samples of one activation are committed together, so that a participant that dies leaves whole activations.
        let need = if stream == self.first {
            self.activation
        } else {
            entry_words(payload.len())
        };
        if !self.has_room(need, count)? {
            return Ok(false);
        }
        let head = [
            u64::from(stream),
            payload.len() as u64,
            header.index,
            header.stamp as u64,
        ];
        self.append(words, head, payload);
        Ok(true)
    }

    /// Makes everything appended so far available to the recorder.
    #[inline]
    pub(crate) fn commit(&self, words: &[Word]) {
        words[0].store_release(self.written);
    }

    /// Appends an event after the samples so far. `false` when there is no room now.
    pub(crate) fn try_append_event(
        &mut self,
        words: &[Word],
        count: &impl Get<u64>,
        event: &ParticipantEvent,
    ) -> Result<bool, TransportError> {
        let mut event = event.clone();
        if let ParticipantEvent::Failed { reason, .. } = &mut event {
            let end = (0..=REASON_BYTES_MAX.min(reason.len()))
                .rev()
                .find(|&end| reason.is_char_boundary(end));
            reason.truncate(end.unwrap_or(0));
        }
        let bytes = wire::encode("a participant event", &event).map_err(|error| TransportError(error.to_string()))?;
        if !self.has_room(entry_words(bytes.len()), count)? {
            return Ok(false);
        }
        self.append(words, [EVENT_STREAM, bytes.len() as u64, 0, 0], &bytes);
        self.commit(words);
        Ok(true)
    }
}

/// An entry read from a record.
#[derive(Debug, Clone, PartialEq)]
pub enum Recorded<'a> {
    /// A sample of stream number `stream`.
    Sample {
        /// The stream.
        stream: u32,
        /// Index and stamp.
        header: Header,
        /// The payload.
        payload: &'a [u8],
    },
    /// A participant event.
    Event(ParticipantEvent),
}

/// The receiver's state of a ring.
pub(crate) struct EntryReceiver {
    /// Total words taken.
    taken: u64,
    /// A copy of the entries, so that what is checked is what is used, whatever the sender does to its memory.
    copy: Vec<u64>,
}

impl EntryReceiver {
    pub(crate) fn new() -> EntryReceiver {
        EntryReceiver {
            taken: 0,
            copy: Vec::with_capacity(BATCH_WORDS),
        }
    }

    /// Passes the entries that have arrived in `words` to `take`, at most one batch, and counts them; `false` when there is none.
    pub(crate) fn receive<E: From<TransportError>>(
        &mut self,
        words: &[Word],
        count: &impl Set<u64>,
        mut take: impl FnMut(Recorded<'_>) -> Result<(), E>,
    ) -> Result<bool, E> {
        let (size, new) = committed(words, self.taken)?;
        if new == 0 {
            return Ok(false);
        }
        let ring = &words[LINE..];
        let at = (self.taken % size as u64) as usize;
        let mut batch = BATCH_WORDS.min(new);
        let used = loop {
            self.copy.clear();
            let before = batch.min(size - at);
            self.copy.extend(ring[at..at + before].iter().map(|word| word.get()));
            self.copy.extend(ring[..batch - before].iter().map(|word| word.get()));
            let used = unpack(&self.copy, &mut take)?;
            if used == new || (0 < used && batch < new) {
                break used;
            }
            // An entry that is longer than a batch is taken alone.
            let longer = (self.copy.get(1))
                .and_then(|&bytes| usize::try_from(bytes).ok())
                .map(entry_words);
            batch = match longer {
                Some(words) if batch < words && words <= new => words,
                _ => {
                    return Err(
                        TransportError("recorded an entry that extends beyond what it committed".to_owned()).into(),
                    );
                }
            };
        };
        self.taken += used as u64;
        count.set(self.taken);
        Ok(true)
    }
}

/// The size of the ring in a record's memory, and the number of words in it that are committed and not taken.
pub(super) fn committed(words: &[Word], taken: u64) -> Result<(usize, usize), TransportError> {
    let violation = |what: String| Err(TransportError(format!("keeps a record {what}")));
    if words.len() <= LINE {
        return violation(format!("of {} words", words.len()));
    }
    let (size, fill) = (words.len() - LINE, words[0].load_acquire());
    match fill.checked_sub(taken) {
        None => violation(format!("that shrank from {taken} words to {fill}")),
        Some(new) if new > size as u64 => violation(format!("of {size} words with {new} committed at once")),
        Some(new) => Ok((size, new as usize)),
    }
}

/// Passes the whole entries at the beginning of `words` to `take`, and returns their size in words.
///
/// # Errors
/// What is wrong with them, or the error of `take`.
pub fn unpack<E: From<TransportError>>(
    words: &[u64],
    mut take: impl FnMut(Recorded<'_>) -> Result<(), E>,
) -> Result<usize, E> {
    let mut rest = words;
    while let Some((entry, after)) = split_entry(rest)? {
        take(entry)?;
        rest = after;
    }
    Ok(words.len() - rest.len())
}

/// The first entry and the words after it; `None` when it is incomplete.
fn split_entry(words: &[u64]) -> Result<Option<(Recorded<'_>, &[u64])>, TransportError> {
    let Some((&[stream, size, index, stamp], rest)) = words.split_first_chunk::<HEADER_WORDS>() else {
        return Ok(None);
    };
    let bytes: &[u8] = bytemuck::cast_slice(rest);
    let Some(payload) = usize::try_from(size).ok().and_then(|size| bytes.get(..size)) else {
        return Ok(None);
    };
    let rest = &rest[payload.len().div_ceil(8)..];
    let entry = if stream == EVENT_STREAM {
        Recorded::Event(
            wire::decode("a participant event", payload)
                .map_err(|error| TransportError(format!("recorded a participant event that is none: {error}")))?,
        )
    } else {
        let stream =
            u32::try_from(stream).map_err(|_| TransportError(format!("recorded a sample of stream {stream}")))?;
        let header = Header {
            index,
            stamp: stamp as i64,
        };
        Recorded::Sample {
            stream,
            header,
            payload,
        }
    };
    Ok(Some((entry, rest)))
}

//! Everything a participant has for the tape, in a ring of words that the recorder holds.
//!
//! Appending a sample is a copy into shared memory, and one store commits those of an activation. From then on the recorder finds them,
//! whatever becomes of the participant. The first word of the memory says how many words of entries were ever committed; the ring
//! begins on the next cache line. What the recorder counts are words too.
//!
//! An entry is a header of four 64-bit words (stream or [`NOTE`], bytes, index, stamp), then the payload, filled up to a
//! multiple of 8. Where the ring ends, it goes on at the ring's beginning.

use std::cell::RefCell;
use std::ops::RangeInclusive;
use std::rc::Rc;

use super::domain::{Domain, DomainError};
use super::ring::{RingReader, RingService, RingWriter};
use super::words::{LINE, Word, put};
use crate::control::Note;
use crate::transport::{Broken, Header, Recording};
use crate::wire;

/// Stands where the stream's number does, for a note.
const NOTE: u64 = u64::MAX;
/// Words of an entry's header.
const HEAD: usize = 4;
/// The room of a ring where there is enough memory, words: enough for participants that exchange samples every microsecond while the
/// recorder naps, and little enough to stay in a core's own cache.
const ROOM: usize = 1 << 17;
/// The least room of a ring, words: a longest note and those that may come with it.
const ROOM_MIN: usize = 1 << 11;
/// Activations for which there is room in any ring.
const ACTIVATIONS: usize = 4;
/// Words that are taken at a time, if there is a whole entry in them.
const BATCH: usize = 1 << 12;
/// The longest reason that a failing participant may give, bytes: a note fits into a ring.
const REASON: usize = 6 * 1024;

fn name(participant: &str) -> String {
    format!("record/{participant}")
}

/// The words of an entry with a payload of `size` bytes.
fn words_of(size: usize) -> usize {
    HEAD + size.div_ceil(8)
}

/// The words of the entries of one activation with payloads of these sizes.
fn activation_words(sizes: &[usize]) -> usize {
    sizes.iter().map(|&size| words_of(size)).sum()
}

/// How large a record's ring may be, bytes, for a participant that appends payloads of `sizes` bytes in each of its `activations`: from
/// what its work takes to what serves it best. More than it ever records is of no use.
pub fn record_room(sizes: &[usize], activations: u64) -> RangeInclusive<u64> {
    let activation = activation_words(sizes);
    let least = ROOM_MIN.max(ACTIVATIONS * activation).next_multiple_of(LINE);
    // A continuous participant has one sample more than activations.
    let all = (activations.saturating_add(1)).saturating_mul(activation as u64);
    let all = usize::try_from(all.saturating_add(ROOM_MIN as u64)).unwrap_or(usize::MAX);
    let best = all.min(ROOM).next_multiple_of(LINE).max(least);
    8 * least as u64..=8 * best as u64
}

/// The participant's end.
pub struct RecordSender {
    ring: RingWriter,
    /// Words of the ring.
    size: usize,
    /// Where in the ring the next entry begins.
    at: usize,
    /// Words that were ever written.
    written: u64,
    /// The stream that an activation begins with, and the words of the entries of one activation.
    first: u32,
    activation: usize,
    _service: RingService,
}

impl RecordSender {
    /// Opens the way to the recorder for a participant whose activations append payloads of `sizes` bytes, that of stream
    /// `first` at first, with a ring of `room` bytes, or of what four activations take if that is more.
    pub fn open(
        domain: &Domain,
        participant: &str,
        first: u32,
        sizes: &[usize],
        room: u32,
    ) -> Result<RecordSender, DomainError> {
        let service = RingService::open(domain, &name(participant))?;
        let activation = activation_words(sizes);
        let size = (room as usize / 8)
            .max(ROOM_MIN)
            .max(ACTIVATIONS * activation)
            .next_multiple_of(LINE);
        let lines = 1 + size / LINE;
        let mut ring = service.writer(domain, lines, lines)?;
        // The recorder is there. Its memory is touched now, which takes time, rather than in the run.
        let what = || format!("handing over the record of `{participant}`");
        match ring.words() {
            Ok(Some(_)) => {}
            Ok(None) => return Err(domain.failed(what(), "nobody took it")),
            Err(error) => return Err(domain.failed(what(), error)),
        }
        Ok(RecordSender {
            ring,
            size,
            at: 0,
            written: 0,
            first,
            activation,
            _service: service,
        })
    }

    /// Whether there is room for `words` more.
    fn has_room(&mut self, words: usize) -> Result<bool, Broken> {
        self.ring.has_room(self.size as u64, self.written, words as u64)
    }

    /// Writes an entry for which there is room. `false` when nobody is there to read it.
    fn append(&mut self, head: [u64; HEAD], payload: &[u8]) -> Result<bool, Broken> {
        let Some(words) = self.ring.words()? else {
            return Ok(false);
        };
        let ring = &words[LINE..];
        for bytes in [bytemuck::cast_slice(&head), payload] {
            let (before, after) = bytes.split_at(bytes.len().min(8 * (self.size - self.at)));
            put(&ring[self.at..], before);
            put(ring, after);
            self.at += bytes.len().div_ceil(8);
            if self.at >= self.size {
                self.at -= self.size;
            }
        }
        self.written += words_of(payload.len()) as u64;
        Ok(true)
    }

    fn sample(&mut self, stream: u32, header: Header, payload: &[u8]) -> Result<bool, Broken> {
        // The samples of one activation are committed together, so that whoever dies leaves whole activations.
        let words = if stream == self.first {
            self.activation
        } else {
            words_of(payload.len())
        };
        let head = [
            u64::from(stream),
            payload.len() as u64,
            header.index,
            header.stamp as u64,
        ];
        Ok(self.has_room(words)? && self.append(head, payload)?)
    }

    /// Everything so far is there for the recorder.
    fn commit(&mut self) {
        if let Ok(Some(words)) = self.ring.words() {
            words[0].announce(self.written);
        }
    }

    /// Puts a note behind the samples so far. `false` when there is no room now.
    pub fn note(&mut self, note: &Note) -> Result<bool, Broken> {
        let mut note = note.clone();
        if let Note::Failed { reason, .. } = &mut note {
            let end = (0..=REASON.min(reason.len()))
                .rev()
                .find(|&end| reason.is_char_boundary(end));
            reason.truncate(end.unwrap_or(0));
        }
        let bytes = wire::encode("a note", &note).map_err(|error| Broken(error.to_string()))?;
        let head = [NOTE, bytes.len() as u64, 0, 0];
        let noted = self.has_room(words_of(bytes.len()))? && self.append(head, &bytes)?;
        if noted {
            self.commit();
        }
        Ok(noted)
    }
}

/// A [`RecordSender`] that the stepper and the host share: samples from the one, notes from the other.
#[derive(Clone)]
pub struct SharedRecord(pub Rc<RefCell<RecordSender>>);

impl Recording for SharedRecord {
    fn try_append(&mut self, stream: u32, header: Header, payload: &[u8]) -> Result<bool, Broken> {
        self.0.borrow_mut().sample(stream, header, payload)
    }

    fn commit(&mut self) {
        self.0.borrow_mut().commit();
    }
}

/// What came out of a record.
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
    /// A note.
    Note(Note),
}

/// The recorder's end.
pub struct RecordReceiver {
    ring: RingReader,
    /// Words that were ever taken.
    taken: u64,
    /// What is looked at: a copy, so that what is checked is what is used, whatever the sender does to its memory.
    copy: Vec<u64>,
    service: RingService,
}

impl RecordReceiver {
    /// Creates the way from `participant` to the recorder.
    pub fn create(domain: &Domain, participant: &str) -> Result<RecordReceiver, DomainError> {
        // One writer; who opens another one is told so, which needs a place for it.
        let service = RingService::create(domain, &name(participant), 2)?;
        Ok(RecordReceiver {
            ring: service.reader(domain)?,
            taken: 0,
            copy: Vec::with_capacity(BATCH),
            service,
        })
    }

    /// The processes that write records here, as they say themselves: that of the participant, if all is well.
    pub fn writers(&self) -> Vec<u32> {
        self.service.writers()
    }

    /// Takes the memory of the record; `false` while it has not come. To be called when the participant has sent it: it is lost with
    /// a participant that leaves before it was taken.
    pub fn take_memory(&mut self) -> Result<bool, Broken> {
        Ok(self.ring.words()?.is_some())
    }

    /// Hands the entries that have come to `take`, a batch of them at most; `false` when there is none. They come from
    /// another process: whatever they hold, this ends, and says what is wrong with it.
    pub fn receive<E: From<Broken>>(&mut self, mut take: impl FnMut(Recorded<'_>) -> Result<(), E>) -> Result<bool, E> {
        let Some(words) = self.ring.words()? else {
            return Ok(false);
        };
        let (size, new) = committed(words, self.taken)?;
        if new == 0 {
            return self.look_for_another().map(|()| false).map_err(E::from);
        }
        let ring = &words[LINE..];
        let at = (self.taken % size as u64) as usize;
        let mut used = 0;
        for count in [BATCH.min(new), new] {
            self.copy.clear();
            let before = count.min(size - at);
            self.copy.extend(ring[at..at + before].iter().map(|word| word.get()));
            self.copy.extend(ring[..count - before].iter().map(|word| word.get()));
            used = unpack(&self.copy, &mut take)?;
            if used == new || (0 < used && count < new) {
                break;
            }
            if count == new {
                return Err(Broken("recorded an entry that goes on behind what it committed".to_owned()).into());
            }
        }
        self.taken += used as u64;
        self.ring.took(self.taken);
        Ok(true)
    }

    /// Who opens a second way to the recorder would be heard no more on the first or on the second, so that is told.
    fn look_for_another(&self) -> Result<(), Broken> {
        if self.ring.is_offered_more()? {
            return Err(Broken(
                "opened a second way to the recorder: open one publisher of the record, and send one sample".into(),
            ));
        }
        Ok(())
    }
}

/// The size of the ring in a record's memory and the words in it that are committed and not taken.
fn committed(words: &[Word], taken: u64) -> Result<(usize, usize), Broken> {
    let odd = |what: String| Err(Broken(format!("keeps a record {what}")));
    if words.len() <= LINE {
        return odd(format!("of {} words", words.len()));
    }
    let (size, fill) = (words.len() - LINE, words[0].heard());
    match fill.checked_sub(taken) {
        None => odd(format!("that shrank from {taken} words to {fill}")),
        Some(new) if new > size as u64 => odd(format!("of {size} words with {new} committed at once")),
        Some(new) => Ok((size, new as usize)),
    }
}

/// Hands the whole entries at the beginning of `words` to `take`, and says how many words they are.
///
/// # Errors
/// What is wrong with them, or what `take` says.
pub fn unpack<E: From<Broken>>(words: &[u64], mut take: impl FnMut(Recorded<'_>) -> Result<(), E>) -> Result<usize, E> {
    let mut rest = words;
    while let Some((entry, after)) = split_entry(rest)? {
        take(entry)?;
        rest = after;
    }
    Ok(words.len() - rest.len())
}

/// The first entry and what follows it; `None` when it is not all there.
fn split_entry(words: &[u64]) -> Result<Option<(Recorded<'_>, &[u64])>, Broken> {
    let Some((&[stream, size, index, stamp], rest)) = words.split_first_chunk::<HEAD>() else {
        return Ok(None);
    };
    let bytes: &[u8] = bytemuck::cast_slice(rest);
    let Some(payload) = usize::try_from(size).ok().and_then(|size| bytes.get(..size)) else {
        return Ok(None);
    };
    let rest = &rest[payload.len().div_ceil(8)..];
    let entry = if stream == NOTE {
        Recorded::Note(
            wire::decode("a note", payload)
                .map_err(|error| Broken(format!("recorded a note that is none: {error}")))?,
        )
    } else {
        let stream = u32::try_from(stream).map_err(|_| Broken(format!("recorded a sample of stream {stream}")))?;
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

#[cfg(test)]
mod tests {
    use super::super::place::Place;
    use super::*;
    use std::sync::atomic::{AtomicBool, Ordering};

    /// How many entries there are and how many words they have, or what is wrong.
    fn read(words: &[u64]) -> Result<(usize, usize), Broken> {
        let mut count = 0;
        let used = unpack(words, |_| {
            count += 1;
            Ok::<(), Broken>(())
        })?;
        Ok((count, used))
    }

    fn shared(words: &[u64]) -> Vec<Word> {
        words.iter().map(|&word| Word::new(word)).collect()
    }

    #[test]
    fn whatever_a_record_holds_it_ends_with_a_reason() {
        let sample = [3, 9, 5, 50, 1, 2];
        assert_eq!(read(&[sample, sample].concat()), Ok((2, 12)));
        for torn in [
            &[3, 17, 5, 50, 1, 2][..],
            &[3, u64::MAX, 5, 50, 1, 2],
            &[3, 1 << 63, 5, 50],
            &[3, 9, 5],
        ] {
            assert_eq!(read(torn), Ok((0, 0)), "{torn:?}");
            assert_eq!(read(&[&sample[..], torn].concat()), Ok((1, 6)), "{torn:?}");
        }
        for bad in [
            &[1 << 40, 0, 5, 50][..],       // a stream that nobody can have
            &[NOTE, 8, 0, 0, 77],           // no such note
            &[NOTE, 16, 0, 0, 0, u64::MAX], // a count without end
        ] {
            assert!(read(bad).is_err(), "{bad:?}");
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
    fn random_words_never_panic() {
        let draws = crate::random::Stream::new(1, "records");
        for round in 0..20_000 {
            let word = |at: u64| draws.bits(64 * round + at);
            let words: Vec<u64> = (0..word(0) % 40)
                .map(|at| word(1 + at) >> (word(1 + at) % 64))
                .collect();
            let _ = read(&words);
            let _ = committed(&shared(&words), 1);
        }
    }

    #[test]
    fn taken_record_is_stable_while_its_writer_scribbles() {
        let draws = crate::random::Stream::new(2, "scribbles");
        for round in 0..20 {
            let place = Place::new();
            let mut receiver = RecordReceiver::create(&place.domain, "a").expect("a new domain has room");
            let mut sender = RecordSender::open(&place.domain, "a", 0, &[64], 1 << 20).expect("the only writer");
            assert_eq!(receiver.writers(), [std::process::id()]);
            let mut index = 0;
            while index < 2000 && sender.sample(0, Header { index, stamp: 0 }, &[7; 64]) == Ok(true) {
                index += 1;
            }
            sender.commit();
            let words = sender.ring.words().expect("handed over").expect("taken");
            let done = AtomicBool::new(false);
            std::thread::scope(|scope| {
                scope.spawn(|| {
                    for at in (0..).take_while(|_| !done.load(Ordering::Relaxed)) {
                        let draw = |which: u64| draws.bits((1 << 32) | (round << 20) | ((3 * at + which) % (1 << 20)));
                        // Anywhere near, the count of what is committed too.
                        words[draw(0) as usize % 512].set(draw(1) >> (draw(2) % 64));
                    }
                });
                for _ in 0..100 {
                    let received = receiver.receive(|entry| {
                        if let Recorded::Sample { header, payload, .. } = entry {
                            let before = (header, payload.to_vec());
                            std::thread::yield_now();
                            assert_eq!(before, (header, payload.to_vec()));
                        }
                        Ok::<(), Broken>(())
                    });
                    if received.is_err() {
                        break;
                    }
                }
                done.store(true, Ordering::Relaxed);
            });
        }
    }
}

//! The queue of full blocks before they are written to their files, by the calling thread or by a thread of the tape.

use std::collections::VecDeque;
use std::mem::replace;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use super::AppendError;
use super::stream_file::{Block, StreamFile};

/// The number of spare blocks of one size, besides the one that each stream fills. Large blocks share one spare, because of their memory.
const SPARES: usize = 8;

/// The number of queued blocks at which the thread is woken. Waking it costs the stepping thread more than copying some samples.
const WAKE_THRESHOLD: usize = 4;

/// The files of a tape, and the blocks that are to be written to them. All memory is allocated at the beginning.
#[derive(Debug)]
pub(crate) struct BlockQueue {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug)]
struct Shared {
    files: Vec<Mutex<StreamFile>>,
    blocks: Mutex<Blocks>,
    /// There is work for the thread.
    filled: Condvar,
    /// No block is being written.
    emptied: Condvar,
}

#[derive(Debug)]
struct Blocks {
    /// Full blocks with the number of their stream, in the order of arrival.
    queue: VecDeque<(usize, Block)>,
    spare: Vec<Block>,
    /// The streams whose files rejected a block. Their blocks wait until [`BlockQueue::drain`] tries again.
    failed: Vec<bool>,
    /// The first error, until it is reported.
    error: Option<AppendError>,
    /// A block is being written.
    busy: bool,
    closed: bool,
}

impl BlockQueue {
    /// `block_sizes` has the block size of each stream; a size above `usual_size` counts as large.
    pub(crate) fn new(files: Vec<StreamFile>, mut block_sizes: Vec<usize>, usual_size: usize) -> BlockQueue {
        let failed = vec![false; files.len()];
        block_sizes.sort_unstable();
        let sizes = block_sizes.chunk_by(|one, next| one == next);
        let spares = sizes.flat_map(|same| {
            let count = if same[0] > usual_size { 1 } else { SPARES };
            (0..count).map(|_| Block::new(same[0]))
        });
        let spare: Vec<Block> = spares.collect();
        BlockQueue {
            shared: Arc::new(Shared {
                files: files.into_iter().map(Mutex::new).collect(),
                blocks: Mutex::new(Blocks {
                    queue: VecDeque::with_capacity(spare.len()),
                    spare,
                    failed,
                    error: None,
                    busy: false,
                    closed: false,
                }),
                filled: Condvar::new(),
                emptied: Condvar::new(),
            }),
            thread: None,
        }
    }

    /// From now on a thread writes, if one can be created.
    pub(crate) fn start_thread(&mut self) {
        let shared = self.shared.clone();
        let thread = std::thread::Builder::new().name("tape".into());
        self.thread = thread.spawn(move || shared.run_thread()).ok();
    }

    /// The file of stream number `stream`; it is up to date once [`BlockQueue::drain`] has returned.
    pub(crate) fn file(&self, stream: usize) -> MutexGuard<'_, StreamFile> {
        self.shared.file(stream)
    }

    /// Takes a full block of stream number `stream` and replaces it by an empty one. Does not allocate.
    ///
    /// # Errors
    /// The error of this block or of an earlier one. No block is lost: they are written again by the next call.
    pub(crate) fn enqueue(&self, stream: usize, block: &mut Block) -> Result<(), AppendError> {
        let mut blocks = self.shared.lock();
        while blocks.failed.contains(&true) || !blocks.has_spare(block.room) {
            drop(blocks);
            self.drain()?;
            blocks = self.shared.lock();
        }
        blocks.exchange(stream, block);
        if self.thread.is_none() {
            blocks = self.shared.write_queued(blocks);
            return blocks.error.take().map_or(Ok(()), Err);
        }
        if blocks.queue.len() >= WAKE_THRESHOLD || !blocks.has_spare(block.room) {
            drop(blocks);
            self.shared.filled.notify_one();
        }
        Ok(())
    }

    /// Writes all blocks to their files: the calling thread does what the tape's thread has not begun. A block that was rejected is tried
    /// once more, and does not hold up others.
    pub(crate) fn drain(&self) -> Result<(), AppendError> {
        let mut blocks = self.shared.lock();
        while blocks.busy {
            blocks = self.shared.wait(&self.shared.emptied, blocks);
        }
        blocks.failed.fill(false);
        blocks.error = None;
        blocks = self.shared.write_queued(blocks);
        blocks.error.take().map_or(Ok(()), Err)
    }

    /// Whether blocks of stream number `stream` could not be written.
    pub(crate) fn has_failed(&self, stream: usize) -> bool {
        self.shared.lock().failed[stream]
    }
}

#[cfg(test)]
impl BlockQueue {
    /// Counts the owners of the files, even after this is dropped.
    pub(crate) fn owner_count(&self) -> impl Fn() -> usize + use<> {
        let shared = Arc::downgrade(&self.shared);
        move || shared.strong_count()
    }
}

impl Drop for BlockQueue {
    fn drop(&mut self) {
        self.shared.lock().closed = true;
        self.shared.filled.notify_one();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Blocks {
    fn has_spare(&self, room: usize) -> bool {
        self.spare.iter().any(|spare| spare.room == room)
    }

    /// Moves `block` into the queue, and replaces it by the spare block that was used last.
    fn exchange(&mut self, stream: usize, block: &mut Block) {
        if let Some(at) = self.spare.iter().rposition(|spare| spare.room == block.room) {
            let spare = self.spare.swap_remove(at);
            self.queue.push_back((stream, replace(block, spare)));
        }
    }

    /// The position in the queue of the next block to write. `None` while one is being written: blocks of a stream keep their order.
    fn next(&self) -> Option<usize> {
        let waits = |(stream, _): &(usize, Block)| !self.failed[*stream];
        self.queue.iter().position(waits).filter(|_| !self.busy)
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Blocks> {
        self.blocks.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn file(&self, stream: usize) -> MutexGuard<'_, StreamFile> {
        self.files[stream].lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait<'a>(&self, on: &Condvar, blocks: MutexGuard<'a, Blocks>) -> MutexGuard<'a, Blocks> {
        on.wait(blocks).unwrap_or_else(PoisonError::into_inner)
    }

    /// The thread's main function.
    fn run_thread(&self) {
        let mut blocks = self.lock();
        while !blocks.closed {
            blocks = self.write_queued(blocks);
            if !blocks.closed {
                blocks = self.wait(&self.filled, blocks);
            }
        }
    }

    /// Writes block by block until no writable block is left.
    fn write_queued<'a>(&'a self, mut blocks: MutexGuard<'a, Blocks>) -> MutexGuard<'a, Blocks> {
        while let Some(at) = blocks.next() {
            let Some((stream, mut block)) = blocks.queue.remove(at) else {
                break;
            };
            blocks.busy = true;
            drop(blocks);
            let result = self.file(stream).write_block(&mut block);
            blocks = self.lock();
            blocks.busy = false;
            match result {
                Ok(()) => blocks.spare.push(block),
                Err(error) => {
                    blocks.failed[stream] = true;
                    blocks.error.get_or_insert(error);
                    // In the meantime other blocks can only have been added after it.
                    blocks.queue.insert(at, (stream, block));
                }
            }
            self.emptied.notify_one();
        }
        blocks
    }
}

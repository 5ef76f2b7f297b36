//! A reader cut into blocks of whole lines, and the threads that parse them.
//!
//! A file that fits one block is read by the caller alone. From the second block on each thread takes the next block
//! from the reader, parses it, and hands it in; the thread that hands in the next block of the file appends it and all
//! blocks that wait behind it, while the others go on. So the arrays are the same for any number of threads, appending
//! needs no thread of its own, and a few blocks are all the memory needed besides the arrays.

use std::{
    io::{ErrorKind, Read},
    num::NonZero,
    sync::{Condvar, Mutex, MutexGuard, PoisonError},
    thread,
};

use memchr::memrchr2;

use super::{
    ObjArrays, ObjSettings,
    block::{Block, Failure, MARGIN},
    collect::Collector,
    error::{LineProblem, ObjError},
};

/// Longest line in bytes, continuations included.
const LONGEST_LINE: usize = 256 << 20;
/// Largest block in bytes that is kept for the next read.
const KEPT_BLOCK: usize = 8 << 20;
/// Largest number of threads: more would wait for the reader and the memory.
const MOST_THREADS: usize = 8;

/// Bytes of the file that arrays hold; 0 for arrays that no file filled. The size is no content: any two are equal.
#[derive(Debug, Default, Clone, Copy)]
pub(super) struct FileSize(pub u64);

impl PartialEq for FileSize {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// Blocks kept between reads.
#[derive(Debug, Default)]
pub(super) struct SpareBlocks(Vec<Block>);

impl Clone for SpareBlocks {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl PartialEq for SpareBlocks {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// Reads the whole file into `arrays`.
pub(super) fn read(reader: impl Read + Send, arrays: &mut ObjArrays, settings: &ObjSettings) -> Result<(), ObjError> {
    let mut spare = std::mem::take(&mut arrays.spare.0);
    let result = read_with(reader, arrays, settings, &mut spare);
    spare.retain(|block| block.bytes() <= KEPT_BLOCK);
    arrays.spare.0 = spare;
    if result.is_err() {
        arrays.clear();
    }
    result
}

fn read_with(
    reader: impl Read + Send,
    arrays: &mut ObjArrays,
    settings: &ObjSettings,
    spare: &mut Vec<Block>,
) -> Result<(), ObjError> {
    let mut input = Input { reader, carry: Vec::new(), taken: 0, done: false, block: settings.block_bytes.max(16) };
    let mut collector = Collector::new(arrays);
    let mut block = spare.pop().unwrap_or_default();
    input.fill(&mut block);
    let threads = match settings.threads {
        _ if input.done => 1,
        0 => thread::available_parallelism().map_or(1, NonZero::get).min(MOST_THREADS),
        threads => threads.min(MOST_THREADS),
    };
    if threads == 1 {
        let mut result;
        loop {
            block.parse();
            result = collector.append(&mut block);
            if result.is_err() || input.done {
                break;
            }
            input.fill(&mut block);
        }
        spare.push(block);
        return result.and_then(|()| collector.finish());
    }
    let mut free = std::mem::take(spare);
    free.resize_with(threads + 1, Default::default);
    let work = Work {
        input: Mutex::new(input),
        order: Mutex::new(Order { due: 0, waiting: Vec::new(), free, appending: false, stop: false, error: None }),
        collector: Mutex::new(collector),
        change: Condvar::new(),
    };
    thread::scope(|scope| {
        for _ in 1..threads {
            // If no thread can be started, the read is only slower.
            let _ = thread::Builder::new().name("obj".into()).spawn_scoped(scope, || work.run(None));
        }
        work.run(Some((0, block)));
    });
    let order = work.order.into_inner().unwrap_or_else(PoisonError::into_inner);
    *spare = order.free;
    match order.error {
        Some(error) => Err(error),
        None => work.collector.into_inner().unwrap_or_else(PoisonError::into_inner).finish(),
    }
}

/// The reader and its position.
struct Input<R> {
    reader: R,
    /// The start of a line whose end the last block did not reach.
    carry: Vec<u8>,
    /// Number of blocks taken so far.
    taken: u64,
    done: bool,
    block: usize,
}

impl<R: Read> Input<R> {
    /// Reads the next whole lines. Sets `done` with the last of them, or at a failure.
    fn fill(&mut self, block: &mut Block) {
        block.failure = None;
        if let Err(failure) = self.try_fill(block) {
            block.failure = Some(failure);
            self.done = true;
        }
        self.taken += 1;
    }

    fn try_fill(&mut self, block: &mut Block) -> Result<(), Failure> {
        let text = &mut block.text;
        let wanted = self.block.max(2 * self.carry.len());
        if text.len() < wanted + MARGIN {
            text.resize(wanted + MARGIN, 0);
        }
        text[..self.carry.len()].copy_from_slice(&self.carry);
        let mut filled = self.carry.len();
        self.carry.clear();
        loop {
            let end = text.len() - MARGIN;
            while filled < end && !self.done {
                match self.reader.read(&mut text[filled..end]) {
                    Ok(0) => self.done = true,
                    Ok(read) => filled = (filled + read).min(end),
                    Err(error) if error.kind() == ErrorKind::Interrupted => {}
                    Err(error) => return Err(Failure::Io(error)),
                }
            }
            let cut = if self.done { Some(filled) } else { last_cut(&text[..filled]) };
            if let Some(cut) = cut {
                self.carry.extend_from_slice(&text[cut..filled]);
                block.filled = cut;
                break;
            }
            if filled >= LONGEST_LINE {
                return Err(Failure::Line(LineProblem::TooLong { limit: LONGEST_LINE }));
            }
            text.resize(filled * 2 + MARGIN, 0);
        }
        block.text[block.filled..][..MARGIN].fill(b'\n');
        match &mut block.text[..block.filled] {
            _ if self.taken > 0 => Ok(()),
            [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => Err(Failure::Line(LineProblem::Utf16)),
            [first @ 0xef, second @ 0xbb, third @ 0xbf, ..] => {
                // A byte order mark reads as blanks.
                (*first, *second, *third) = (b' ', b' ', b' ');
                Ok(())
            }
            _ => Ok(()),
        }
    }
}

/// Position just past the last line end without a continuation `\`. A carriage return at the very end may be half of a
/// line end and does not count.
fn last_cut(text: &[u8]) -> Option<usize> {
    let mut end = text.len();
    while let Some(at) = memrchr2(b'\n', b'\r', &text[..end]) {
        end = at;
        let half = text[at] == b'\r' && matches!(text.get(at + 1), None | Some(b'\n'));
        let line = if text[at] == b'\n' { text[..at].strip_suffix(b"\r").unwrap_or(&text[..at]) } else { &text[..at] };
        if !half && line.last() != Some(&b'\\') {
            return Some(at + 1);
        }
    }
    None
}

/// State that the threads share.
struct Work<'a, R> {
    input: Mutex<Input<R>>,
    order: Mutex<Order>,
    /// Collector of blocks; only the thread that set [`Order::appending`] locks it.
    collector: Mutex<Collector<'a>>,
    change: Condvar,
}

struct Order {
    /// The number of the block to append next.
    due: u64,
    /// Parsed blocks that wait for blocks before them.
    waiting: Vec<(u64, Block)>,
    free: Vec<Block>,
    appending: bool,
    stop: bool,
    error: Option<ObjError>,
}

impl<R: Read> Work<'_, R> {
    /// Takes, parses and hands in blocks until there are none. `first` is a block already taken.
    fn run(&self, mut first: Option<(u64, Block)>) {
        // Stops the other threads if the caller's reader panics in this one, so that they do not wait for its block.
        let _guard = StopOnUnwind { order: &self.order, change: &self.change };
        while let Some((number, mut block)) = first.take().or_else(|| self.take()) {
            block.parse();
            self.hand_in(number, block);
        }
    }

    fn take(&self) -> Option<(u64, Block)> {
        let mut order = lock(&self.order);
        let mut block = loop {
            if order.stop {
                return None;
            }
            match order.free.pop() {
                Some(block) => break block,
                None => order = self.change.wait(order).unwrap_or_else(PoisonError::into_inner),
            }
        };
        drop(order);
        let mut input = lock(&self.input);
        if input.done {
            drop(input);
            lock(&self.order).free.push(block);
            self.change.notify_all();
            return None;
        }
        let number = input.taken;
        input.fill(&mut block);
        Some((number, block))
    }

    fn hand_in(&self, number: u64, block: Block) {
        let mut order = lock(&self.order);
        order.waiting.push((number, block));
        if order.appending {
            return;
        }
        order.appending = true;
        while !order.stop {
            let due = order.due;
            let Some(at) = order.waiting.iter().position(|(number, _)| *number == due) else { break };
            let (_, mut block) = order.waiting.swap_remove(at);
            drop(order);
            let result = lock(&self.collector).append(&mut block);
            order = lock(&self.order);
            order.free.push(block);
            order.due += 1;
            if let Err(error) = result {
                order.error = Some(error);
                order.stop = true;
            }
            self.change.notify_all();
        }
        order.appending = false;
    }
}

/// Locks a mutex, poisoned or not: the state that a panic left is not used afterwards.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

struct StopOnUnwind<'a> {
    order: &'a Mutex<Order>,
    change: &'a Condvar,
}

impl Drop for StopOnUnwind<'_> {
    fn drop(&mut self) {
        if thread::panicking() {
            lock(self.order).stop = true;
            self.change.notify_all();
        }
    }
}

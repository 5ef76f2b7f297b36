//! Limits of the process: threads, the stack of the main thread, and the address space.
//!
//! An allocation that fails, and a stack that ends, abort a process without a word. Limits under which that is to be expected are
//! told at the start.

use std::{
    fs, io,
    process::ExitCode,
    thread::{self, available_parallelism},
};

use rayon::{ThreadPoolBuildError, ThreadPoolBuilder};

/// Least stack, in bytes, on which the main thread runs a command.
const LEAST_STACK: u64 = 1 << 20;
/// Stack, in bytes, of the thread that runs a command in place of the main one.
const OWN_STACK: usize = 16 << 20;
/// Least address space, in MiB, in which the program, its threads and their heaps find room.
const LEAST_SPACE: u64 = 512;
/// Address space, in MiB, of the program and of what it reads.
const SPACE_OF_PROGRAM: u64 = 256;
/// Address space, in MiB, that a thread takes, however little it needs: the system sets a heap aside for each.
const SPACE_OF_THREAD: u64 = 64;
/// Threads that a person may ask for on a machine of few cores.
const FEW_THREADS: usize = 64;
/// Largest number of threads that compute.
const MOST_THREADS: usize = 256;
/// Limits of this process, where the system tells them as a file.
const LIMITS_FILE: &str = "/proc/self/limits";

/// Reason why a command cannot run in this process.
#[derive(Debug, thiserror::Error)]
pub(super) enum ProcessError {
    /// The address space is too small.
    #[error(
        "this process may address {0} MiB of memory, and commands need {least} MiB; raise the limit (`ulimit -v`)",
        least = LEAST_SPACE
    )]
    AddressSpace(u64),
    /// The threads that compute do not start.
    #[error(
        "the threads that compute cannot be started ({0}); allow this process more threads or memory, or set \
         RAYON_NUM_THREADS to a smaller number"
    )]
    Pool(#[from] ThreadPoolBuildError),
    /// The thread with a stack of its own does not start.
    #[error("a thread cannot be started ({0}); allow this process a larger stack (`ulimit -s`), or more threads")]
    Thread(io::Error),
}

/// Soft limit of that name in the list of a process; `None` where there is none.
fn limit(name: &str) -> Option<u64> {
    let list = fs::read_to_string(LIMITS_FILE).ok()?;
    list.lines().find_map(|line| line.strip_prefix(name))?.split_whitespace().next()?.parse().ok()
}

/// True if the main thread has a stack that is too small for a command.
pub(super) fn has_small_stack() -> bool {
    limit("Max stack size").is_some_and(|bytes| bytes < LEAST_STACK)
}

/// Runs a command on a thread with a stack of its own.
pub(super) fn on_own_stack(run: fn() -> ExitCode) -> Result<ExitCode, ProcessError> {
    let thread = thread::Builder::new().name("command".to_owned()).stack_size(OWN_STACK).spawn(run);
    // The hook has told of a panic.
    Ok(thread.map_err(ProcessError::Thread)?.join().unwrap_or(ExitCode::FAILURE))
}

/// Largest number of threads that leave room for the program in an address space of so many MiB.
fn threads_in(space: u64) -> usize {
    let threads = space.saturating_sub(SPACE_OF_PROGRAM) / SPACE_OF_THREAD;
    usize::try_from(threads).unwrap_or(MOST_THREADS).max(1)
}

/// Checks the limits of this process, and starts the threads that compute: as many as there are cores, or as RAYON_NUM_THREADS asks
/// for, within reason and within the address space.
pub(super) fn prepare() -> Result<(), ProcessError> {
    let space = limit("Max address space").map(|bytes| bytes >> 20);
    if let Some(space) = space.filter(|space| *space < LEAST_SPACE) {
        return Err(ProcessError::AddressSpace(space));
    }
    let cores = available_parallelism().map_or(1, usize::from);
    let asked = std::env::var("RAYON_NUM_THREADS").ok().and_then(|number| number.parse::<usize>().ok());
    let threads = match asked {
        Some(asked @ 1..) => asked.min(cores.max(FEW_THREADS)),
        _ => cores,
    };
    let most = space.map_or(MOST_THREADS, threads_in).min(MOST_THREADS);
    Ok(ThreadPoolBuilder::new().num_threads(threads.min(most)).build_global()?)
}

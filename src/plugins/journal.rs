//! Every committed edit, on the disk at once.

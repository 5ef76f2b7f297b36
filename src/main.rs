//! The `rigsmith` command.

fn main() -> std::process::ExitCode {
    rigsmith::cli::main()
}

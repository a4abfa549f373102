//! The `millstream` command; all of it lives in [`millstream::cli`].

fn main() -> std::process::ExitCode {
    millstream::cli::main()
}

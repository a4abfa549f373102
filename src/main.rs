//! The `millstream` command; all of it lives in the crate `cli`.

fn main() -> std::process::ExitCode {
    cli::main()
}

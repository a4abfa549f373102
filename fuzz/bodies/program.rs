//! What holds of every program, however it was read.

use millstream::program::{Placing, Program, ProgramError};

pub fn holds(read: Result<Program, ProgramError>, bytes: &[u8]) {
    let lines = bytes.split(|b| *b == b'\n').count() as u32;
    match read {
        Ok(program) => follow(&program, lines),
        Err(error) => place(&error, lines),
    }
}

fn place(error: &ProgramError, lines: u32) {
    assert!((1..=lines).contains(&error.line) && error.column > 0, "{error}");
    assert!(!error.cure().is_empty() && error.to_string().len() < 100_000);
}

fn follow(program: &Program, lines: u32) {
    for step in &program.steps {
        assert!((1..=lines).contains(&step.line) && step.to.iter().all(|x| x.is_finite()), "{step:?}");
        assert!(step.feed >= 0.0 && (step.setting as usize) < program.settings.len(), "{step:?}");
    }
    let _ = program.findings(&|_| Some(1.0));
    // A coarse tolerance: huge arcs would take many chords.
    match program.runs(&Placing { chord: 1.0, kinematics: None, lengths: &|_| None }) {
        Ok(runs) => {
            for run in &runs {
                assert_eq!(run.path.origin.lines.len(), run.path.len());
                let sound = run
                    .path
                    .moves
                    .iter()
                    .all(|m| m.to.tip.iter().all(|x| x.is_finite()) && m.feed_rate > 0.0);
                assert!(sound && run.path.start.tip.iter().all(|x| x.is_finite()));
            }
        }
        Err(error) => place(&error, lines),
    }
}

//! The nightly report, from plain data. Enters: the reports of many scenes, a baseline, rules, the history.
//! Leaves: what got worse, and the pages that show it.
//!
//! Nothing here reads a file, starts a process or knows the time. The command does (`cli::nightly`).

mod accuracy;
mod checks;
mod compare;
mod convergence;
mod date;
mod figures;
mod history;
mod html;
mod junit;
mod markdown;
mod published;
mod reference;
mod results;
mod rules;
mod table;
mod words;

pub use accuracy::{accuracy, further};
pub use checks::{Measured, Study, studies};
pub use compare::{Comparison, Finding, compare};
pub use date::date_of;
pub use figures::{FIGURES, Figure, Group};
pub use history::{History, Night};
pub use html::html_page;
pub use junit::junit;
pub use markdown::{markdown, summary};
pub use published::{Ours, Published, published_page};
pub use reference::reference_work;
pub use results::{
    Case, ClosedForm, Cost, Outcome, Results, ResultsError, SceneResult, Shard, ToolpathResult, merge,
};
pub use rules::{Exact, Limit, Missing, Rules};

#[cfg(test)]
mod fixture;

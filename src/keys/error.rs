//! What is wrong with a scene, where it stands and what cures it.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use miette::{Diagnostic, NamedSource, SourceSpan};
use toml::Spanned;
use toml::de::DeTable;

use super::printable::printable;

/// The bytes of a scene as text, with the name under which messages speak of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SceneText {
    /// As the user wrote it (usually the path on the command line), without control characters.
    pub name: String,
    /// The whole text.
    pub text: Arc<String>,
}

impl SceneText {
    /// A scene of this name and text.
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> Self {
        Self { name: printable(&name.into()), text: Arc::new(text.into()) }
    }

    /// The text as a tree of values with their places.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] where it is no TOML.
    pub fn table(&self) -> Result<Spanned<DeTable<'_>>, SceneError> {
        DeTable::parse(&self.text).map_err(|e| {
            let end = self.text.len();
            let message = e.message().trim().replace('\n', ", ");
            self.error(
                e.span().unwrap_or(end..end),
                format!("not valid TOML: {message}"),
                "see https://toml.io for how TOML is written",
            )
        })
    }

    /// An error that points at `span` (bytes of the text).
    pub fn error(
        &self,
        span: Range<usize>,
        message: impl Into<String>,
        cure: impl Into<String>,
    ) -> SceneError {
        let end = self.text.len();
        // A caret needs a character to stand under; at the end of the text it stands after the last.
        let start = self.boundary(span.start.min(end));
        let stop = self.boundary(span.end.clamp(start, end));
        let mut message = readable(&message.into());
        let source_code =
            self.can_be_shown(start, stop).then(|| NamedSource::new(&self.name, Arc::clone(&self.text)));
        if source_code.is_none() {
            let (line, column) = self.line_and_column(start);
            message = format!("{}:{line}:{column}: {message}", self.name);
        }
        SceneError::Invalid(Box::new(Finding {
            message,
            cure: cure.into(),
            source_code,
            at: SourceSpan::new(start.into(), stop - start),
        }))
    }

    /// True when the lines around `start..stop` can stand in a message: they are short, and have no
    /// control character, which a terminal would obey.
    fn can_be_shown(&self, start: usize, stop: usize) -> bool {
        /// Bytes of a line. A longer one fills the screen and hides the message.
        const LONGEST_LINE: usize = 400;
        // A line before and a line after are shown too.
        let first = self.text[..start].rmatch_indices('\n').nth(1).map_or(0, |(k, _)| k + 1);
        let after = self.text[stop..].match_indices('\n').nth(1).map_or(self.text.len(), |(k, _)| stop + k);
        let plain = |c: char| !c.is_control() || c == '\t' || c == '\r';
        self.text[first..after].split('\n').all(|line| line.len() <= LONGEST_LINE && line.chars().all(plain))
    }

    /// The nearest character boundary at or before byte `at`.
    fn boundary(&self, mut at: usize) -> usize {
        while !self.text.is_char_boundary(at) {
            at -= 1;
        }
        at
    }

    /// Line and column (in characters), both from 1, of byte `at`.
    pub fn line_and_column(&self, at: usize) -> (usize, usize) {
        let before = &self.text[..self.boundary(at.min(self.text.len()))];
        let line_start = before.rfind('\n').map_or(0, |k| k + 1);
        (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
    }
}

/// A message without control characters and no longer than a paragraph, whatever it quotes.
fn readable(message: &str) -> String {
    /// In characters.
    const LONGEST: usize = 400;
    let start: String = message.chars().take(LONGEST).collect();
    let mut text = printable(&start);
    if message.chars().nth(LONGEST).is_some() {
        text.push('…');
    }
    text
}

/// One thing wrong at one place of a scene.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("{message}")]
pub struct Finding {
    /// What is wrong, in a sentence.
    pub message: String,
    /// What to write instead.
    #[help]
    pub cure: String,
    /// `None` when the text cannot be shown; the message then begins with the place.
    #[source_code]
    source_code: Option<NamedSource<Arc<String>>>,
    /// Bytes of the text that are meant.
    #[label("here")]
    pub at: SourceSpan,
}

/// Why a scene cannot be used.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum SceneError {
    /// The file could not be read.
    #[error("cannot read the scene {}: {reason}", printable(&path.to_string_lossy()))]
    #[diagnostic(help("name an existing TOML file of UTF-8 text"))]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system said.
        reason: String,
    },
    /// Something in the text is wrong.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Invalid(Box<Finding>),
}

impl SceneError {
    /// An error for a scene file that could not be read.
    pub fn unreadable(path: &Path, reason: impl Into<String>) -> Self {
        Self::Unreadable { path: path.to_owned(), reason: reason.into() }
    }
}

/// Of `words`, the one that `wrong` was most likely meant to be.
pub fn nearest<'a>(wrong: &str, words: &[&'a str]) -> Option<&'a str> {
    /// Below this likeness (0 to 1) a suggestion confuses more than it helps.
    const LIKENESS: f64 = 0.6;
    let wrong = wrong.to_lowercase();
    words
        .iter()
        .map(|word| (strsim::normalized_damerau_levenshtein(&wrong, word), *word))
        .filter(|(likeness, _)| *likeness >= LIKENESS)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, word)| word)
}

/// `a, b or c`, each in backquotes.
pub fn listed(words: &[&str]) -> String {
    let quoted: Vec<String> = words.iter().map(|w| format!("`{w}`")).collect();
    match quoted.split_last() {
        None => "nothing".to_owned(),
        Some((last, [])) => last.clone(),
        Some((last, rest)) => format!("{} or {last}", rest.join(", ")),
    }
}

/// `did you mean …?` before the list of all valid words.
pub fn suggestion(wrong: &str, words: &[&str]) -> String {
    let all = format!("valid here: {}", listed(words));
    match nearest(wrong, words) {
        Some(word) => format!("did you mean `{word}`? ({all})"),
        None => all,
    }
}

//! The page and the JSON.

use super::Section;
use super::table::{Table, figure};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use serde_json::{Map, Value, json};

/// The look of the program's own report.
const STYLE: &str = include_str!("../../src/report/style.css");

/// Wide tables scroll rather than break the names of their rows.
const WIDE: &str = "body { max-width: 1240px; } .wide { overflow-x: auto; } \
                    .wide tbody th { white-space: nowrap !important; } \
                    .plots { display: flex; flex-wrap: wrap; gap: 12px; } .plots svg { width: 520px; }";

/// The whole page; it opens offline.
pub fn html(sections: &[Section], quick: bool, minutes: f64) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { "Bench report - millstream" }
                style { (PreEscaped(STYLE)) (WIDE) }
            }
            body {
                h1 { "Bench report" }
                p.faint {
                    "millstream " (env!("CARGO_PKG_VERSION")) " · measured in " (format!("{minutes:.1}")) " min"
                    @if quick { " · quick: a smaller part, fewer rounds" }
                }
                p {
                    "What is compared ran in turns in this one run, and the least time of all rounds \
                     counts. Ratios carry over to other machines better than seconds do."
                }
                @for section in sections {
                    section {
                        h2 { (section.title) }
                        @if section.tables.is_empty() { p.faint { "This system does not tell." } }
                        @for table in &section.tables { (table_of(table)) }
                        div.plots { @for plot in &section.plots { (PreEscaped(plot)) } }
                    }
                }
            }
        }
    };
    page.into_string()
}

fn table_of(table: &Table) -> Markup {
    html! {
        h3 { (table.title) }
        p.faint { (table.note) }
        div.wide {
            table.figures {
                thead {
                    tr { th {} @for column in &table.columns { th { (column.0) } } }
                    tr.unit { th {} @for column in &table.columns { th { (column.1) } } }
                }
                tbody {
                    @for (name, row) in &table.rows {
                        tr { th { (name) } @for value in row { td { (figure(*value)) } } }
                    }
                }
            }
        }
    }
}

/// Every table by its key.
pub fn json(sections: &[Section], quick: bool) -> Value {
    let tables = sections.iter().flat_map(|s| &s.tables).map(|t| (t.key.to_string(), t.json()));
    json!({
        "millstream": env!("CARGO_PKG_VERSION"),
        "quick": quick,
        "tables": tables.collect::<Map<String, Value>>(),
    })
}

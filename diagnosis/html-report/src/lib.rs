//! Pages to read and to print: one HTML file each, with everything inside, drawn as SVG. It knows
//! text, tables and curves, and nothing of needles; the content of a page is its caller's.
//! [`Sheet`] and [`chart`] are a page in one style; a page with a style of its own is a
//! [`document`], which may have [`plot`]s.

pub mod chart;
pub mod drawing;
pub mod plot;
pub mod section;

use std::fmt::Write as _;

const STYLE: &str = include_str!("style.css");

/// A page being written.
#[derive(Clone, Debug)]
pub struct Sheet {
    title: String,
    body: String,
}

/// A cell of a table.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// Words.
    Text(String),
    /// A number, set flush with others; with its unit.
    Number(String),
    /// Words that lead to another page.
    Link {
        /// The words.
        text: String,
        /// The page's address, relative to this one.
        to: String,
    },
    /// One of a few words that the eye should find, each kind in its own colour.
    Tag {
        /// Its text.
        text: String,
        /// Its kind: 0 to 3.
        kind: u8,
    },
}

impl Cell {
    /// Words.
    pub fn text(words: impl Into<String>) -> Self {
        Self::Text(words.into())
    }

    /// Returns a number with as many decimals as are worth reading, or a dash if the number is
    /// missing.
    pub fn number(value: Option<f64>, decimals: usize) -> Self {
        Self::Number(value.filter(|v| v.is_finite()).map_or("–".into(), |v| decimal(v, decimals)))
    }
}

/// A decimal number with a true minus, and no "−0.00".
pub fn decimal(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let is_zero = text.bytes().all(|b| matches!(b, b'0' | b'.' | b'-'));
    text.replace('-', if is_zero { "" } else { "−" })
}

/// Returns `text` escaped for HTML.
pub fn safe(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

impl Sheet {
    /// A page with this title and a first paragraph under it.
    pub fn new(title: &str, lead: &str) -> Self {
        let body = format!("<header><h1>{}</h1><p class=lead>{}</p></header>", safe(title), safe(lead));
        Self { title: title.to_owned(), body }
    }

    /// A new part under a heading.
    pub fn heading(&mut self, words: &str) {
        let _ = write!(self.body, "<h2>{}</h2>", safe(words));
    }

    /// A paragraph.
    pub fn paragraph(&mut self, words: &str) {
        let _ = write!(self.body, "<p>{}</p>", safe(words));
    }

    /// A remark, smaller.
    pub fn note(&mut self, words: &str) {
        let _ = write!(self.body, "<p class=note>{}</p>", safe(words));
    }

    /// A table; it scrolls sideways by itself where the screen is narrow.
    pub fn table(&mut self, head: &[&str], rows: &[Vec<Cell>]) {
        self.body.push_str("<div class=scroll><table><thead><tr>");
        for (column, words) in head.iter().enumerate() {
            let numbers = rows.first().and_then(|row| row.get(column));
            let class = if matches!(numbers, Some(Cell::Number(_))) { " class=n" } else { "" };
            let _ = write!(self.body, "<th{class}>{}</th>", safe(words));
        }
        self.body.push_str("</tr></thead><tbody>");
        for row in rows {
            self.body.push_str("<tr>");
            for cell in row {
                let _ = match cell {
                    Cell::Text(words) => write!(self.body, "<td>{}</td>", safe(words)),
                    Cell::Number(words) => write!(self.body, "<td class=n>{}</td>", safe(words)),
                    Cell::Link { text, to } => {
                        write!(self.body, "<td><a href=\"{}\">{}</a></td>", safe(to), safe(text))
                    }
                    Cell::Tag { text, kind } => {
                        write!(self.body, "<td><span class=\"tag k{kind}\">{}</span></td>", safe(text))
                    }
                };
            }
            self.body.push_str("</tr>");
        }
        self.body.push_str("</tbody></table></div>");
    }

    /// Figures side by side where there is room: each an SVG with a caption.
    pub fn figures(&mut self, figures: &[(String, String)]) {
        self.body.push_str("<div class=figures>");
        for (svg, caption) in figures {
            let _ = write!(self.body, "<figure>{svg}<figcaption>{}</figcaption></figure>", safe(caption));
        }
        self.body.push_str("</div>");
    }

    /// The whole file.
    pub fn finish(self) -> String {
        document(&self.title, STYLE, &self.body, None)
    }
}

/// Returns a whole page with everything inside: `body` is its markup, `style` its CSS and `script`
/// its JavaScript.
pub fn document(title: &str, style: &str, body: &str, script: Option<&str>) -> String {
    let script = script.map_or_else(String::new, |script| format!("<script>{script}</script>"));
    format!(
        "<!doctype html>\n<html lang=en><head><meta charset=utf-8><meta name=viewport content=\"width=device-width, \
         initial-scale=1\"><meta name=color-scheme content=\"light dark\"><title>{}</title><style>{style}</style></head>\
         <body><main>{body}</main>{script}</body></html>\n",
        safe(title)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_on_a_page_is_markup_and_nothing_is_fetched() {
        let mut sheet = Sheet::new("<b>&", "a \"lead\"");
        sheet.heading("<i>");
        sheet.table(
            &["a<b"],
            &[vec![Cell::text("<script>")], vec![Cell::Tag { text: "<u>".into(), kind: 1 }]],
        );
        let html = sheet.finish();
        for markup in ["<b>", "<i>", "<script", "<u>", "http", "src=", "a<b"] {
            assert!(!html.contains(markup), "{markup}");
        }
        assert!(html.contains("&lt;script&gt;") && html.contains("&lt;b&gt;&amp;"));
    }

    #[test]
    fn numbers_are_written_as_people_write_them() {
        assert_eq!([decimal(-0.004, 2), decimal(-1.5, 1), decimal(2.0, 0)], ["0.00", "−1.5", "2"]);
        assert_eq!(Cell::number(None, 1), Cell::Number("–".into()));
        assert_eq!(Cell::number(Some(f64::NAN), 1), Cell::Number("–".into()));
    }
}

//! A page in one HTML file with its style, script and plots; light and dark, for screens and for print.
//!
//! The functions here make the components of a page. All text goes through `escaped`.

use std::fmt::Write;

use super::escape::escaped;
use super::plot::Figure;

/// A section: a heading and the components below it.
pub struct Section {
    /// Identifier, for links.
    pub id: String,
    pub title: String,
    /// Components, as HTML.
    pub body: String,
}

impl Section {
    pub fn new(id: &str, title: &str, body: String) -> Self {
        Self {
            id: id.to_owned(),
            title: title.to_owned(),
            body,
        }
    }
}

/// A paragraph with a CSS class.
pub fn paragraph(class: &str, text: &str) -> String {
    format!("<p class=\"{}\">{}</p>\n", escaped(class), escaped(text))
}

/// Text that opens on a click on its heading.
pub fn folded(heading: &str, body: &str) -> String {
    format!(
        "<details><summary>{}</summary>{body}</details>\n",
        escaped(heading)
    )
}

/// Sections that open on a click on their common title.
#[derive(Clone, Copy, Debug)]
pub struct Group<'a> {
    /// Stands before the identifiers of the sections too.
    pub prefix: &'a str,
    pub id: &'a str,
    pub title: &'a str,
    /// What it holds, beside the title.
    pub about: &'a str,
    pub is_open: bool,
}

/// A group with its sections; nothing without a section.
pub fn group(group: Group<'_>, sections: &[Section]) -> String {
    if sections.is_empty() {
        return String::new();
    }
    let Group { prefix, id, .. } = group;
    let mut body = String::new();
    for section in sections {
        let (class, name) = (escaped(&section.id), escaped(&section.title));
        let _ = write!(
            body,
            "<section id=\"{prefix}{class}\" class=\"{class}\"><h3>{name}</h3>\n{}</section>\n",
            section.body
        );
    }
    let open = if group.is_open { " open" } else { "" };
    format!(
        "<details id=\"{prefix}{id}\" class=\"group\"{open}><summary><h2>{}</h2> <span>{}</span></summary>\n{body}</details>\n",
        escaped(group.title),
        escaped(group.about)
    )
}

/// A part of the page of which one is seen at a time; without a script all are.
pub struct Tab {
    /// Identifier, for links.
    pub id: String,
    pub title: String,
    /// Components, as HTML.
    pub body: String,
}

/// Tabs; `name` says what they are.
pub fn tabs(name: &str, tabs: &[Tab]) -> String {
    let (mut buttons, mut panels) = (String::new(), String::new());
    for (index, tab) in tabs.iter().enumerate() {
        let (id, title) = (escaped(&tab.id), escaped(&tab.title));
        let (is_first, order) = (index == 0, if index == 0 { 0 } else { -1 });
        let _ = write!(
            buttons,
            "<button type=\"button\" role=\"tab\" id=\"tab-{id}\" aria-controls=\"{id}\" aria-selected=\"{is_first}\" \
             tabindex=\"{order}\">{title}</button>"
        );
        let _ = write!(
            panels,
            "<section id=\"{id}\" class=\"panel\" aria-labelledby=\"tab-{id}\"><h2 class=\"name\">{title}</h2>\n{}</section>\n",
            tab.body
        );
    }
    format!(
        "<div role=\"tablist\" aria-label=\"{}\" hidden>{buttons}</div>\n{panels}",
        escaped(name)
    )
}

/// A button that copies a text. It does not appear without a script.
pub fn copy(label: &str, text: &str) -> String {
    format!(
        "<p class=\"copy\" hidden><button type=\"button\" data-text=\"{}\">{}</button> <span role=\"status\"></span></p>\n",
        escaped(text),
        escaped(label)
    )
}

/// A heading with the identifier to which it links.
pub fn heading_to(id: &str, title: &str) -> String {
    format!(
        "<h2><a href=\"#{}\">{}</a></h2>\n",
        escaped(id),
        escaped(title)
    )
}

/// Texts side by side, as many as fit.
pub fn cards(cards: &[String]) -> String {
    let cards = cards.iter().map(|card| format!("<div>{card}</div>\n"));
    format!(
        "<div class=\"cards\">\n{}</div>\n",
        cards.collect::<String>()
    )
}

/// The main result of the page, good or bad.
pub fn verdict(is_good: bool, text: &str) -> String {
    let kind = if is_good { "good" } else { "bad" };
    format!("<p class=\"verdict {kind}\">{}</p>\n", escaped(text))
}

/// A list.
pub fn list(items: &[String]) -> String {
    let items = items
        .iter()
        .map(|item| format!("<li>{}</li>", escaped(item)));
    format!("<ul>{}</ul>\n", items.collect::<String>())
}

/// A list of names with their values.
pub fn facts(facts: &[(impl AsRef<str>, String)]) -> String {
    let mut all = String::new();
    for (name, value) in facts {
        let (name, value) = (escaped(name.as_ref()), escaped(value));
        let _ = writeln!(all, "<dt>{name}</dt><dd>{value}</dd>");
    }
    format!("<dl>\n{all}</dl>\n")
}

/// A table cell: a value, and a smaller one below it.
pub struct Cell<'a> {
    pub value: &'a str,
    pub below: Option<String>,
}

/// Largest number of columns that a phone shows side by side; with more, each row becomes a list.
const MOST_COLUMNS: usize = 5;

/// A table; its first column has the names of the rows.
pub fn table(caption: &str, columns: &[String], rows: &[(&str, Vec<Cell<'_>>)]) -> String {
    let wide = if columns.len() > MOST_COLUMNS {
        " wide"
    } else {
        ""
    };
    let mut html = format!(
        "<div class=\"table{wide}\"><table><caption>{}</caption><thead><tr>",
        escaped(caption)
    );
    for column in columns {
        let _ = match column.as_str() {
            "" => write!(html, "<td></td>"),
            name => write!(html, "<th scope=\"col\">{}</th>", escaped(name)),
        };
    }
    html.push_str("</tr></thead><tbody>\n");
    for (name, cells) in rows {
        let _ = write!(html, "<tr><th scope=\"row\">{}</th>", escaped(name));
        for (cell, column) in cells.iter().zip(columns.iter().skip(1)) {
            let (value, column) = (escaped(cell.value), escaped(column));
            let _ = write!(html, "<td data-column=\"{column}\">{value}");
            if let Some(below) = &cell.below {
                let _ = write!(html, "<small>{}</small>", escaped(below));
            }
            html.push_str("</td>");
        }
        html.push_str("</tr>\n");
    }
    html.push_str("</tbody></table></div>\n");
    html
}

/// A table of texts: the name of each row and its cells.
pub fn plain_table<const N: usize>(
    caption: &str,
    columns: &[&str],
    rows: impl IntoIterator<Item = (String, [String; N])>,
) -> String {
    let rows: Vec<(String, [String; N])> = rows.into_iter().collect();
    let columns: Vec<String> = columns.iter().map(ToString::to_string).collect();
    let cell = |value| Cell { value, below: None };
    let rows: Vec<_> = (rows.iter())
        .map(|(name, values)| {
            let cells = values.iter().map(|value| cell(value.as_str()));
            (name.as_str(), cells.collect())
        })
        .collect();
    table(caption, &columns, &rows)
}

/// A plot with its caption.
pub fn figure(figure: &Figure) -> String {
    // A browser looks for the end tag only; without `<` there is none in the JSON.
    let json = figure.to_json().replace('<', "\\u003c");
    let shape = figure.shape.name();
    format!(
        "<figure class=\"{shape}\"><div class=\"plot\"><script type=\"application/json\">{json}</script></div>\
         <figcaption>{}</figcaption></figure>\n",
        escaped(&figure.caption)
    )
}

/// Text with a plot beside it, below it on a phone.
pub fn beside(text: &str, plot: &str) -> String {
    format!("<div class=\"beside\"><div>{text}</div>{plot}</div>\n")
}

/// Plots side by side, as many as fit.
pub fn row(figures: &[Figure]) -> String {
    let figures = figures.iter().map(figure).collect::<String>();
    format!("<div class=\"row\">\n{figures}</div>\n")
}

/// A page of sections, with links to them below the lead.
pub fn page(title: &str, lead: &str, sections: &[Section]) -> String {
    let mut links = String::new();
    let mut body = String::new();
    for section in sections {
        let (id, name) = (escaped(&section.id), escaped(&section.title));
        let _ = write!(links, "<a href=\"#{id}\">{name}</a>");
        let _ = write!(
            body,
            "<section id=\"{id}\"><h2>{name}</h2>\n{}</section>\n",
            section.body
        );
    }
    whole(title, &format!("{lead}<nav>{links}</nav>\n{body}"))
}

/// A page of components.
pub fn whole(title: &str, body: &str) -> String {
    let title = escaped(title);
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title}</title>\n<style>\n{STYLE}</style>\n<script>{PLOTLY}</script>\n</head>\n<body>\n\
         <header><h1>{title}</h1><button id=\"theme\" type=\"button\">light / dark</button></header>\n\
         <main>\n<noscript><p class=\"note\">The plots need JavaScript; the tables work without.</p></noscript>\n\
         {body}</main>\n<script>\n{SCRIPT}</script>\n</body>\n</html>\n"
    )
}

/// plotly.js with the kinds of plots that pages have: build.rs.
const PLOTLY: &str = include_str!(concat!(env!("OUT_DIR"), "/plotly.js"));
const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

#[cfg(test)]
mod tests {
    use super::super::plot::{Axis, Panel};
    use super::*;

    // A text with tags and quotes puts no tag on the page and ends no attribute and no script.
    #[test]
    fn text_stays_text() {
        let hostile = "</script><b x='\"'>&";
        let safe = "&lt;/script&gt;&lt;b x=&#39;&quot;&#39;&gt;&amp;";
        assert_eq!(escaped(hostile), safe);
        let cell = Cell {
            value: hostile,
            below: Some(hostile.to_owned()),
        };
        let columns = [hostile.to_owned(), hostile.to_owned()];
        let html = table(hostile, &columns, &[(hostile, vec![cell])]);
        // Caption, two headings, the row's name, the value, its column and the text below it.
        assert_eq!(html.matches(safe).count(), 7);
        let html = facts(&[(hostile.to_owned(), hostile.to_owned())]);
        assert_eq!(html.matches(safe).count(), 2);
        assert!(!html.contains("<b") && !html.contains("</script"));
        assert!(!verdict(true, hostile).contains("<b"));
        let axis = Axis::titled(hostile);
        let panel = Panel::new(axis.clone(), vec![]);
        let html = figure(&Figure::single(hostile, axis, panel));
        assert_eq!(html.matches("</script").count(), 1, "{html}");
    }

    // One file that loads nothing else, with two scripts: plotly.js and that of the page.
    #[test]
    fn the_page_is_whole() {
        let section = Section {
            id: "one".to_owned(),
            title: "One".to_owned(),
            body: paragraph("note", "text"),
        };
        let html = page("A & B", "", &[section]);
        assert!(html.contains("<title>A &amp; B</title>"));
        assert!(html.contains("<a href=\"#one\">One</a>"));
        assert_eq!(html.matches("</script>").count(), 2);
        assert!(!html.contains("<script src") && !html.contains("<link"));
        assert!(
            (1_000_000..1_300_000).contains(&html.len()),
            "{}",
            html.len()
        );
    }
}

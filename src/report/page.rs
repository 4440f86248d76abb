//! The page itself: a template whose marks are replaced once, from its beginning to its end.

use std::fmt::Write as _;
use std::io::{self, Write};

use super::facts::{Facts, Figure};
use super::json::write_story;
use super::pack::base64;
use super::story::Story;
use crate::reason::Reason;

const TEMPLATE: &str = include_str!("viewer/page.html");
const STYLE: &str = include_str!("viewer/viewer.css");
/// In the order in which they use each other.
const SCRIPTS: [&str; 8] = [
    include_str!("viewer/data.js"),
    include_str!("viewer/camera.js"),
    include_str!("viewer/render.js"),
    include_str!("viewer/overlay.js"),
    include_str!("viewer/panel.js"),
    include_str!("viewer/charts.js"),
    include_str!("viewer/pointer.js"),
    include_str!("viewer/viewer.js"),
];

/// Writes one HTML page that needs nothing else, neither a file nor a network.
///
/// # Errors
///
/// Those of `out`.
pub fn write_report(out: &mut dyn Write, story: &Story, facts: &Facts) -> io::Result<()> {
    // What is put in is never looked at for marks again, so that no text from a bag can pose as one.
    let mut rest = TEMPLATE;
    while let Some((before, after)) = rest.split_once("{{") {
        out.write_all(before.as_bytes())?;
        let (mark, after) = after.split_once("}}").unwrap_or((after, ""));
        write_part(out, mark, story, facts)?;
        rest = after;
    }
    out.write_all(rest.as_bytes())
}

fn write_part(out: &mut dyn Write, mark: &str, story: &Story, facts: &Facts) -> io::Result<()> {
    let text = match mark {
        "story" => return write_story(out, story),
        "style" => STYLE.to_owned(),
        "scripts" => SCRIPTS.join("\n"),
        "title" => escaped(&facts.title),
        "frame" => escaped(&facts.fixed_frame),
        "summary" => summary(story, facts),
        "remarks" => joined(&facts.remarks, |remark| format!("<p>{}</p>\n", with_code(remark))),
        "warnings" => joined(&facts.warnings, |it| format!("<p class=\"note\">{}</p>\n", with_code(it))),
        "figures" => figures(&facts.figures),
        "parameters" => parameters(&facts.parameters),
        "skipped" => skipped(facts),
        "version" => env!("CARGO_PKG_VERSION").to_owned(),
        _ => return Err(io::Error::other(format!("the template has an unknown mark: {mark}"))),
    };
    out.write_all(text.as_bytes())
}

/// Text as it stands in HTML, within an element or a quoted attribute.
pub(super) fn escaped(text: &str) -> String {
    let mut html = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => html.push_str("&amp;"),
            '<' => html.push_str("&lt;"),
            '>' => html.push_str("&gt;"),
            '"' => html.push_str("&quot;"),
            '\'' => html.push_str("&#39;"),
            // Signs that turn the direction of writing would let a name pose as another one.
            '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => html.push('\u{fffd}'),
            _ => html.push(character),
        }
    }
    html
}

/// A line as it is said to a terminal: what stands between two backticks is code.
fn with_code(line: &str) -> String {
    let line = escaped(line);
    let (mut html, mut rest) = (String::new(), line.as_str());
    while let Some([before, code, after]) = between_backticks(rest) {
        html.extend([before, "<code>", code, "</code>"]);
        rest = after;
    }
    html + rest
}

fn between_backticks(text: &str) -> Option<[&str; 3]> {
    let (before, rest) = text.split_once('`')?;
    let (code, after) = rest.split_once('`')?;
    Some([before, code, after])
}

fn joined<T>(items: impl IntoIterator<Item = T>, html: impl FnMut(T) -> String) -> String {
    items.into_iter().map(html).collect::<Vec<_>>().concat()
}

fn summary(story: &Story, facts: &Facts) -> String {
    let mut html = String::new();
    let mut add = |name: &str, value: &str, unit: &str| {
        // Writing to a string cannot fail.
        let _ = writeln!(html, "<div><dt>{name}</dt><dd>{value}<small>{unit}</small></dd></div>");
    };
    let total = story.series.total();
    add("scans taken in", &grouped(total.map_or(0, |total| total.scans)), "");
    add("messages skipped", &grouped(facts.skipped.values().sum()), "");
    add("points used", &grouped(total.map_or(0, |total| total.points)), "");
    if let Some(total) = total {
        add("dense voxels", &grouped(total.dense), "");
        add("clusters", &grouped(total.clusters), "");
        let mean = total.engine_ms / total.scans as f64;
        add(
            "engine, a scan",
            &format!("{mean:.1}"),
            &format!(" ms on average, slowest {:.1} ms", total.slowest_ms),
        );
    }
    if let Some((first, last)) = story.series.first.zip(story.series.columns.last()) {
        let seconds = last.stamp.seconds_since(first);
        add("recorded", &format!("{seconds:.2}"), " s");
    }
    add("replay took", &format!("{:.2}", facts.wall_seconds), " s");
    html
}

/// 1234567 as 1 234 567, with narrow spaces that do not break.
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

fn figures(figures: &[Figure]) -> String {
    let figure = |figure: &Figure| {
        format!(
            "<figure class=\"paper\"><img alt=\"{}\" src=\"data:image/svg+xml;base64,{}\"><figcaption>{}</figcaption></figure>\n",
            escaped(&figure.title),
            base64(figure.svg.as_bytes()),
            escaped(&figure.caption),
        )
    };
    joined(figures, figure)
}

fn parameters(parameters: &[(String, String)]) -> String {
    let row = |(name, value): &(String, String)| {
        format!("<tr><th scope=\"row\"><code>{}</code></th><td>{}</td></tr>\n", escaped(name), escaped(value))
    };
    joined(parameters, row)
}

fn skipped(facts: &Facts) -> String {
    if facts.points_unused.is_empty() {
        return messages_skipped(facts);
    }
    format!(
        "{}\n<p>Points that were not used: {}.</p>",
        messages_skipped(facts),
        escaped(&facts.points_unused)
    )
}

fn messages_skipped(facts: &Facts) -> String {
    if facts.skipped.is_empty() {
        return "<p>No message: every one was taken in.</p>".to_owned();
    }
    let row = |(Reason { key, sentence }, count): (&Reason, &u64)| {
        let count = grouped(*count);
        format!(
            "<tr><td class=\"number\">{count}</td><th scope=\"row\"><code>{key}</code></th><td>{sentence}</td></tr>\n"
        )
    };
    let rows = joined(&facts.skipped, row);
    format!("<table><tbody>\n{rows}</tbody></table>")
}

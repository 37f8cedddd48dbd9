//! Markdown to HTML.

use pulldown_cmark::{CowStr, Event, Options, Parser, Tag, TagEnd};

use super::book::{has_picture, href, source};

/// What is read of Markdown beyond its core.
pub const OPTIONS: Options = Options::ENABLE_TABLES.union(Options::ENABLE_STRIKETHROUGH);

/// A page of `docs/` as HTML. Links between pages lead to their addresses; headings can be linked to.
pub fn html(text: &str, path: &str) -> String {
    let mut linked = Vec::new();
    let events = headings(Parser::new_ext(text, OPTIONS).collect());
    let events = events.into_iter().filter_map(|event| match event {
        Event::Start(Tag::Link { link_type, dest_url, title, id }) => {
            let to = target(&dest_url, path);
            linked.push(to.is_some());
            Some(Event::Start(Tag::Link { link_type, dest_url: to?, title, id }))
        }
        Event::End(TagEnd::Link) => linked.pop().unwrap_or(true).then_some(event),
        Event::Start(Tag::Image { link_type, dest_url, title, id }) => {
            let dest_url = target(&dest_url, path).unwrap_or(dest_url);
            Some(Event::Start(Tag::Image { link_type, dest_url, title, id }))
        }
        // Alignment would be an inline style.
        Event::Start(Tag::Table(_)) => Some(Event::Start(Tag::Table(Vec::new()))),
        event => Some(event),
    });
    let mut html = String::new();
    pulldown_cmark::html::push_html(&mut html, events);
    // What is too wide moves in a frame of its own, by keyboard too.
    let framed = html.replace("<table>", "<div class=\"wide\" tabindex=\"0\"><table>");
    framed.replace("</table>", "</table></div>").replace("<pre>", "<pre tabindex=\"0\">")
}

/// Gives headings the names that links use: their words in small letters, with hyphens.
fn headings(events: Vec<Event>) -> Vec<Event> {
    let mut named = Vec::with_capacity(events.len());
    let mut open: Option<(usize, String)> = None;
    for event in events {
        match &event {
            Event::Start(Tag::Heading { .. }) => open = Some((named.len(), String::new())),
            Event::Text(text) | Event::Code(text) => {
                if let Some((_, words)) = &mut open {
                    words.push_str(text);
                }
            }
            Event::End(TagEnd::Heading(_)) => {
                if let Some((at, words)) = open.take()
                    && let Event::Start(Tag::Heading { id, .. }) = &mut named[at]
                {
                    *id = Some(anchor(&words).into());
                }
            }
            _ => {}
        }
        named.push(event);
    }
    named
}

/// The name of a heading for links.
pub fn anchor(words: &str) -> String {
    let kept = words.trim().chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
    kept.flat_map(char::to_lowercase).map(|c| if c == ' ' { '-' } else { c }).collect()
}

/// Where a link of the page at `path` leads to; nowhere, if it is to a file that the server does not have.
fn target(link: &str, path: &str) -> Option<CowStr<'static>> {
    if link.contains("://") || link.starts_with(['/', '#']) {
        return Some(link.to_owned().into());
    }
    let (file, anchor) = link.split_once('#').map_or((link, String::new()), |(file, a)| (file, format!("#{a}")));
    let mut parts: Vec<&str> = path.split('/').collect();
    parts.pop();
    let mut outside = 0;
    for part in file.split('/') {
        match part {
            ".." if parts.pop().is_none() => outside += 1,
            "." | ".." => {}
            part => parts.push(part),
        }
    }
    let file = parts.join("/");
    if outside == 0 && (source(&file).is_some() || has_picture(&file)) {
        return Some((href(&file) + &anchor).into());
    }
    let scene = file.strip_prefix("scenes/").and_then(|name| name.strip_suffix(".json")).filter(|_| outside == 1)?;
    Some(format!("/v1/library/{scene}").into())
}

pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_lead_to_where_pages_are_served() {
        for (link, page, expected) in [
            ("../NUMERICS.md#flow-inside-the-step", "guide/limits.md", "/docs/guide/NUMERICS#flow-inside-the-step"),
            ("guide/tutorial.md", "README.md", "/docs/guide/tutorial"),
            ("../README.md", "guide/tutorial.md", "/docs/guide/"),
            ("pictures/job.png", "x.md", "/docs/guide/pictures/job.png"),
            ("../scenes/dam-break.json", "SCENES.md", "/v1/library/dam-break"),
            ("#here", "SCENES.md", "#here"),
            ("https://mcap.dev", "SCENES.md", "https://mcap.dev"),
        ] {
            assert_eq!(target(link, page).as_deref(), Some(expected), "{link}");
        }
        assert_eq!(target("../api/openapi.json", "SCENES.md"), None);
        assert!(html("See [it](../api/x).", "x.md").contains("See it."));
    }

    #[test]
    fn headings_have_names_and_tables_no_styles() {
        let page = html("## Implicit: `newton` & co\n\n| a |\n|--:|\n| 1 |\n", "x.md");
        assert!(page.contains("<h2 id=\"implicit-newton--co\">"), "{page}");
        assert!(page.contains("<div class=\"wide\" tabindex=\"0\"><table>") && !page.contains("style"), "{page}");
    }
}

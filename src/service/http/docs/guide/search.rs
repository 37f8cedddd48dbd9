//! What the guide's search looks through: the sections of all pages, as one JSON text.

use pulldown_cmark::{Event, Parser, Tag, TagEnd};
use serde::Serialize;

use super::book::href;
use super::render::{OPTIONS, anchor};

/// A heading with the text below it.
#[derive(Debug, PartialEq, Serialize)]
pub struct Section {
    pub page: String,
    pub heading: String,
    /// Where it is on this server.
    pub href: String,
    pub text: String,
}

/// The sections of a page at `path` in `docs/`. What stands before a heading is under the page's title.
pub fn sections(title: &str, path: &str, text: &str) -> Vec<Section> {
    let section = |heading: &str, anchor: &str| Section {
        page: title.to_owned(),
        heading: heading.to_owned(),
        href: if anchor.is_empty() { href(path) } else { format!("{}#{anchor}", href(path)) },
        text: String::new(),
    };
    let mut found = vec![section(title, "")];
    let mut heading: Option<String> = None;
    for event in Parser::new_ext(text, OPTIONS) {
        match event {
            Event::Start(Tag::Heading { .. }) => heading = Some(String::new()),
            Event::End(TagEnd::Heading(_)) => {
                let words = heading.take().unwrap_or_default();
                found.push(section(&words, &anchor(&words)));
            }
            Event::Text(words) | Event::Code(words) => {
                let place = match &mut heading {
                    Some(heading) => heading,
                    None => &mut found.last_mut().expect("there is the page itself").text,
                };
                place.push_str(&words);
            }
            // Words of two lines, cells or paragraphs are two.
            Event::SoftBreak | Event::HardBreak | Event::End(_) => {
                if let (None, Some(last)) = (&heading, found.last_mut()) {
                    last.text.push(' ');
                }
            }
            _ => {}
        }
    }
    for section in &mut found {
        section.text = section.text.split_whitespace().collect::<Vec<_>>().join(" ");
    }
    if found[0].text.is_empty() {
        found.remove(0);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sections_have_their_words_and_addresses() {
        let page = "Before.\n\n# Title\n\nOf *it*\nall.\n\n## Use `cfl`\n\n| a | b |\n|--|--|\n| 1 | 2 |\n\n\
                    ```sh\nrun it\n```\n";
        let found = sections("Page", "guide/page.md", page);
        let shown: Vec<_> = found.iter().map(|s| (s.heading.as_str(), s.href.as_str(), s.text.as_str())).collect();
        assert_eq!(
            shown,
            [
                ("Page", "/docs/guide/page", "Before."),
                ("Title", "/docs/guide/page#title", "Of it all."),
                ("Use cfl", "/docs/guide/page#use-cfl", "a b 1 2 run it"),
            ]
        );
    }
}

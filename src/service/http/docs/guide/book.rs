//! The pages of the guide, their order and their addresses.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::sync::OnceLock;

use super::super::super::conditional::Version;
use super::super::super::submission::sha256_hex;
use super::render::{self, escape};
use super::search::sections;

// Paths in `docs/`, and contents.
include!(concat!(env!("OUT_DIR"), "/guide.rs"));

const FRAME: &str = include_str!("page.html");
const STYLE: &str = include_str!("style.css");
const SEARCH: &str = include_str!("search.js");

/// A line of the table of contents.
#[derive(Debug, PartialEq)]
enum Entry {
    Part(String),
    /// A page, with its path in `docs/`.
    Page {
        title: String,
        path: String,
    },
}

/// What is sent, and its version.
pub struct Bound<T> {
    pub content: T,
    pub version: Version,
}

impl<T: AsRef<[u8]>> Bound<T> {
    pub fn new(content: T) -> Self {
        let version = Version::of_tag(format!("\"{}\"", &sha256_hex(content.as_ref())[..32]));
        Self { content, version }
    }
}

/// All that the guide is made of, by its address below `/docs/guide/`.
pub struct Book {
    /// As HTML.
    pages: BTreeMap<String, Bound<String>>,
    pictures: BTreeMap<String, Bound<&'static [u8]>>,
    /// What the search looks through (JSON).
    pub index: Bound<String>,
    pub style: Bound<&'static str>,
    pub search: Bound<&'static str>,
}

impl Book {
    pub fn get() -> &'static Self {
        static BOOK: OnceLock<Book> = OnceLock::new();
        BOOK.get_or_init(Self::bind)
    }

    pub fn page(&self, address: &str) -> Option<&Bound<String>> {
        self.pages.get(address)
    }

    pub fn picture(&self, address: &str) -> Option<&Bound<&'static [u8]>> {
        self.pictures.get(address)
    }

    fn bind() -> Self {
        let contents = contents(source("SUMMARY.md").expect("the book has a table of contents"));
        let pages: Vec<(&str, &str)> = contents
            .iter()
            .filter_map(|entry| match entry {
                Entry::Page { title, path } => Some((title.as_str(), path.as_str())),
                Entry::Part(_) => None,
            })
            .collect();
        let bound = pages.iter().enumerate().map(|(n, &(title, path))| {
            let text = source(path).unwrap_or_else(|| panic!("the contents name {path}, which is not there"));
            let turn = |word: &str, to: Option<&(&str, &str)>| match to {
                Some((title, path)) => {
                    format!("<a href=\"{}\">{word}{}</a>", href(path), escape(title))
                }
                None => "<span></span>".into(),
            };
            let page = FRAME
                .replace("{title}", &escape(title))
                .replace("{contents}", &list(&contents, path))
                .replace("{before}", &turn("← ", n.checked_sub(1).and_then(|n| pages.get(n))))
                .replace("{after}", &turn("", pages.get(n + 1)))
                .replace("{page}", &render::html(text, path));
            (address(path), Bound::new(page))
        });
        let text = |path: &str| source(path).unwrap_or_default();
        let index: Vec<_> = pages.iter().flat_map(|(title, path)| sections(title, path, text(path))).collect();
        Self {
            pages: bound.collect(),
            pictures: PICTURES.iter().map(|(path, picture)| (address(path), Bound::new(*picture))).collect(),
            index: Bound::new(serde_json::to_string(&index).expect("sections are plain data")),
            style: Bound::new(STYLE),
            search: Bound::new(SEARCH),
        }
    }
}

/// The text of a page.
pub fn source(path: &str) -> Option<&'static str> {
    PAGES.iter().find(|(known, _)| *known == path).map(|(_, text)| *text)
}

pub fn has_picture(path: &str) -> bool {
    PICTURES.iter().any(|(known, _)| *known == path)
}

/// Where a file of `docs/` is served, below `/docs/guide/`.
fn address(path: &str) -> String {
    let page = path.strip_suffix(".md").unwrap_or(path);
    let page = page.strip_prefix("guide/").unwrap_or(page);
    if page == "README" { String::new() } else { page.to_owned() }
}

pub fn href(path: &str) -> String {
    format!("/docs/guide/{}", address(path))
}

/// Reads a table of contents as mdBook has it.
fn contents(summary: &str) -> Vec<Entry> {
    let entry = |line: &str| {
        let line = line.trim();
        if let Some(part) = line.strip_prefix("# ") {
            return Some(Entry::Part(part.to_owned()));
        }
        let (title, path) = line.trim_start_matches("- ").strip_prefix('[')?.strip_suffix(')')?.split_once("](")?;
        Some(Entry::Page { title: title.to_owned(), path: path.trim_start_matches("./").to_owned() })
    };
    // The first heading is that of the list.
    summary.lines().filter_map(entry).filter(|entry| *entry != Entry::Part("Summary".into())).collect()
}

fn list(contents: &[Entry], current: &str) -> String {
    let mut html = String::from("<ul>");
    for entry in contents {
        let _ = match entry {
            Entry::Part(part) => write!(html, "</ul>\n<h2>{}</h2>\n<ul>", escape(part)),
            Entry::Page { title, path } => {
                let here = if path == current { " aria-current=\"page\"" } else { "" };
                write!(html, "<li><a href=\"{}\"{here}>{}</a></li>", href(path), escape(title))
            }
        };
    }
    (html + "</ul>").replace("<ul></ul>", "")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_page_is_in_the_contents_and_every_link_leads_somewhere() {
        let book = Book::get();
        for (path, _) in PAGES.iter().filter(|(path, _)| *path != "SUMMARY.md") {
            assert!(book.page(&address(path)).is_some(), "docs/SUMMARY.md lacks {path}");
        }
        for (address, page) in &book.pages {
            let page = &page.content;
            let values = ["href=\"", "src=\""].map(|mark| page.split(mark).skip(1));
            for link in values.into_iter().flatten().filter_map(|rest| rest.split('"').next()) {
                let (target, anchor) = link.split_once('#').unwrap_or((link, ""));
                let Some(target) = target.strip_prefix("/docs/guide/") else {
                    assert!(
                        target.is_empty() && page.contains(&format!("id=\"{anchor}\""))
                            || ["http", "/dashboard/", "/v1/library/"].iter().any(|start| target.starts_with(start))
                            || target == "/"
                            || target == "/docs/",
                        "{address}: {link}"
                    );
                    continue;
                };
                if ["style.css", "search.js"].contains(&target) || book.picture(target).is_some() {
                    continue;
                }
                let found = book.page(target).unwrap_or_else(|| panic!("{address}: no page {link}"));
                assert!(anchor.is_empty() || found.content.contains(&format!("id=\"{anchor}\"")), "{address}: {link}");
            }
            assert!(!page.contains("style=\""), "{address} has a style that the policy forbids");
        }
    }

    #[test]
    fn headings_have_names_of_their_own() {
        for (address, page) in &Book::get().pages {
            let mut names: Vec<&str> =
                page.content.split(" id=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect();
            let all = names.len();
            names.sort_unstable();
            names.dedup();
            assert_eq!(names.len(), all, "{address} has a heading twice");
        }
    }

    #[test]
    fn the_search_finds_every_heading_at_its_place() {
        let book = Book::get();
        let index: serde_json::Value = serde_json::from_str(&book.index.content).unwrap();
        let sections = index.as_array().unwrap();
        for section in sections {
            let link = section["href"].as_str().unwrap().strip_prefix("/docs/guide/").unwrap();
            let (page, anchor) = link.split_once('#').unwrap_or((link, "page"));
            assert!(book.page(page).unwrap().content.contains(&format!("id=\"{anchor}\"")), "{section}");
        }
        let count =
            |page: &Bound<String>| (1..=6).map(|n| page.content.matches(&format!("<h{n} id=")).count()).sum::<usize>();
        let headings: usize = book.pages.values().map(count).sum();
        let found = sections.iter().filter(|section| section["href"].as_str().unwrap().contains('#')).count();
        assert_eq!(found, headings);
        let has = |word: &str| sections.iter().any(|section| section["text"].as_str().unwrap().contains(word));
        assert!(has("yield_stress") && has("gridfall render") && has("Coulomb"));
    }

    #[test]
    fn contents_have_parts_and_pages() {
        let read = contents("# Summary\n\n[First](guide/README.md)\n\n# Part\n\n- [Page](./a.md)\n");
        let page = |title: &str, path: &str| Entry::Page { title: title.into(), path: path.into() };
        assert_eq!(read, [page("First", "guide/README.md"), Entry::Part("Part".into()), page("Page", "a.md")]);
    }
}

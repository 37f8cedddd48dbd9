//! The page of error codes, as HTML and as Markdown, from one list.

use std::fmt::Write;

use super::super::problem::Code;
use super::advice::{self, FAILURES};
use gridfall_scene::prose::paragraph;

/// A code, its headline and what to do.
struct Entry {
    code: String,
    title: String,
    advice: &'static str,
}

fn problems() -> Vec<Entry> {
    let entry = |code: &Code| Entry {
        code: code.as_str(),
        title: format!("{} ({})", code.title(), code.status().as_u16()),
        advice: advice::of(*code),
    };
    Code::ALL.iter().map(entry).collect()
}

const PROBLEMS: &str = "The member `code` of a problem (`application/problem+json`). Its `detail` says what went wrong \
                        this time.";
const FAILED: &str = "The member `failure.code` of a job whose `status` is `failed`. Frames that were recorded before \
                      can be downloaded.";
const SCENES: &str = "The members of `faults` have codes too, such as `not_positive` or `unknown_field`. Each comes \
                      with the place, the reason and the remedy in words.";

/// The page as `docs/ERRORS.md` has it.
pub fn markdown() -> String {
    let mut text = String::from("# Error codes\n\nMade by `gridfall schema errors`.\n\n## Answers\n");
    text += &paragraph(PROBLEMS);
    for Entry { code, title, advice } in problems() {
        text += &format!("\n### {code}\n{}", paragraph(&format!("{title}. {advice}")));
    }
    text += &format!("\n## Faults of scenes\n{}", paragraph(SCENES));
    text += &format!("\n## Jobs that failed\n{}", paragraph(FAILED));
    for (code, advice) in FAILURES {
        text += &format!("\n### failure: {code}\n{}", paragraph(advice));
    }
    text
}

/// The page as `/docs/errors` shows it. Problems' `type` leads to the entries.
pub fn html() -> String {
    let mut entries = String::new();
    for Entry { code, title, advice } in problems() {
        let _ = write!(entries, "<dt id=\"{code}\"><code>{code}</code> {title}</dt>\n<dd>{}</dd>\n", inline(advice));
    }
    let mut failures = String::new();
    for (code, advice) in FAILURES {
        let _ = write!(failures, "<dt id=\"failure-{code}\"><code>{code}</code></dt>\n<dd>{}</dd>\n", inline(advice));
    }
    include_str!("errors.html")
        .replace("{problems}", &inline(PROBLEMS))
        .replace("{entries}", &entries)
        .replace("{scenes}", &inline(SCENES))
        .replace("{failed}", &inline(FAILED))
        .replace("{failures}", &failures)
}

/// Text with code between backticks, as HTML.
fn inline(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;");
    let part = |(n, part): (usize, &str)| if n % 2 == 1 { format!("<code>{part}</code>") } else { part.to_owned() };
    text.split('`').enumerate().map(part).collect()
}

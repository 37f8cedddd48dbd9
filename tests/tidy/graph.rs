//! Which module uses which, read from the syntax of each file without its unit tests and comments.

use std::collections::{BTreeMap, BTreeSet};

use proc_macro2::{TokenStream, TokenTree};
use quote::ToTokens;

use super::Source;
use super::layers::Layer;

/// A crate of the workspace: the folder of its sources, and its modules from the lowest layer up.
pub struct Crate<'a> {
    pub folder: &'a str,
    pub layers: &'a [Layer],
}

/// Faults of a crate's files against its layers: modules without a layer, uses that no layer
/// permits, permissions that nobody uses, and cycles.
pub fn check(of: &Crate, files: &[Source]) -> Vec<String> {
    let mut faults = circles(of);
    let mut used: BTreeSet<(&str, &str)> = BTreeSet::new();
    for file in files.iter().filter(|file| !is_test(&file.path)) {
        let path = module(of.folder, &file.path);
        let Some(own) = layer(of, &path) else {
            if !is_facade(of, &path) {
                faults.push(format!("{}: the module {} has no layer", file.path, path.join("::")));
            }
            continue;
        };
        for target in uses(&file.text, &path) {
            let target = layer(of, &target).map_or("", |layer| layer.0);
            if target == own.0 {
                continue;
            }
            match own.1.iter().find(|allowed| **allowed == target) {
                Some(allowed) => drop(used.insert((own.0, allowed))),
                None if target.is_empty() => faults.push(format!("{} uses the crate's root", file.path)),
                None => faults.push(format!("{} uses {target}, which {} may not", file.path, own.0)),
            }
        }
    }
    for (name, allowed) in of.layers {
        let unused = allowed.iter().filter(|allowed| !used.contains(&(*name, **allowed)));
        faults.extend(unused.map(|allowed| format!("{}: {name} may use {allowed}, and does not", of.folder)));
    }
    faults
}

/// Layers may use only those before them in the list.
fn circles(of: &Crate) -> Vec<String> {
    let mut faults = Vec::new();
    for (n, (name, allowed)) in of.layers.iter().enumerate() {
        let lower: Vec<&str> = of.layers[..n].iter().map(|layer| layer.0).collect();
        let wrong = allowed.iter().filter(|other| !lower.contains(other));
        faults.extend(wrong.map(|other| format!("{}: {name} may use {other}, which does not lie below it", of.folder)));
    }
    faults
}

/// The layer of a module or item: the one with the longest matching path prefix.
fn layer<'a>(of: &Crate<'a>, path: &[String]) -> Option<&'a Layer> {
    let begins = |layer: &&Layer| {
        let parts: Vec<&str> = layer.0.split("::").collect();
        path.len() >= parts.len() && parts.iter().zip(path).all(|(a, b)| a == b)
    };
    of.layers.iter().filter(begins).max_by_key(|layer| layer.0.len())
}

/// Whether a module only contains others that have layers.
fn is_facade(of: &Crate, path: &[String]) -> bool {
    let path = path.join("::");
    path.is_empty() || of.layers.iter().any(|(name, _)| name.starts_with(&format!("{path}::")))
}

/// Whether a file contains unit tests only.
fn is_test(path: &str) -> bool {
    let name = path.rsplit('/').next().unwrap_or_default();
    name.ends_with("tests.rs") || name == "fixture.rs" || path.contains("/tests/") || name == "build.rs"
}

/// The path of a file's module in its crate.
fn module(folder: &str, path: &str) -> Vec<String> {
    let inside = path.strip_prefix(folder).unwrap().trim_start_matches('/').trim_end_matches(".rs");
    let mut parts: Vec<String> = inside.split('/').map(String::from).collect();
    if parts.last().is_some_and(|last| ["mod", "lib", "main"].contains(&last.as_str())) {
        parts.pop();
    }
    parts
}

/// Paths within the crate that a file names, from the crate's root; `own` is its module.
fn uses(text: &str, own: &[String]) -> Vec<Vec<String>> {
    let mut file = syn::parse_file(text).expect("the compiler has read it");
    drop_tests(&mut file.items);
    let mut found = BTreeSet::new();
    walk(file.to_token_stream(), own, &mut found);
    found.into_iter().collect()
}

/// Removes what is compiled for tests only.
fn drop_tests(items: &mut Vec<syn::Item>) {
    let is_test = |attributes: &[syn::Attribute]| {
        attributes.iter().any(|a| a.path().is_ident("cfg") && a.to_token_stream().to_string().contains("test"))
    };
    items.retain(|item| match item {
        syn::Item::Mod(item) => !is_test(&item.attrs),
        syn::Item::Use(item) => !is_test(&item.attrs),
        syn::Item::Fn(item) => !is_test(&item.attrs),
        syn::Item::Impl(item) => !is_test(&item.attrs),
        _ => true,
    });
    for item in items {
        if let syn::Item::Mod(syn::ItemMod { content: Some((_, inner)), .. }) = item {
            drop_tests(inner);
        }
    }
}

/// Collects `crate::…` and `super::…` paths, with the trees of `use`, from tokens.
fn walk(tokens: TokenStream, own: &[String], found: &mut BTreeSet<Vec<String>>) {
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    let mut at = 0;
    while at < tokens.len() {
        match &tokens[at] {
            TokenTree::Group(group) => walk(group.stream(), own, found),
            TokenTree::Ident(name) if name == "crate" || name == "super" => {
                let mut base = if name == "crate" { Vec::new() } else { parent(own) };
                // `pub(super)` and `pub(crate)` name nothing.
                at = path(&tokens, at + 1, &mut base, own, found);
                continue;
            }
            _ => {}
        }
        at += 1;
    }
}

fn parent(module: &[String]) -> Vec<String> {
    module[..module.len().saturating_sub(1)].to_vec()
}

/// Follows `::a::b` or `::{a, b::c}` from `at`. Returns where it ends.
fn path(
    tokens: &[TokenTree],
    mut at: usize,
    base: &mut Vec<String>,
    own: &[String],
    found: &mut BTreeSet<Vec<String>>,
) -> usize {
    let colon = |at: usize| matches!(tokens.get(at), Some(TokenTree::Punct(p)) if p.as_char() == ':');
    let start = at;
    while colon(at) && colon(at + 1) {
        match tokens.get(at + 2) {
            Some(TokenTree::Ident(name)) if name == "super" => *base = parent(base),
            Some(TokenTree::Ident(name)) => base.push(name.to_string()),
            Some(TokenTree::Group(group)) => {
                tree(group.stream(), base, own, found);
                return at + 3;
            }
            _ => break,
        }
        at += 3;
    }
    if at > start {
        found.insert(base.clone());
    }
    at
}

/// The branches of a tree of `use`, each below `base`.
fn tree(tokens: TokenStream, base: &[String], own: &[String], found: &mut BTreeSet<Vec<String>>) {
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    for branch in tokens.split(|token| matches!(token, TokenTree::Punct(p) if p.as_char() == ',')) {
        let mut base = base.to_vec();
        match branch.first() {
            Some(TokenTree::Ident(name)) if name == "self" => drop(found.insert(base)),
            Some(TokenTree::Ident(name)) => {
                base.push(name.to_string());
                if path(branch, 1, &mut base, own, found) == 1 {
                    found.insert(base);
                }
            }
            Some(TokenTree::Group(group)) => tree(group.stream(), &base, own, found),
            _ => {}
        }
    }
}

/// Which of the given crates a file names, in code outside tests. A crate's name is followed by
/// `::`.
pub fn names<'a>(text: &str, crates: &[&'a str]) -> BTreeSet<&'a str> {
    fn collect<'a>(tokens: TokenStream, crates: &[&'a str], found: &mut BTreeSet<&'a str>) {
        let tokens: Vec<TokenTree> = tokens.into_iter().collect();
        let punct = |at: usize| matches!(tokens.get(at), Some(TokenTree::Punct(p)) if p.as_char() == ':');
        for (at, token) in tokens.iter().enumerate() {
            match token {
                TokenTree::Group(group) => collect(group.stream(), crates, found),
                TokenTree::Ident(name) => {
                    let own = at == 0 || !punct(at - 1);
                    let follows = punct(at + 1) && punct(at + 2);
                    let whole = at > 0 && matches!(&tokens[at - 1], TokenTree::Ident(word) if word == "use");
                    if own && (follows || whole) {
                        found.extend(crates.iter().find(|known| name == *known));
                    }
                }
                _ => {}
            }
        }
    }
    let mut file = syn::parse_file(text).expect("the compiler has read it");
    drop_tests(&mut file.items);
    let mut found = BTreeSet::new();
    collect(file.to_token_stream(), crates, &mut found);
    found
}

/// The dependency names in a manifest, by table.
pub fn manifest(text: &str) -> BTreeMap<String, Vec<String>> {
    let mut tables = BTreeMap::new();
    let mut table = String::new();
    for line in text.lines() {
        if let Some(name) = line.strip_prefix('[') {
            table = name.trim_end_matches(']').to_string();
        } else if let Some((key, _)) = line.split_once('=') {
            let name = key.trim().split('.').next().unwrap().to_string();
            tables.entry(table.clone()).or_insert_with(Vec::new).push(name);
        }
    }
    tables
}

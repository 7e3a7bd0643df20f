//! Which file of a crate takes names from which: `use` declarations and paths in the code, followed through
//! re-exports to the file that defines the name. Modules under `#[cfg(test)]` are left out: what a unit test needs ties
//! no file to another. Macros are not expanded, but their arguments are read.

use std::collections::{BTreeMap, BTreeSet};

use proc_macro2::{Delimiter, TokenStream, TokenTree};

/// A crate's source files: path below `src` (such as `report/text.rs`) and text. The root is `lib.rs`.
pub(crate) type Files = BTreeMap<String, String>;

/// Files that take names from each other, directly or through others, with the names that tie them.
#[derive(Debug, PartialEq)]
pub(crate) struct Circle {
    pub(crate) files: Vec<String>,
    /// `user <- definer: name`.
    pub(crate) ties: Vec<String>,
}

/// Every circle of a crate. A child module's use of a file of its own ancestors does not count.
pub(crate) fn circles(files: &Files) -> Vec<Circle> {
    let edges = Crate::read(files).edges();
    let reached: BTreeMap<&str, BTreeSet<&str>> = (files.keys())
        .map(|file| (file.as_str(), reached(&edges, file)))
        .collect();
    let mut circles = Vec::new();
    let mut seen = BTreeSet::new();
    for (file, ahead) in &reached {
        if !ahead.contains(file) || seen.contains(file) {
            continue;
        }
        let circle: BTreeSet<&str> = (ahead.iter().copied())
            .filter(|other| reached[other].contains(file))
            .collect();
        let mut ties: BTreeMap<String, Vec<&str>> = BTreeMap::new();
        for edge in &edges {
            if circle.contains(edge.user.as_str()) && circle.contains(edge.definer.as_str()) {
                let pair = format!("{} <- {}", edge.definer, edge.user);
                ties.entry(pair).or_default().push(&edge.name);
            }
        }
        circles.push(Circle {
            files: circle.iter().map(|&file| file.to_owned()).collect(),
            ties: (ties.iter())
                .map(|(pair, names)| format!("{pair}: {}", names.join(", ")))
                .collect(),
        });
        seen.extend(circle);
    }
    circles
}

/// Files that can be reached from one over one edge or more.
fn reached<'a>(edges: &'a BTreeSet<Edge>, from: &str) -> BTreeSet<&'a str> {
    let mut reached = BTreeSet::new();
    let mut waiting = vec![from];
    while let Some(user) = waiting.pop() {
        for edge in edges.iter().filter(|edge| edge.user == user) {
            if reached.insert(edge.definer.as_str()) {
                waiting.push(&edge.definer);
            }
        }
    }
    reached
}

/// A file takes a name from another one.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Edge {
    user: String,
    definer: String,
    name: String,
}

/// Segments of a path, as written.
type Path = Vec<String>;

#[derive(Debug, Default)]
struct Module {
    file: String,
    parent: Option<usize>,
    children: BTreeMap<String, usize>,
    /// What `use` binds: a name and its path.
    bound: BTreeMap<String, Path>,
    /// Modules whose names are all imported.
    globs: Vec<Path>,
    /// Names of its own items.
    items: BTreeSet<String>,
    /// Paths of the code that have more than one segment.
    mentions: BTreeSet<Path>,
}

struct Crate {
    modules: Vec<Module>,
    /// Module path of every file.
    places: BTreeMap<String, Path>,
}

/// Most re-exports that a name is followed through.
const MOST_STEPS: usize = 6;

impl Crate {
    fn read(files: &Files) -> Self {
        let mut all = Self {
            modules: Vec::new(),
            places: BTreeMap::new(),
        };
        all.read_file(files, "lib.rs", vec![], None);
        all
    }

    fn read_file(&mut self, files: &Files, file: &str, path: Path, parent: Option<usize>) -> usize {
        let text = files.get(file);
        let text = text.unwrap_or_else(|| panic!("{file} is declared, but is not there"));
        let tokens: TokenStream = text
            .parse()
            .unwrap_or_else(|error| panic!("{file}: {error}"));
        self.places.insert(file.to_owned(), path.clone());
        self.read_module(files, file, (path, parent), tokens)
    }

    fn read_module(
        &mut self,
        files: &Files,
        file: &str,
        (path, parent): (Path, Option<usize>),
        tokens: TokenStream,
    ) -> usize {
        let index = self.modules.len();
        self.modules.push(Module {
            file: file.to_owned(),
            parent,
            ..Module::default()
        });
        let tokens: Vec<TokenTree> = tokens.into_iter().collect();
        let mut at = 0;
        let mut is_test = false;
        while at < tokens.len() {
            let (word, next) = (word(&tokens, at), word(&tokens, at + 1));
            match (word.as_deref(), next, tokens.get(at + 2)) {
                (Some("mod"), Some(_), Some(_)) if is_test => {
                    is_test = false;
                    at += 3;
                }
                (Some("mod"), Some(name), Some(TokenTree::Group(body))) => {
                    let place = (
                        [&path[..], std::slice::from_ref(&name)].concat(),
                        Some(index),
                    );
                    let child = self.read_module(files, file, place, body.stream());
                    self.modules[index].children.insert(name, child);
                    at += 3;
                }
                (Some("mod"), Some(name), Some(_)) => {
                    let inside = [&path[..], std::slice::from_ref(&name)].concat();
                    let child_file = format!("{}.rs", inside.join("/"));
                    let child = self.read_file(files, &child_file, inside, Some(index));
                    self.modules[index].children.insert(name, child);
                    at += 3;
                }
                (Some(keyword), Some(name), _) if DEFINES.contains(&keyword) => {
                    self.modules[index].items.insert(name);
                    is_test = false;
                    at += 1;
                }
                _ => {
                    is_test |= tokens[at].to_string() == "[cfg (test)]";
                    at += 1;
                }
            }
        }
        self.modules[index].scan(&tokens);
        index
    }

    fn edges(&self) -> BTreeSet<Edge> {
        let mut edges = BTreeSet::new();
        for (index, module) in self.modules.iter().enumerate() {
            let globs = module.globs.iter().filter_map(|path| {
                let found = self.module_of(index, path, 0)?;
                Some((self.modules[found].file.clone(), path))
            });
            let mentioned = module.bound.values().chain(&module.mentions);
            // A module's own name ties to nothing: what is taken through it is a path too.
            let items = mentioned.filter(|path| self.module_of(index, path, 0).is_none());
            let named = items.filter_map(|path| Some((self.definer(index, path, 0)?, path)));
            for (definer, path) in named.chain(globs) {
                let is_own = definer == module.file;
                let is_ancestor = self.places[&module.file].starts_with(&self.places[&definer]);
                if !is_own && !is_ancestor {
                    edges.insert(Edge {
                        user: module.file.clone(),
                        definer,
                        name: path.join("::"),
                    });
                }
            }
        }
        edges
    }

    /// The file that defines what a path names in a module; `None` where that is another crate's.
    fn definer(&self, from: usize, path: &[String], steps: usize) -> Option<String> {
        let (start, rest) = self.start(from, path, steps)?;
        self.defined_in(start, rest, steps)
            // What a macro makes, an associated item and the like belong to the last module of the path.
            .or_else(|| Some(self.modules[start].file.clone()))
    }

    /// The module that the first segments of a path lead to, and the segments behind them.
    fn start<'a>(
        &self,
        from: usize,
        path: &'a [String],
        steps: usize,
    ) -> Option<(usize, &'a [String])> {
        let (first, rest) = path.split_first()?;
        if steps > MOST_STEPS {
            return None;
        }
        let mut at = match first.as_str() {
            "crate" => 0,
            "self" => from,
            "super" => self.modules[from].parent?,
            _ => {
                let is_here = self.modules[from].children.contains_key(first);
                let is_bound = self.modules[from].bound.contains_key(first);
                let mut globs = self.modules[from].globs.iter();
                return if is_here || is_bound {
                    Some((from, path))
                } else {
                    globs.find_map(|glob| {
                        let module = self.module_of(from, glob, steps + 1)?;
                        self.defined_in(module, path, steps + 1)?;
                        Some((module, path))
                    })
                };
            }
        };
        let mut rest = rest;
        while let Some((first, behind)) = rest.split_first() {
            if first != "super" {
                break;
            }
            (at, rest) = (self.modules[at].parent?, behind);
        }
        while let Some((first, behind)) = rest.split_first() {
            let Some(&child) = self.modules[at].children.get(first) else {
                break;
            };
            (at, rest) = (child, behind);
        }
        Some((at, rest))
    }

    /// The file of what a module calls by this path; `None` where it has no such name.
    fn defined_in(&self, at: usize, path: &[String], steps: usize) -> Option<String> {
        let module = &self.modules[at];
        let Some((first, rest)) = path.split_first() else {
            return Some(module.file.clone());
        };
        if steps > MOST_STEPS {
            return None;
        }
        if let Some(&child) = module.children.get(first) {
            return (self.defined_in(child, rest, steps))
                .or_else(|| Some(self.modules[child].file.clone()));
        }
        if module.items.contains(first) {
            return Some(module.file.clone());
        }
        if let Some(bound) = module.bound.get(first) {
            return self.definer(at, &[bound, rest].concat(), steps + 1);
        }
        let mut globs = module.globs.iter();
        globs.find_map(|glob| {
            let other = self.module_of(at, glob, steps + 1)?;
            self.defined_in(other, path, steps + 1)
        })
    }

    /// The module that a path names, in this crate.
    fn module_of(&self, from: usize, path: &[String], steps: usize) -> Option<usize> {
        let (at, rest) = self.start(from, path, steps)?;
        let Some((first, behind)) = rest.split_first() else {
            return Some(at);
        };
        if let Some(&child) = self.modules[at].children.get(first) {
            return self.module_of(child, &[&["self".to_owned()], behind].concat(), steps);
        }
        let bound = self.modules[at].bound.get(first)?;
        let whole = [bound, behind].concat();
        self.module_of(at, &whole, steps + 1)
    }
}

/// Keywords whose next word is the name of an item.
const DEFINES: [&str; 8] = [
    "fn", "struct", "enum", "union", "trait", "type", "const", "static",
];

fn word(tokens: &[TokenTree], at: usize) -> Option<String> {
    match tokens.get(at) {
        Some(TokenTree::Ident(word)) => Some(word.to_string()),
        _ => None,
    }
}

fn is_punct(tokens: &[TokenTree], at: usize, sign: char) -> bool {
    matches!(tokens.get(at), Some(TokenTree::Punct(punct)) if punct.as_char() == sign)
}

/// Whether `::` stands here.
fn is_colons(tokens: &[TokenTree], at: usize) -> bool {
    is_punct(tokens, at, ':') && is_punct(tokens, at + 1, ':')
}

/// The words from here on that `::` joins, and where they end.
fn path(tokens: &[TokenTree], mut at: usize) -> (Path, usize) {
    let mut path: Path = word(tokens, at).into_iter().collect();
    at += path.len();
    while is_colons(tokens, at)
        && let Some(next) = word(tokens, at + 2)
    {
        path.push(next);
        at += 3;
    }
    (path, at)
}

impl Module {
    /// Takes in every `use` and every path, at any depth but in modules within.
    fn scan(&mut self, tokens: &[TokenTree]) {
        let mut at = 0;
        while at < tokens.len() {
            match &tokens[at] {
                TokenTree::Ident(word) if *word == "use" => {
                    at = self.take_use(&[], tokens, at + 1);
                }
                TokenTree::Ident(keyword) if *keyword == "mod" => {
                    let has_body = matches!(tokens.get(at + 2), Some(TokenTree::Group(_)));
                    at += if has_body { 3 } else { 1 };
                }
                TokenTree::Ident(_) => {
                    let (path, end) = path(tokens, at);
                    // `<T as Trait>::name` begins with no word.
                    let goes_on = at >= 2 && is_colons(tokens, at - 2);
                    if path.len() > 1 && !goes_on {
                        self.mentions.insert(path);
                    }
                    at = end;
                }
                TokenTree::Group(group) => {
                    let inside: Vec<TokenTree> = group.stream().into_iter().collect();
                    self.scan(&inside);
                    at += 1;
                }
                _ => at += 1,
            }
        }
    }

    /// Takes in one tree of a `use`, which begins here behind `before`; returns where it ends.
    fn take_use(&mut self, before: &[String], tokens: &[TokenTree], at: usize) -> usize {
        let (written, mut end) = path(tokens, at);
        let mut whole = [before, &written].concat();
        let behind = if is_colons(tokens, end) { end + 2 } else { end };
        if let Some(TokenTree::Group(group)) = tokens.get(behind)
            && group.delimiter() == Delimiter::Brace
        {
            let inside: Vec<TokenTree> = group.stream().into_iter().collect();
            let mut next = 0;
            while next < inside.len() {
                next = self.take_use(&whole, &inside, next) + 1;
            }
            return behind + 1;
        }
        if is_punct(tokens, behind, '*') {
            self.globs.push(whole);
            return behind + 1;
        }
        if whole.len() > 1 && whole.last().is_some_and(|last| last == "self") {
            whole.pop();
        }
        let mut name = whole.last().cloned();
        if word(tokens, end).as_deref() == Some("as") {
            name = word(tokens, end + 1);
            end += 2;
        }
        match name.as_deref() {
            Some("_") => _ = self.mentions.insert(whole),
            Some(name) => _ = self.bound.insert(name.to_owned(), whole),
            None => {}
        }
        end
    }
}

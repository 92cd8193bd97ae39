//! The dependency graph of the files of a package, and its cycles.
//!
//! A file depends on another one when a path in its code (`crate::`, `super::`, `self::`, a child's name) resolves to an item there.
//! `mod child;` is no dependency. A re-exported item (`pub use`) counts as being where it is defined, so a facade closes no cycle; but a
//! facade that defines an item which its children use, and that uses the children, does.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::rust::{Token, closing, code_of, tokens};

/// A module that has its own file.
struct Module {
    file: PathBuf,
    parent: Option<usize>,
    children: BTreeMap<String, usize>,
    /// Every path in the file, each with the number of inline modules around it.
    paths: Vec<(usize, Vec<String>)>,
    /// Names that a `use` makes available to other modules, at least to children: the name and its path.
    exports: BTreeMap<String, Vec<String>>,
}

/// The modules of one target: a library, a program, a test.
pub struct Modules(Vec<Module>);

impl Modules {
    /// Reads the target whose root is `root`, with every file that it declares.
    pub fn read(root: &Path) -> Modules {
        let mut modules = Modules(Vec::new());
        modules.add(root, None, true);
        modules
    }

    fn add(&mut self, file: &Path, parent: Option<usize>, is_root: bool) -> usize {
        let code = code_of(&std::fs::read_to_string(file).unwrap_or_default());
        let tokens = without_tests(&tokens(&code));
        let own = self.0.len();
        let (paths, exports) = paths_and_exports(&tokens);
        self.0.push(Module {
            file: file.to_owned(),
            parent,
            children: BTreeMap::new(),
            paths,
            exports,
        });
        let folder = file.parent().unwrap_or(Path::new("."));
        let child_folder = if is_root || file.ends_with("mod.rs") {
            folder.to_owned()
        } else {
            file.with_extension("")
        };
        for three in tokens.windows(3) {
            if three[0].text != "mod" || three[2].text != ";" {
                continue;
            }
            let name = &three[1].text;
            let places = [
                child_folder.join(format!("{name}.rs")),
                child_folder.join(name).join("mod.rs"),
            ];
            // A module with another path belongs to several targets, and is read where its path leads by default.
            if let Some(place) = places.iter().find(|place| place.exists()) {
                let child = self.add(place, Some(own), false);
                self.0[own].children.insert(name.clone(), child);
            }
        }
        own
    }

    /// The file to which a path in `from`, within `inner` inline modules, resolves.
    fn resolve(&self, from: usize, inner: usize, path: &[String], depth: usize) -> Option<usize> {
        let mut rest = path;
        let mut at = from;
        match path.first()?.as_str() {
            "crate" => (at, rest) = (0, &path[1..]),
            "self" => rest = &path[1..],
            "super" => {
                // Paths that only leave inline modules stay in the file.
                let mut outwards = 0;
                while rest.first().is_some_and(|one| one == "super") {
                    (outwards, rest) = (outwards + 1, &rest[1..]);
                }
                for _ in inner..outwards {
                    at = self.0[at].parent?;
                }
            }
            first if self.0[from].children.contains_key(first) && path.len() > 1 => {}
            _ => return None,
        }
        while let Some(&child) = rest.first().and_then(|name| self.0[at].children.get(name)) {
            (at, rest) = (child, &rest[1..]);
        }
        let exported = rest.first().and_then(|name| self.0[at].exports.get(name));
        match exported {
            Some(exported) if depth < 8 => self.resolve(at, 0, exported, depth + 1),
            _ => Some(at),
        }
    }

    /// Every cycle: files each of which depends on the others, through others of them or directly.
    pub fn cycles(&self) -> Vec<Vec<&Path>> {
        let uses: Vec<BTreeSet<usize>> = (self.0.iter().enumerate())
            .map(|(own, module)| {
                let ends = module
                    .paths
                    .iter()
                    .filter_map(|(inner, path)| self.resolve(own, *inner, path, 0));
                ends.filter(|&end| end != own).collect()
            })
            .collect();
        let reached: Vec<BTreeSet<usize>> = (0..self.0.len()).map(|from| reachable(&uses, from)).collect();
        let mut cycles: Vec<Vec<&Path>> = Vec::new();
        let mut seen = BTreeSet::new();
        for one in 0..self.0.len() {
            let cycle: Vec<usize> = (reached[one].iter().copied())
                .filter(|&other| reached[other].contains(&one))
                .collect();
            if cycle.len() > 1 && seen.insert(cycle.clone()) {
                cycles.push(cycle.iter().map(|&module| self.0[module].file.as_path()).collect());
            }
        }
        cycles
    }

    /// The items of a cycle's files that the others use, to see where to cut.
    pub fn uses_within(&self, cycle: &[&Path]) -> Vec<(&Path, &Path, String)> {
        let mut found = Vec::new();
        for (own, module) in self.0.iter().enumerate() {
            for (inner, path) in &module.paths {
                let Some(end) = self.resolve(own, *inner, path, 0).filter(|&end| end != own) else {
                    continue;
                };
                let (from, to) = (module.file.as_path(), self.0[end].file.as_path());
                if cycle.contains(&from) && cycle.contains(&to) {
                    found.push((from, to, path.join("::")));
                }
            }
        }
        found.sort();
        found.dedup();
        found
    }
}

/// All files reachable from `from`; `from` itself only when it lies on a cycle.
fn reachable(uses: &[BTreeSet<usize>], from: usize) -> BTreeSet<usize> {
    let mut reached = BTreeSet::new();
    let mut next: Vec<usize> = uses[from].iter().copied().collect();
    while let Some(one) = next.pop() {
        if reached.insert(one) {
            next.extend(&uses[one]);
        }
    }
    reached
}

/// The tokens without the items marked `#[cfg(test)]`.
fn without_tests(tokens: &[Token]) -> Vec<Token> {
    const MARK: [&str; 7] = ["#", "[", "cfg", "(", "test", ")", "]"];
    let mut kept = Vec::new();
    let mut at = 0;
    while at < tokens.len() {
        let marked = tokens[at..]
            .iter()
            .map(|token| token.text.as_str())
            .take(MARK.len())
            .eq(MARK);
        if !marked {
            kept.push(tokens[at].clone());
            at += 1;
            continue;
        }
        let end = (at..tokens.len()).find(|&end| matches!(tokens[end].text.as_str(), "{" | ";"));
        at = match end {
            Some(open) if tokens[open].text == "{" => closing(tokens, open) + 1,
            Some(semicolon) => semicolon + 1,
            None => tokens.len(),
        };
    }
    kept
}

type PathsAndExports = (Vec<(usize, Vec<String>)>, BTreeMap<String, Vec<String>>);

/// The paths in a file's code, and the names that its `use` items make available, also to its children.
fn paths_and_exports(tokens: &[Token]) -> PathsAndExports {
    let (mut paths, mut exports) = (Vec::new(), BTreeMap::new());
    // The end of each inline module.
    let mut inner: Vec<usize> = Vec::new();
    let mut at = 0;
    while at < tokens.len() {
        inner.retain(|&end| end > at);
        let text = tokens[at].text.as_str();
        if text == "mod" && tokens.get(at + 2).is_some_and(|token| token.text == "{") {
            inner.push(closing(tokens, at + 2));
            at += 3;
        } else if text == "use" {
            let end = (at..tokens.len())
                .find(|&end| tokens[end].text == ";")
                .unwrap_or(tokens.len());
            for (name, path) in use_paths(&tokens[at + 1..end]) {
                if inner.is_empty() {
                    exports.insert(name, path.clone());
                }
                paths.push((inner.len(), path));
            }
            at = end;
        } else if is_word(text) && (at == 0 || tokens[at - 1].text != "::") {
            let mut path = vec![text.to_owned()];
            while tokens.get(at + 1).is_some_and(|next| next.text == "::")
                && tokens.get(at + 2).is_some_and(|next| is_word(&next.text))
            {
                path.push(tokens[at + 2].text.clone());
                at += 2;
            }
            // `pub(in crate::here)` and `pub(super)` state visibility, and are no dependency.
            let restricts = at > 1 && tokens.get(at + 1).is_some_and(|next| next.text == ")") && {
                let begin = at + 1 - (2 * path.len() - 1);
                let before = |back: usize| begin.checked_sub(back).map(|before| tokens[before].text.as_str());
                (before(1) == Some("(") && before(2) == Some("pub"))
                    || (before(1) == Some("in") && before(3) == Some("pub"))
            };
            if path.len() > 1 && !restricts {
                paths.push((inner.len(), path));
            }
            at += 1;
        } else {
            at += 1;
        }
    }
    (paths, exports)
}

fn is_word(text: &str) -> bool {
    text.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

/// The names that a `use` introduces, each with its path.
fn use_paths(tokens: &[Token]) -> Vec<(String, Vec<String>)> {
    let mut found = Vec::new();
    let mut prefix: Vec<String> = Vec::new();
    let mut at = 0;
    while at < tokens.len() {
        match tokens[at].text.as_str() {
            "{" => {
                let end = closing(tokens, at);
                let (mut begin, mut depth) = (at + 1, 0);
                for here in at + 1..=end {
                    match tokens[here].text.as_str() {
                        "{" => depth += 1,
                        "}" if here < end => depth -= 1,
                        _ => {}
                    }
                    if here == end || (depth == 0 && tokens[here].text == ",") {
                        for (name, path) in use_paths(&tokens[begin..here]) {
                            found.push((name, [prefix.clone(), path].concat()));
                        }
                        begin = here + 1;
                    }
                }
                return found;
            }
            "as" => {
                let name = tokens.get(at + 1).map_or(String::new(), |token| token.text.clone());
                return vec![(name, prefix)];
            }
            "*" => return vec![("*".to_owned(), prefix)],
            "::" => {}
            // `path::{self}` is the path.
            "self" if at == 0 && tokens.len() == 1 => return vec![(String::new(), Vec::new())],
            word => prefix.push(word.to_owned()),
        }
        at += 1;
    }
    if prefix.is_empty() {
        return Vec::new();
    }
    vec![(prefix.last().cloned().unwrap_or_default(), prefix)]
}

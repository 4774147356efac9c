//! The crate is built in layers: no file imports from a higher layer, and no files import each other in a circle. Both
//! are read off the `use` lines; tests inside the files may import what they like.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::Path,
};

/// The modules of the crate from the ground up.
const LAYERS: [&str; 18] = [
    "types",
    "numeric",
    "later",
    "about",
    "independence_tests",
    "transfer_entropy",
    "methods",
    "model",
    "settings",
    "evidence",
    "draw",
    "analysis",
    "confidence",
    "changes",
    "rolling",
    "levels",
    "effort",
    "choice",
];

/// A module as the names on the way to it; the crate itself has none.
type Module = Vec<String>;

/// One file: what it imports, and what it passes on to those who import from it (name and path).
#[derive(Default)]
struct File {
    imports: Vec<Vec<String>>,
    passed_on: Vec<Vec<String>>,
    /// Code outside `use` lines that names a module of the crate.
    inline: Vec<String>,
}

/// The files of a folder and of those below it, by module; modules that only tests have are left out.
fn read(folder: &Path, module: &Module, files: &mut BTreeMap<Module, File>, tests: &mut BTreeSet<Module>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let stem = path.file_stem().unwrap().to_str().unwrap().to_owned();
        let child = || module.iter().cloned().chain([stem.clone()]).collect::<Module>();
        if path.is_dir() {
            read(&path, &child(), files, tests);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let module = if stem == "mod" || stem == "lib" { module.clone() } else { child() };
            files.insert(module.clone(), parse(&fs::read_to_string(&path).unwrap(), &module, tests));
        }
    }
}

fn parse(text: &str, module: &Module, tests: &mut BTreeSet<Module>) -> File {
    let mut file = File::default();
    let mut lines = text.lines().map(|line| line.split("//").next().unwrap_or_default().trim());
    while let Some(line) = lines.next() {
        if line == "#[cfg(test)]" {
            match lines.next().unwrap().strip_prefix("mod ") {
                // The tests at the end of a file.
                Some("tests {") => break,
                Some(name) => {
                    tests.insert(module.iter().cloned().chain([name.trim_end_matches(';').into()]).collect());
                }
                None => {}
            }
        } else if let Some((visibility, start)) = use_line(line) {
            let mut tree = start.to_owned();
            while !tree.ends_with(';') {
                tree += lines.next().unwrap();
            }
            let leaves = leaves(tree.trim_end_matches(';'));
            if visibility { file.passed_on.extend(leaves) } else { file.imports.extend(leaves) }
        // A macro's `$crate` is for whoever uses it.
        } else if line.replace("$crate::", "").contains("crate::") || line.contains("super::") {
            file.inline.push(line.to_owned());
        }
    }
    file
}

/// Whether a `use` line has a visibility, and what stands behind its `use`.
fn use_line(line: &str) -> Option<(bool, &str)> {
    match line.split_once("use ")? {
        ("", tree) => Some((false, tree)),
        (before, tree) => (before.starts_with("pub") && before.ends_with(' ')).then_some((true, tree)),
    }
}

/// `a::{b, c::d}` as `a::b` and `a::c::d`.
fn leaves(tree: &str) -> Vec<Vec<String>> {
    let Some((before, inside)) = tree.split_once('{') else {
        let name = tree.split(" as ").next().unwrap_or_default();
        return vec![name.split("::").map(|part| part.trim().to_owned()).collect()];
    };
    let inside = inside.trim_end().strip_suffix('}').expect("a whole tree");
    let (mut depth, mut start, mut parts) = (0, 0, Vec::new());
    for (at, letter) in inside.char_indices().chain([(inside.len(), ',')]) {
        match letter {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                parts.push(inside[start..at].trim());
                start = at + 1;
            }
            _ => {}
        }
    }
    let parts = parts.into_iter().filter(|part| !part.is_empty());
    parts.flat_map(|part| leaves(&format!("{}{part}", before.trim()))).collect()
}

/// The file that defines what `path` names, seen from `from`; `None` for what is not this crate's.
fn origin(files: &BTreeMap<Module, File>, from: &Module, path: &[String]) -> Option<Module> {
    let mut at = from.clone();
    let mut rest = path;
    match path[0].as_str() {
        "crate" => (at, rest) = (Module::new(), &path[1..]),
        "self" => rest = &path[1..],
        "super" => {
            while rest.first().is_some_and(|part| part == "super") {
                at.pop();
                rest = &rest[1..];
            }
        }
        child => {
            at.push(child.to_owned());
            rest = &path[1..];
            if !files.contains_key(&at) {
                return None;
            }
        }
    }
    while let [part, ..] = rest {
        at.push(part.clone());
        if !files.contains_key(&at) {
            at.pop();
            break;
        }
        rest = &rest[1..];
    }
    let item = rest.first();
    let passed_on = files[&at].passed_on.iter().find(|path| path.last() == item);
    passed_on.and_then(|path| origin(files, &at, path)).or(Some(at))
}

fn layer(module: &Module) -> Option<usize> {
    LAYERS.iter().position(|name| module.first().is_some_and(|first| first == name))
}

/// Modules that lie on a circle of imports, with one they import; empty when there is no circle.
fn circle(imports: &BTreeSet<(Module, Module)>) -> Vec<(Module, Module)> {
    let mut left: BTreeSet<_> = imports.clone();
    loop {
        // What nobody imports, and what imports nothing, is on no circle.
        let next: BTreeSet<_> = left
            .iter()
            .filter(|(from, to)| left.iter().any(|(_, b)| b == from) && left.iter().any(|(a, _)| a == to))
            .cloned()
            .collect();
        if next.len() == left.len() {
            return next.into_iter().collect();
        }
        left = next;
    }
}

fn imports() -> (BTreeMap<Module, File>, BTreeSet<(Module, Module)>) {
    let (mut files, mut tests) = (BTreeMap::new(), BTreeSet::new());
    read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &Module::new(), &mut files, &mut tests);
    files.retain(|module, _| !tests.contains(module));
    let mut imports = BTreeSet::new();
    for (module, file) in &files {
        for to in file.imports.iter().filter_map(|path| origin(&files, module, path)) {
            if to != *module {
                imports.insert((module.clone(), to));
            }
        }
    }
    assert!(files.len() > 40 && imports.len() > 100, "{} files, {} imports", files.len(), imports.len());
    (files, imports)
}

#[test]
fn no_file_imports_from_a_higher_layer() {
    let (files, imports) = imports();
    let crate_root = Module::new();
    for module in files.keys().filter(|module| **module != crate_root) {
        assert!(layer(module).is_some(), "{} is in no layer", module.join("::"));
    }
    let upwards: Vec<String> = imports
        .iter()
        .filter(|(from, to)| *from != crate_root && (layer(to).is_none() || layer(to) > layer(from)))
        .map(|(from, to)| format!("{} imports from {}", from.join("::"), to.join("::")))
        .collect();
    assert!(upwards.is_empty(), "{}", upwards.join("\n"));
}

#[test]
fn no_modules_import_each_other_in_a_circle() {
    let (_, imports) = imports();
    // The modules at the top, those within them, and so on down to single files.
    for depth in 1..=3 {
        let cut = |module: &Module| module[..depth.min(module.len())].to_vec();
        let between: BTreeSet<(Module, Module)> =
            imports.iter().map(|(from, to)| (cut(from), cut(to))).filter(|(from, to)| from != to).collect();
        let on_circle: Vec<String> = circle(&between)
            .into_iter()
            .map(|(from, to)| format!("{} imports from {}", from.join("::"), to.join("::")))
            .collect();
        assert!(on_circle.is_empty(), "a circle, or between two:\n{}", on_circle.join("\n"));
    }
}

#[test]
fn what_a_file_takes_from_others_stands_in_its_use_lines() {
    let (files, _) = imports();
    for (module, file) in &files {
        assert!(
            file.inline.is_empty(),
            "{}: {:?}; import it by a `use` line",
            module.join("::"),
            file.inline
        );
    }
}

#[test]
fn a_circle_and_a_nested_tree_are_seen() {
    let names = |text: &str| text.split("::").map(str::to_owned).collect::<Module>();
    assert_eq!(
        leaves("a::{b, c::{self, d}, e}"),
        ["a::b", "a::c::self", "a::c::d", "a::e"].map(names).to_vec()
    );
    let edges = |pairs: &[(&str, &str)]| pairs.iter().map(|(a, b)| (names(a), names(b))).collect();
    assert!(circle(&edges(&[("a", "b"), ("b", "c"), ("a", "c")])).is_empty());
    assert_eq!(circle(&edges(&[("a", "b"), ("b", "c"), ("c", "b"), ("d", "a")])).len(), 2);
}

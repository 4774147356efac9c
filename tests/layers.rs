//! No files of a crate import each other in a circle, and `roscausal_discovery` is built in layers: no file of it imports from a
//! higher one. Both are read off the code; tests inside the files may import what they like.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::Path,
};

/// The crate that is built in layers, and its modules from the ground up.
const LAYERED: &str = "roscausal_discovery";
const LAYERS: [&str; 20] = [
    "types", "numeric", "later", "season", "unsteady", "profile", "independence_tests", "transfer_entropy",
    "methods", "model", "settings", "evidence", "draw", "analysis", "confidence", "changes", "rolling",
    "levels", "effort", "recommend",
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
        // A program of its own is none of the crate's files, and tests may stand in a file of theirs.
        } else if path.extension().is_some_and(|extension| extension == "rs")
            && stem != "main"
            && !stem.ends_with("_tests")
        {
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
            match lines.next().unwrap().trim_start_matches("pub(crate) ").strip_prefix("mod ") {
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

/// The files of a crate, and which imports from which.
type Crate = (BTreeMap<Module, File>, BTreeSet<(Module, Module)>);

/// The crates by their folders; the command has the empty one.
fn crates() -> BTreeMap<String, Crate> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folders = fs::read_dir(root).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let folders = folders.filter(|name| name.starts_with("roscausal_")).chain([String::new()]);
    let crates: BTreeMap<String, Crate> =
        folders.map(|name| (name.clone(), imports(&root.join(name).join("src")))).collect();
    let counted = |of: fn(&Crate) -> usize| crates.values().map(of).sum::<usize>();
    let (files, imports) = (counted(|(files, _)| files.len()), counted(|(_, imports)| imports.len()));
    assert!(crates.len() > 10 && files > 450 && imports > 1000, "{files} files, {imports} imports");
    crates
}

fn imports(src: &Path) -> Crate {
    let (mut files, mut tests) = (BTreeMap::new(), BTreeSet::new());
    read(src, &Module::new(), &mut files, &mut tests);
    files.retain(|module, _| !tests.iter().any(|test| module.starts_with(test)));
    let mut imports = BTreeSet::new();
    for (module, file) in &files {
        let inline = file.inline.iter().flat_map(|line| inline(line));
        for to in file.imports.iter().cloned().chain(inline).filter_map(|path| origin(&files, module, &path))
        {
            if to != *module {
                imports.insert((module.clone(), to));
            }
        }
    }
    (files, imports)
}

/// The paths to modules of the crate in a line of code.
fn inline(line: &str) -> Vec<Vec<String>> {
    let line = line.replace("$crate::", "");
    let words = line.split(|c: char| !(c.is_alphanumeric() || "_:".contains(c)));
    let paths = words.filter(|word| word.starts_with("crate::") || word.starts_with("super::"));
    paths.flat_map(leaves).collect()
}

fn reported<'a>(imports: impl IntoIterator<Item = &'a (Module, Module)>) -> String {
    let sentence =
        |(from, to): &(Module, Module)| format!("{} imports from {}", from.join("::"), to.join("::"));
    imports.into_iter().map(sentence).collect::<Vec<_>>().join("\n")
}

#[test]
fn no_file_imports_from_a_higher_layer() {
    let (files, imports) = &crates()[LAYERED];
    let crate_root = Module::new();
    for module in files.keys().filter(|module| **module != crate_root) {
        assert!(layer(module).is_some(), "{} is in no layer", module.join("::"));
    }
    let upwards = imports
        .iter()
        .filter(|(from, to)| *from != crate_root && (layer(to).is_none() || layer(to) > layer(from)));
    let upwards = reported(upwards);
    assert!(upwards.is_empty(), "{upwards}");
}

#[test]
fn no_layered_modules_import_each_other_in_a_circle() {
    let (_, imports) = &crates()[LAYERED];
    // The modules at the top, those within them, and so on down to single files.
    for depth in 1..=3 {
        let cut = |module: &Module| module[..depth.min(module.len())].to_vec();
        let between: BTreeSet<(Module, Module)> =
            imports.iter().map(|(from, to)| (cut(from), cut(to))).filter(|(from, to)| from != to).collect();
        let on_circle = reported(&circle(&between));
        assert!(on_circle.is_empty(), "a circle, or between two:\n{on_circle}");
    }
}

#[test]
fn no_files_of_any_crate_import_each_other_in_a_circle() {
    for (name, (_, mut imports)) in crates() {
        // What stands in the file of a folder is the vocabulary of all that is in the folder.
        imports.retain(|(from, to)| !from.starts_with(to) && !from.is_empty());
        let on_circle = reported(&circle(&imports));
        assert!(on_circle.is_empty(), "{name}: a circle, or between two:\n{on_circle}");
    }
}

#[test]
fn what_a_layered_file_takes_from_others_stands_in_its_use_lines() {
    for (module, file) in &crates()[LAYERED].0 {
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

//! Tests of a folder of results: broken off at every step, files of others, links, and lists that others wrote.

use std::collections::BTreeMap;

use super::*;

const OLD: [&str; 4] = ["a.json", "b.svg", "extra/d.csv", "sub/c.csv"];
const NEW_SET: [&str; 4] = ["a.json", "new/e.csv", "sub/c.csv", "sub/f.csv"];
const OTHERS: [&str; 3] = ["mine.txt", "extra/mine.txt", "others/list.json"];

fn put(dir: &Path, names: &[&str], text: &str) {
    for name in names {
        let path = dir.join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("makes");
        fs::write(path, text).expect("writes");
    }
}

/// All files but those that are kept about the results.
fn files(dir: &Path) -> BTreeMap<String, String> {
    let mut found = BTreeSet::new();
    collect(dir, Path::new(""), &mut found).expect("lists");
    let seen = found.iter().filter(|path| !path.starts_with(HOME));
    seen.map(|path| (path.display().to_string(), fs::read_to_string(dir.join(path)).expect("reads")))
        .collect()
}

fn expected(sets: &[(&[&str], &str)]) -> BTreeMap<String, String> {
    let all = |(names, text): &(&[&str], &str)| {
        let text = (*text).to_owned();
        names.iter().map(|name| ((*name).to_owned(), text.clone())).collect::<Vec<_>>()
    };
    sets.iter().flat_map(all).collect()
}

fn begin(dir: &Path) -> Result<Results> {
    Results::begin(dir, Some(false), &[])
}

/// A folder with an old set, and files that others put there since.
fn older() -> TempDir {
    let dir = tempfile::tempdir().expect("a folder");
    begin(dir.path())
        .and_then(|results| {
            results.write(|folder| {
                put(folder, &OLD, "old");
                Ok(())
            })
        })
        .expect("writes");
    put(dir.path(), &OTHERS, "mine");
    dir
}

#[test]
fn a_set_leaves_nothing_of_the_one_before_and_all_files_of_others() {
    let dir = older();
    assert_eq!(files(dir.path()), expected(&[(&OLD, "old"), (&OTHERS, "mine")]));
    let results = begin(dir.path()).expect("begins");
    put(&results.folder(), &NEW_SET, "new");
    assert_eq!(files(dir.path()), expected(&[(&OLD, "old"), (&OTHERS, "mine")]));
    results.finish().expect("ends");
    assert_eq!(files(dir.path()), expected(&[(&NEW_SET, "new"), (&OTHERS, "mine")]));
    let left = fs::read_dir(dir.path().join(HOME)).expect("lists").flatten().map(|entry| entry.file_name());
    assert_eq!(left.collect::<Vec<_>>(), [LIST], "nothing but the list stays");
}

#[test]
fn a_run_that_breaks_off_at_any_step_leaves_the_old_set_or_one_that_the_next_run_completes() {
    // Each move of a file, each removal, the list, and what is left of the folder afterwards.
    let steps = NEW_SET.len() + 2 + 2;
    for step in 0..=steps {
        let dir = older();
        let results = begin(dir.path()).expect("begins");
        put(&results.folder(), &NEW_SET, "new");
        results.check_and_list().and_then(|files| results.commit(&files)).expect("is complete");
        drop(results);
        let (home, new) = (dir.path().join(HOME), dir.path().join(HOME).join(NEW));
        let moves = NEW_SET.map(|name| (new.join(SET).join(name), dir.path().join(name)));
        for (from, to) in moves.iter().take(step) {
            fs::create_dir_all(to.parent().expect("a folder")).expect("makes");
            fs::rename(from, to).expect("moves");
        }
        for name in ["b.svg", "extra/d.csv"].iter().take(step.saturating_sub(NEW_SET.len())) {
            fs::remove_file(dir.path().join(name)).expect("removes");
        }
        if step >= steps - 1 {
            fs::rename(new.join(SET).join(HOME).join(LIST), home.join(LIST)).expect("moves");
        }
        if step == steps {
            fs::remove_dir_all(&new).expect("removes");
        }
        let reported = check_whole(&dir.path().join("sub/c.csv"));
        assert_eq!(reported.is_err(), step < steps, "{step}: {reported:?}");
        // A run that begins, and makes nothing.
        drop(begin(dir.path()).expect("begins"));
        assert_eq!(files(dir.path()), expected(&[(&NEW_SET, "new"), (&OTHERS, "mine")]), "{step}");
        assert!(check_whole(dir.path()).is_ok(), "{step}");
        let results = begin(dir.path()).expect("begins");
        put(&results.folder(), &OLD, "old");
        results.finish().expect("ends");
        assert_eq!(files(dir.path()), expected(&[(&OLD, "old"), (&OTHERS, "mine")]), "{step}");
    }
}

#[test]
fn what_a_killed_run_was_working_on_is_removed_and_the_old_set_is_whole() {
    let dir = older();
    put(&dir.path().join(HOME), &["work-abc/set/a.json", "work-abc/list.json", LOCK], "half");
    drop(begin(dir.path()).expect("begins"));
    assert_eq!(files(dir.path()), expected(&[(&OLD, "old"), (&OTHERS, "mine")]));
    assert!(!dir.path().join(HOME).join("work-abc").exists());
}

#[test]
fn a_folder_has_one_run_at_a_time_and_the_second_names_the_process() {
    let dir = tempfile::tempdir().expect("a folder");
    let out = dir.path().join("new/out");
    let first = begin(&out).expect("begins");
    let reported = begin(&out).err().expect("is held").to_string();
    assert!(reported.contains(&format!("process {} writes its results", process::id())), "{reported}");
    drop(first);
    assert!(!out.exists(), "a run without results leaves no folder that it made");
    drop(begin(&out).expect("is free"));
}

#[test]
fn a_file_of_others_gives_way_to_force_only_and_a_folder_never() {
    let dir = older();
    put(dir.path(), &["taken.json"], "mine");
    let finish = |force: bool, name: &str| {
        let results = Results::begin(dir.path(), Some(force), &[]).expect("begins");
        put(&results.folder(), &["a.json", name], "new");
        results.finish().map_err(|error| error.to_string())
    };
    for (force, name) in [(false, "taken.json"), (true, "others"), (true, "mine.txt/below.csv")] {
        let reported = finish(force, name).expect_err("is refused");
        assert!(reported.contains("of others") && reported.contains(name), "{reported}");
        let mine = [&OTHERS[..], &["taken.json"]].concat();
        assert_eq!(files(dir.path()), expected(&[(&OLD, "old"), (&mine, "mine")]), "{name}");
    }
    finish(true, "taken.json").expect("is replaced");
    assert_eq!(files(dir.path()), expected(&[(&["a.json", "taken.json"], "new"), (&OTHERS, "mine")]));
}

#[test]
fn what_a_run_reads_is_not_replaced_by_its_results() {
    let dir = older();
    for read in ["a.json", "sub", "."] {
        let reported =
            Results::begin(dir.path(), Some(true), &[dir.path().join(read)]).err().expect("is refused");
        assert!(reported.to_string().contains("would replace it"), "{reported}");
    }
    drop(Results::begin(dir.path(), Some(true), &[dir.path().join("mine.txt")]).expect("is spared"));
}

#[test]
fn the_list_of_a_stranger_names_no_file_outside_the_folder() {
    let outside = tempfile::tempdir().expect("a folder");
    put(outside.path(), &["thesis.txt", ".roscausal/list.json"], r#"{"files": ["thesis.txt"]}"#);
    let thesis = outside.path().join("thesis.txt");
    let before = files(outside.path());
    let climbing = format!("../{}/thesis.txt", outside.path().file_name().expect("a name").display());
    let absolute = thesis.display().to_string();
    let names = [absolute.as_str(), &climbing, "link/thesis.txt", ".roscausal/list.json", "", "."];
    let list = serde_json::json!({ "files": names, "gone": names }).to_string();
    for at in [LIST, "new/set/.roscausal/list.json", "new/set"] {
        let dir = older();
        std::os::unix::fs::symlink(outside.path(), dir.path().join("link")).expect("links");
        let home = dir.path().join(HOME);
        if at == "new/set" {
            fs::create_dir(home.join(NEW)).expect("makes");
            std::os::unix::fs::symlink(outside.path(), home.join(at)).expect("links");
        } else {
            put(&home, &[at], &list);
        }
        let force = || Results::begin(dir.path(), Some(true), &[]);
        match at {
            "new/set/.roscausal/list.json" => assert!(begin(dir.path()).is_err() && force().is_err()),
            _ => {
                assert_eq!(begin(dir.path()).is_err(), at == LIST, "{at}");
                let results = force().expect("begins");
                put(&results.folder(), &["x.json"], "new");
                results.finish().expect("ends");
                assert!(dir.path().join("x.json").exists(), "{at}");
            }
        }
        assert!(files(outside.path()) == before && thesis.exists(), "{at}");
        assert!(!dir.path().join("thesis.txt").exists(), "{at}");
    }
}

#[test]
fn a_list_that_was_unpacked_or_copied_removes_no_file_of_the_users() {
    let dir = tempfile::tempdir().expect("a folder");
    put(dir.path(), &["notes.md", "src/notes.md"], "mine");
    for list in [r#"{"files": ["notes.md"]}"#, r#"{"files": ["x"], "gone": ["src/notes.md"]}"#] {
        for at in [LIST, "new/set/.roscausal/list.json"] {
            put(&dir.path().join(HOME), &[at], list);
            assert!(begin(dir.path()).is_err(), "{at}");
            let _ = Results::begin(dir.path(), Some(true), &[]).map(|results| {
                put(&results.folder(), &["a.json"], "new");
                results.finish()
            });
            assert!(dir.path().join("notes.md").exists() && dir.path().join("src/notes.md").exists(), "{at}");
            let _ = fs::remove_dir_all(dir.path().join(HOME));
            let _ = fs::remove_file(dir.path().join("a.json"));
        }
    }
    // A list of a run of ours that was copied with its folder.
    let (ours, copy) = (older(), tempfile::tempdir().expect("a folder"));
    put(copy.path(), &["a.json"], "mine");
    fs::create_dir(copy.path().join(HOME)).expect("makes");
    fs::copy(ours.path().join(HOME).join(LIST), copy.path().join(HOME).join(LIST)).expect("copies");
    assert!(begin(copy.path()).is_err() && begin(ours.path()).is_ok());
}

#[cfg(target_os = "linux")]
#[test]
fn a_folder_with_nothing_else_in_it_changes_places_in_one_step() {
    use std::os::unix::fs::{MetadataExt, PermissionsExt};

    let parent = tempfile::tempdir().expect("a folder");
    let dir = parent.path().join("out");
    let once = |names: &[&str], text: &str| {
        let results = begin(&dir).expect("begins");
        put(&results.folder(), names, text);
        fs::create_dir_all(results.folder().join("empty/folder")).expect("makes");
        results.finish().expect("ends");
        fs::metadata(&dir).expect("is there")
    };
    let first = once(&OLD, "old");
    fs::set_permissions(&dir, fs::Permissions::from_mode(0o750)).expect("may");
    // What a killed run left beside it.
    put(parent.path(), &[".out.roscausal-abc/a.json", ".out.roscausal-abc/.roscausal/list.json"], "half");
    put(parent.path(), &[".out.roscausal-mine/thesis.txt"], "mine");
    let second = once(&NEW_SET, "new");
    assert_ne!(first.ino(), second.ino());
    assert_eq!(second.permissions().mode() & 0o777, 0o750);
    assert_eq!(files(&dir), expected(&[(&NEW_SET, "new")]));
    assert!(parent.path().join(".out.roscausal-mine/thesis.txt").exists(), "these are not results");
    assert_eq!(fs::read_dir(parent.path()).expect("lists").count(), 2, "nothing of ours is left beside it");
    // With anything of others it stays the same folder.
    for name in ["mine.txt", "mine/empty", "sub/mine.txt", ".hidden.tmp"] {
        let path = dir.join(name);
        match name {
            "mine/empty" => fs::create_dir_all(&path).expect("makes"),
            _ => put(&dir, &[name], "mine"),
        }
        assert_eq!(once(&OLD, "old").ino(), second.ino(), "{name}");
        assert!(path.exists(), "{name}");
        assert_eq!(once(&NEW_SET, "new").ino(), second.ino(), "{name}");
        match path.is_dir() {
            true => fs::remove_dir_all(dir.join("mine")).expect("removes"),
            false => fs::remove_file(path).expect("removes"),
        }
    }
    assert_ne!(once(&OLD, "old").ino(), second.ino());
}

#[test]
fn nothing_is_written_through_a_link() {
    let (dir, outside) = (tempfile::tempdir().expect("a folder"), tempfile::tempdir().expect("a folder"));
    let victim = outside.path().join("victim");
    fs::write(&victim, "mine").expect("writes");
    let force = || Results::begin(dir.path(), Some(true), &[]);
    std::os::unix::fs::symlink(outside.path(), dir.path().join(HOME)).expect("links");
    assert!(begin(dir.path()).is_err() && force().is_err());
    fs::remove_file(dir.path().join(HOME)).expect("removes");
    fs::create_dir(dir.path().join(HOME)).expect("makes");
    std::os::unix::fs::symlink(&victim, dir.path().join(HOME).join(LOCK)).expect("links");
    assert!(begin(dir.path()).is_err() && force().is_err());
    fs::remove_file(dir.path().join(HOME).join(LOCK)).expect("removes");
    // A result with the name of a link takes its place; what the link names stays.
    std::os::unix::fs::symlink(&victim, dir.path().join("a.json")).expect("links");
    std::os::unix::fs::symlink(&victim, dir.path().join(".a.json.tmp")).expect("links");
    let results = force().expect("begins");
    put(&results.folder(), &["a.json"], "new");
    results.finish().expect("ends");
    assert_eq!(fs::read_to_string(&victim).expect("is there"), "mine");
    assert_eq!(fs::read_to_string(dir.path().join("a.json")).expect("is there"), "new");
    let left: Vec<_> = fs::read_dir(outside.path()).expect("lists").flatten().collect();
    assert_eq!(left.len(), 1);
}

//! A folder of results belongs to one run: killed at any moment, on a full disk, beside another run, in any place.

#![cfg(unix)]
#![allow(
    clippy::expect_used,
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test may panic: that is how it fails"
)]

mod common;

use std::{
    collections::BTreeMap,
    fs,
    os::unix::{
        fs::{MetadataExt, PermissionsExt, symlink},
        process::CommandExt,
    },
    path::{Path, PathBuf},
    process::{Child, Command, Output, Stdio},
    thread,
    time::{Duration, Instant},
};

use common::roscausal;
use roscausal_fuzz::unit;
use tempfile::TempDir;

const HOME: &str = ".roscausal";
const QUICK: [&str; 6] = ["--method", "pcmci", "--test", "parcorr", "--threads", "1"];
/// Whoever is not root.
const NOBODY: u32 = 65534;

/// Files below a folder but those that are kept about results: name and content.
fn files(dir: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut open = vec![dir.to_path_buf()];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(&folder).expect("lists").flatten() {
            let path = entry.path();
            if path.is_dir() {
                open.extend(Some(path).filter(|path| *path != dir.join(HOME)));
            } else {
                let name = path.strip_prefix(dir).expect("is inside").display().to_string();
                found.insert(name, fs::read(&path).expect("reads"));
            }
        }
    }
    found
}

/// Everything in a folder, also what is kept about results.
fn copy(from: &Path, to: &Path) {
    for entry in fs::read_dir(from).expect("lists").flatten() {
        let place = to.join(entry.file_name());
        if entry.path().is_dir() {
            fs::create_dir_all(&place).expect("makes");
            copy(&entry.path(), &place);
        } else {
            fs::copy(entry.path(), place).expect("copies");
        }
    }
}

fn empty(dir: &Path) {
    for entry in fs::read_dir(dir).expect("lists").flatten() {
        match entry.file_type().expect("a type").is_dir() {
            true => fs::remove_dir_all(entry.path()).expect("removes"),
            false => fs::remove_file(entry.path()).expect("removes"),
        }
    }
}

/// Three tables in which `a` drives `b`, each with its own noise.
fn tables() -> TempDir {
    let dir = tempfile::tempdir().expect("a folder");
    let mut state = 5;
    for name in ["one.csv", "two.csv", "three.csv"] {
        let (mut text, mut a) = (String::from("time,a,b\n"), 0.0);
        for t in 0..300 {
            let b = 0.8 * a + unit(&mut state);
            a = unit(&mut state);
            text += &format!("{},{a},{b}\n", f64::from(t) * 0.25);
        }
        fs::write(dir.path().join(name), text).expect("writes");
    }
    dir
}

fn stated(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn is_root() -> bool {
    let id = Command::new("id").arg("-u").output().expect("id is there");
    String::from_utf8_lossy(&id.stdout).trim() == "0"
}

/// A `roscausal discover` of some tables, started where and by whom.
struct Start<'a> {
    cwd: &'a Path,
    out: &'a str,
    uid: Option<u32>,
    /// Whether there are files of others in the folder.
    others: bool,
}

impl Start<'_> {
    fn command(&self, tables: &Path, names: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_roscausal"));
        command.arg("discover").args(names.iter().map(|name| tables.join(name))).args(QUICK);
        command.args(["--out", self.out]).current_dir(self.cwd).stdout(Stdio::null()).stderr(Stdio::piped());
        if let Some(uid) = self.uid {
            command.uid(uid);
        }
        command
    }
}

/// Makes a copy of results one of a run into this folder: its list is believed only in the file in which it was written.
fn adopt(results: &Path) {
    let path = results.join(HOME).join("list.json");
    let mut list: serde_json::Value =
        serde_json::from_slice(&fs::read(&path).expect("a list")).expect("JSON");
    list["inode"] = fs::metadata(&path).expect("is there").ino().into();
    fs::write(&path, list.to_string()).expect("writes");
}

/// How many runs are killed: `ROSCAUSAL_KILLS`, else `usual`.
fn kills(usual: u32) -> u32 {
    std::env::var("ROSCAUSAL_KILLS").ok().and_then(|text| text.parse().ok()).unwrap_or(usual)
}

/// Kills runs over an older result in `real`, which `start` names in its own way. The moments are spread over the whole run.
fn killed_at_any_moment(
    tables: &Path,
    start: &Start<'_>,
    real: &Path,
    (old, new): (&[&str], &[&str]),
    usual: u32,
) {
    let references = tempfile::tempdir().expect("a folder");
    let mut sets = Vec::new();
    for (names, place) in [(old, "old"), (new, "new")] {
        let made = Start { cwd: references.path(), out: place, uid: None, others: true }
            .command(tables, names)
            .output();
        assert!(made.expect("runs").status.success());
        sets.push(files(&references.path().join(place)));
    }
    let [old_set, new_set] = <[_; 2]>::try_from(sets).expect("two");
    assert!(old_set.keys().ne(new_set.keys()), "one has files that the other does not have");
    let prepare = || {
        empty(real);
        copy(&references.path().join("old"), real);
        adopt(real);
        if start.others {
            fs::create_dir_all(real.join("mine")).expect("makes");
            fs::write(real.join("mine/thesis.txt"), "words").expect("writes");
            fs::write(real.join("notes.csv"), "x\n1\n").expect("writes");
        }
        if let Some(uid) = start.uid {
            let all = Command::new("chown").args(["-R", &uid.to_string()]).arg(real).status();
            assert!(all.expect("chown is there").success());
        }
    };
    prepare();
    let begun = Instant::now();
    let whole = start.command(tables, new).output().expect("runs");
    let whole_run = begun.elapsed();
    assert!(whole.status.success(), "{}", stated(&whole));
    let runs = kills(usual);
    let (mut state, mut left) = (u64::from(runs) + 3, [0; 3]);
    for run in 0..runs {
        prepare();
        let mut child = start.command(tables, new).spawn().expect("starts");
        thread::sleep(whole_run.mul_f64((f64::from(run) + unit(&mut state)) / f64::from(runs)));
        child.kill().expect("is killed");
        child.wait().expect("ends");
        let swapping = real.join(HOME).join("new").exists();
        if swapping {
            let reported = roscausal(real, &["show", "model.json"]);
            assert!(
                !reported.status.success() && stated(&reported).contains("ended by force"),
                "{}",
                stated(&reported)
            );
            // It begins, and does nothing.
            assert!(!start.command(tables, &["missing.csv"]).status().expect("runs").success());
        }
        let mut seen = files(real);
        if start.others {
            assert_eq!(seen.remove("mine/thesis.txt").as_deref(), Some(&b"words"[..]));
            assert_eq!(seen.remove("notes.csv").as_deref(), Some(&b"x\n1\n"[..]));
        }
        let names: Vec<&String> = seen.keys().collect();
        assert!(seen == old_set || seen == new_set, "run {run}, {swapping}: {names:?}");
        left[if swapping { 2 } else { usize::from(seen == new_set) }] += 1;
    }
    // Whatever a killed run left, the next one ends well and cleans up.
    assert!(start.command(tables, new).status().expect("runs").success());
    let mut seen = files(real);
    seen.retain(|name, _| name != "mine/thesis.txt" && name != "notes.csv");
    assert!(seen == new_set);
    assert_eq!(fs::read_dir(real.join(HOME)).expect("lists").count(), 1, "only the list stays");
    println!("{}: {} old, {} new, {} completed by the next run", start.out, left[0], left[1], left[2]);
    assert!(left[0] > 0, "no run was killed before its end");
    let in_one_step = cfg!(target_os = "linux") && !start.others && start.out != ".";
    assert!(!in_one_step || left[2] == 0, "the folders change places in one step");
}

const ONE: &[&str] = &["one.csv"];
const ALL: &[&str] = &["one.csv", "two.csv", "three.csv"];

#[test]
fn a_killed_run_leaves_the_old_set_or_the_new_one_and_the_files_of_others() {
    let dir = tables();
    let out = dir.path().join("out");
    fs::create_dir(&out).expect("makes");
    let path = out.display().to_string();
    // The older one has more files, then the newer one.
    for (sets, others, usual) in [((ALL, ONE), false, 50), ((ALL, ONE), true, 50), ((ONE, ALL), true, 10)] {
        killed_at_any_moment(
            dir.path(),
            &Start { cwd: dir.path(), out: &path, uid: None, others },
            &out,
            sets,
            usual,
        );
    }
    let left: Vec<_> =
        fs::read_dir(dir.path()).expect("lists").flatten().map(|entry| entry.file_name()).collect();
    assert_eq!(left.len(), 4, "the tables and the results: {left:?}");
}

#[test]
fn so_it_is_by_a_link_by_a_relative_path_and_in_the_current_folder() {
    let dir = tables();
    let (real, other) = (dir.path().join("deep/real"), dir.path().join("other"));
    fs::create_dir_all(&real).expect("makes");
    fs::create_dir(&other).expect("makes");
    symlink(&real, other.join("link")).expect("links");
    for (cwd, out) in [(&other, "link"), (&other, "../deep/real/"), (&real, ".")] {
        for others in [false, true] {
            killed_at_any_moment(dir.path(), &Start { cwd, out, uid: None, others }, &real, (ALL, ONE), 10);
        }
    }
    assert!(fs::symlink_metadata(other.join("link")).expect("is there").is_symlink());
}

#[test]
fn so_it_is_below_a_folder_that_cannot_be_written() {
    let dir = tables();
    let (parent, uid) = (dir.path().join("parent"), is_root().then_some(NOBODY));
    let out = parent.join("out");
    fs::create_dir_all(&out).expect("makes");
    for folder in [dir.path(), &parent, &out] {
        fs::set_permissions(folder, fs::Permissions::from_mode(0o755)).expect("may");
    }
    if let Some(uid) = uid {
        let mut probe = Command::new(env!("CARGO_BIN_EXE_roscausal"));
        if !probe.arg("--version").uid(uid).output().is_ok_and(|output| output.status.success()) {
            eprintln!(
                "NOT TESTED: results below a folder that cannot be written: only root reaches the program"
            );
            return;
        }
    }
    fs::set_permissions(&parent, fs::Permissions::from_mode(0o555)).expect("may");
    let start = Start { cwd: Path::new("/"), out: &out.display().to_string(), uid, others: true };
    killed_at_any_moment(dir.path(), &start, &out, (ALL, ONE), 10);
    fs::set_permissions(&parent, fs::Permissions::from_mode(0o755)).expect("may");
}

/// A file system of its own in memory, while this lives.
struct Disk(PathBuf);

impl Disk {
    /// `None`, and a word about it, if this user may not mount one.
    fn mount(place: PathBuf, kilobytes: u64, what: &str) -> Option<Self> {
        fs::create_dir_all(&place).expect("makes");
        let size = format!("size={kilobytes}k");
        let mount = Command::new("mount").args(["-t", "tmpfs", "-o", &size, "tmpfs"]).arg(&place).output();
        if mount.is_ok_and(|output| output.status.success()) {
            return Some(Self(place));
        }
        eprintln!("NOT TESTED: {what}: this needs root (mount -t tmpfs)");
        None
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(&self.0).status();
    }
}

#[test]
fn so_it_is_on_a_mount_point() {
    let dir = tables();
    let Some(disk) = Disk::mount(dir.path().join("mounted"), 20_000, "results on a mount point") else {
        return;
    };
    let start = Start { cwd: dir.path(), out: "mounted", uid: None, others: true };
    killed_at_any_moment(dir.path(), &start, &disk.0, (ALL, ONE), 10);
}

/// The run failed with one sentence about the folder, and the old set is whole.
fn failed_and_whole(output: &Output, out: &Path, old: &BTreeMap<String, Vec<u8>>, why: &str) {
    let reported = stated(output);
    assert_eq!(output.status.code(), Some(1), "{reported}");
    let error: Vec<&str> = reported.lines().filter(|line| line.starts_with("error: ")).collect();
    assert!(error.len() == 1 && reported.contains(why) && !reported.contains("panicked"), "{reported}");
    assert!(!error[0].contains(HOME), "it names the final place: {reported}");
    assert!(files(out) == *old, "{:?}", files(out).keys());
    assert_eq!(fs::read_dir(out.join(HOME)).expect("lists").count(), 1, "only the list stays");
}

#[test]
fn a_file_that_may_not_grow_is_one_sentence_and_the_old_set_is_whole() {
    let dir = tables();
    assert!(
        Start { cwd: dir.path(), out: "out", uid: None, others: true }
            .command(dir.path(), ALL)
            .status()
            .expect("runs")
            .success()
    );
    let old = files(&dir.path().join("out"));
    // In blocks of 512 bytes: some files fit, and some do not.
    for blocks in ["1", "8", "20"] {
        let program = env!("CARGO_BIN_EXE_roscausal");
        let output = Command::new("sh")
            .args([
                "-c",
                &format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$@\""),
                "sh",
                program,
                "discover",
            ])
            .args([&["one.csv", "--out", "out"], &QUICK[..]].concat())
            .current_dir(dir.path())
            .output()
            .expect("runs");
        failed_and_whole(&output, &dir.path().join("out"), &old, "File too large");
    }
}

#[test]
fn a_full_disk_is_one_sentence_and_the_old_set_is_whole() {
    let dir = tables();
    let Some(disk) = Disk::mount(dir.path().join("disk"), 600, "results on a full disk") else { return };
    let start = Start { cwd: dir.path(), out: "disk/out", uid: None, others: true };
    assert!(start.command(dir.path(), ONE).status().expect("runs").success());
    let (out, old) = (disk.0.join("out"), files(&disk.0.join("out")));
    // Down to the last page, which is too little even for the lock.
    let ballast = disk.0.join("ballast");
    for free in [40, 16, 4, 0] {
        let _ = fs::remove_file(&ballast);
        let left =
            Command::new("df").args(["--output=avail", "-k"]).arg(&disk.0).output().expect("df is there");
        let left: usize =
            String::from_utf8_lossy(&left.stdout).lines().last().unwrap().trim().parse().unwrap();
        fs::write(&ballast, vec![0; left.saturating_sub(free) * 1024]).expect("fills");
        let output = start.command(dir.path(), ALL).output().expect("runs");
        failed_and_whole(&output, &out, &old, "No space left");
    }
    fs::remove_file(ballast).expect("removes");
    assert!(start.command(dir.path(), ALL).status().expect("runs").success());
}

#[test]
fn whatever_command_comes_next_leaves_nothing_of_the_one_before() {
    let dir = tables();
    let run = |args: &[&str], out: &str| {
        let output = roscausal(dir.path(), &[args, &["--out", out]].concat());
        assert!(output.status.success(), "{args:?}: {}", stated(&output));
    };
    let discover = |names: &[&'static str]| [&["discover"], names, &QUICK].concat();
    run(&discover(ONE), "one");
    run(&discover(&["two.csv"]), "two");
    let asked = ["one/model.json", "--data", "one.csv"];
    let commands = [
        discover(ALL),
        vec!["compare", "one/model.json", "two/model.json"],
        [&["roll", "one.csv", "--batch", "100"], &QUICK[..]].concat(),
        vec!["show", "one/model.json"],
        [&["predict"], &asked[..]].concat(),
        [&["whatif"], &asked[..], &["--action", "a=0.5"]].concat(),
        discover(ONE),
        "experiment changes --seeds 1..1 --before 1000 --after 0 --ts-length 100".split(' ').collect(),
    ];
    fs::create_dir(dir.path().join("out")).expect("makes");
    for (k, command) in commands.iter().enumerate() {
        let alone = format!("alone_{k}");
        run(command, &alone);
        run(command, "out");
        let mut seen = files(&dir.path().join("out"));
        if k > 0 {
            assert_eq!(seen.remove("notes.txt").as_deref(), Some(&b"mine"[..]), "{command:?}");
        }
        assert_eq!(
            seen.keys().collect::<Vec<_>>(),
            files(&dir.path().join(alone)).keys().collect::<Vec<_>>()
        );
        fs::write(dir.path().join("out/notes.txt"), "mine").expect("writes");
    }
    // What a run reads is not replaced by what it writes.
    for args in [&["show", "one/model.json"][..], &["predict", "one/model.json", "--data", "one.csv"]] {
        let output = roscausal(dir.path(), &[args, &["--out", "one"]].concat());
        assert!(
            output.status.code() == Some(1) && stated(&output).contains("would replace it"),
            "{}",
            stated(&output)
        );
    }
}

/// Waits until the run has the folder.
fn until_held(out: &Path, child: &mut Child) {
    let begun = Instant::now();
    while fs::read_to_string(out.join(HOME).join("lock")).unwrap_or_default() != child.id().to_string() {
        assert!(child.try_wait().expect("is known").is_none() && begun.elapsed() < Duration::from_secs(60));
        thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn of_two_runs_on_one_folder_the_second_names_the_process_that_has_it() {
    let dir = tables();
    assert!(
        roscausal(dir.path(), &[&["discover", "one.csv", "-o", "model"], &QUICK[..]].concat())
            .status
            .success()
    );
    let mut first = Command::new(env!("CARGO_BIN_EXE_roscausal"))
        .args("demo --web --port 0 --speed 1 --out out".split(' '))
        .current_dir(dir.path())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("starts");
    until_held(&dir.path().join("out"), &mut first);
    for out in ["out", "./out/../out"] {
        let second = roscausal(dir.path(), &["show", "model/model.json", "--out", out]);
        let reported = stated(&second);
        assert_eq!((second.status.code(), reported.lines().count()), (Some(1), 1), "{reported}");
        assert!(
            reported.contains(&format!("process {} writes its results into this folder", first.id())),
            "{reported}"
        );
    }
    first.kill().expect("is killed");
    first.wait().expect("ends");
    let second = roscausal(dir.path(), &["show", "model/model.json", "--out", "out"]);
    assert!(second.status.success(), "{}", stated(&second));
    assert!(dir.path().join("out/model.json").exists() && !dir.path().join("out/data_pool").exists());
}

#[test]
fn a_replay_that_ctrl_c_ends_keeps_what_it_has_and_a_killed_one_leaves_the_demo_before() {
    let dir = tempfile::tempdir().expect("a folder");
    let quick = ["--method", "pcmci", "--test", "parcorr", "--out", "out"];
    let demo =
        roscausal(dir.path(), &[&["demo", "--duration", "60", "--record", "run.mcap"], &quick[..]].concat());
    assert!(demo.status.success(), "{}", stated(&demo));
    let out = dir.path().join("out");
    let of_demo = files(&out);
    assert!(
        of_demo.contains_key("run.svg") && of_demo.keys().any(|name| name.starts_with("pp_pool/analysed/"))
    );
    for (name, text) in &of_demo {
        let speaks_of_home = text.windows(HOME.len()).any(|part| part == HOME.as_bytes());
        assert!(!speaks_of_home, "{name} names the folder in which the run worked");
    }
    let start = |speed: &str| {
        Command::new(env!("CARGO_BIN_EXE_roscausal"))
            .args([&["replay", "run.mcap", "--ts-length", "10", "--speed", speed], &quick[..]].concat())
            .current_dir(dir.path())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .expect("starts")
    };
    let batches = |folder: &Path| {
        let found = fs::read_dir(folder).into_iter().flatten().flatten();
        found.filter(|entry| entry.file_name().to_string_lossy().ends_with(".csv")).count()
    };
    // The first batch, wherever the run works, once it has removed what a killed one left.
    let until_recorded = |child: &mut Child| {
        until_held(&out, child);
        thread::sleep(Duration::from_millis(200));
        let begun = Instant::now();
        loop {
            let inner = fs::read_dir(out.join(HOME)).into_iter().flatten().flatten();
            if inner.map(|entry| batches(&entry.path().join("set/data_pool"))).sum::<usize>() > 0 {
                return;
            }
            assert!(
                begun.elapsed() < Duration::from_secs(60) && child.try_wait().expect("is known").is_none()
            );
            thread::sleep(Duration::from_millis(5));
        }
    };
    let mut child = start("10");
    until_recorded(&mut child);
    assert!(files(&out) == of_demo, "until its end the run shows nothing");
    child.kill().expect("is killed");
    child.wait().expect("ends");
    assert!(files(&out) == of_demo);

    let mut child = start("10");
    until_recorded(&mut child);
    let kill = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill is there");
    assert!(kill.success());
    let output = child.wait_with_output().expect("ends");
    assert_eq!(output.status.code(), Some(130), "{}", stated(&output));
    assert!(stated(&output).contains("out keeps batches and models so far"), "{}", stated(&output));
    assert!(batches(&out.join("data_pool")) > 0 && !out.join("run.svg").exists());
    assert!(files(&out).iter().all(|(name, text)| of_demo.get(name) != Some(text)), "nothing of the demo");

    let output = start("max").wait_with_output().expect("ends");
    assert!(output.status.success(), "{}", stated(&output));
    let found = files(&out);
    assert!(
        found.contains_key("summary.json")
            && found.contains_key("strip.svg")
            && batches(&out.join("data_pool")) > 3
    );
}

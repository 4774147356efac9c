//! What comes with data decides nothing but how the data are understood: no program is started, no file written or deleted outside
//! the folder that the user named, no port opened, wherever the settings travel. The tests that watch the program need strace
//! (tests/safety.sh).

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
    path::{Path, PathBuf},
    process::{Command, Output},
    sync::OnceLock,
};

use common::roscausal;
use roscausal_fuzz::unit;
use roscausal_recording::{McapWriter, Recording};

const QUICK: [&str; 4] = ["--method", "pcmci", "--test", "parcorr"];

fn stated(output: &Output) -> String {
    // A note goes on in indented lines.
    let notes = String::from_utf8_lossy(&output.stdout).replace("\n  ", " ");
    format!("{notes}{}", String::from_utf8_lossy(&output.stderr))
}

/// A folder with a live run of 30 s (`live/`) and its recording (`run.mcap`).
fn recorded() -> &'static Path {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    let make = || {
        let dir = tempfile::tempdir().expect("a folder");
        let args = ["demo", "--seed", "3", "--duration", "30", "--out", "live", "--record", "run.mcap"];
        let output = roscausal(dir.path(), &[&args[..], &["--do", "robot.off@5..9"], &QUICK].concat());
        assert!(output.status.success(), "{}", stated(&output));
        dir
    };
    FOLDER.get_or_init(make).path()
}

/// Where a stranger's settings would lead.
struct Traps {
    dir: tempfile::TempDir,
}

impl Traps {
    /// A program that leaves a trace, and pools with somebody's batches.
    fn new() -> Self {
        let dir = tempfile::tempdir().expect("a folder");
        let program = dir.path().join("post.py");
        fs::write(&program, "#!/bin/sh\ntouch \"$(dirname \"$0\")/ran\"\n").expect("writes");
        let mut rights = fs::metadata(&program).expect("is there").permissions();
        std::os::unix::fs::PermissionsExt::set_mode(&mut rights, 0o755);
        fs::set_permissions(&program, rights).expect("is ours");
        for pool in ["raw", "pp", "models"] {
            fs::create_dir(dir.path().join(pool)).expect("makes");
            for batch in ["data_20200101_000000.csv", "data_20200101_000100.csv"] {
                fs::write(dir.path().join(pool).join(batch), "time,a\n0,1\n").expect("writes");
            }
        }
        Self { dir }
    }

    fn path(&self, name: &str) -> String {
        self.dir.path().join(name).display().to_string()
    }

    /// Everything in the folder, with contents.
    fn contents(&self) -> BTreeMap<PathBuf, Vec<u8>> {
        let mut found = BTreeMap::new();
        let mut folders = vec![self.dir.path().to_path_buf()];
        while let Some(folder) = folders.pop() {
            for entry in folder.read_dir().expect("a folder").flatten() {
                match entry.path().is_dir() {
                    true => folders.push(entry.path()),
                    false => drop(found.insert(entry.path(), fs::read(entry.path()).expect("reads"))),
                }
            }
        }
        found
    }

    /// Parameters of nodes that name programs, folders and costs.
    fn parameters(&self) -> BTreeMap<String, String> {
        [
            ("data.postprocess", "script".to_owned()),
            ("data.pp_script_dir", self.path("")),
            ("data.pp_script", "post.py".to_owned()),
            ("data.data_dir", self.path("raw")),
            ("data.pp_data_dir", self.path("pp")),
            ("data.max_pool_size", "1".to_owned()),
            ("data.max_pool_bytes", "1".to_owned()),
            ("data.delete_traj", "true".to_owned()),
            ("data.csv_prefix", "stolen_".to_owned()),
            ("data.msg_path", self.path("raw")),
            ("human.msg_path", self.path("raw")),
            ("discovery.cd_method", "post.py".to_owned()),
            ("discovery.cd_method_dir", self.path("")),
            ("discovery.data_dir", self.path("pp")),
            ("discovery.res_dir", self.path("models")),
            ("discovery.max_pool_size", "1".to_owned()),
            ("discovery.null_dist", self.path("raw/data_20200101_000000.csv")),
            ("discovery.links", self.path("raw/data_20200101_000000.csv")),
            ("discovery.threads", "64".to_owned()),
            ("discovery.nice", "19".to_owned()),
            ("discovery.time_budget", "0.001".to_owned()),
            ("discovery.max_memory", "1".to_owned()),
        ]
        .map(|(name, value)| (name.to_owned(), value))
        .into()
    }

    /// Flags that write, listen or read elsewhere, and the parameters, as a file of settings.
    fn toml(&self) -> String {
        let mut text = format!(
            "out = {:?}\nforce = true\nrecord = {:?}\nweb = true\naddress = '0.0.0.0'\nport = 0\ntoken = 'known'\n\
             links = {:?}\nnull-dist = {:?}\nresample-out = {:?}\nresamples = 20\nlatex = {:?}\nthreads = 64\n\
             time-budget = 0.001\nmax-memory = 1\nspeed = '0.01'\n",
            self.path("models"),
            self.path("stolen.mcap"),
            self.path("raw/data_20200101_000000.csv"),
            self.path("raw/data_20200101_000000.csv"),
            self.path("raw/data_20200101_000000.csv"),
            self.path("links.tex"),
        );
        for node in ["data", "human", "discovery"] {
            text += &format!("[{node}]\n");
            for (name, value) in self.parameters() {
                if let Some((_, param)) = name.split_once('.').filter(|(of, _)| *of == node) {
                    text += &format!("{param} = {value:?}\n");
                }
            }
        }
        text
    }
}

/// The recording of [`recorded`] with these settings instead of its own.
fn with_settings(settings: &BTreeMap<String, String>, path: &Path) {
    let mut recording = Recording::open(recorded().join("run.mcap")).expect("opens");
    let topics = recording.topics().to_vec();
    let mut writer = McapWriter::create(path).expect("creates");
    writer.write_settings(settings).expect("writes");
    for record in recording.by_ref() {
        let topic = &topics[record.topic];
        let kind = topic.known_type().expect("a type of ours");
        writer.write_bytes(&topic.name, kind, record.stamp, &record.bytes).expect("writes");
    }
    writer.finish().expect("closes");
}

/// Two columns of coupled numbers.
fn table() -> String {
    let mut state = 5;
    let mut noise = move || unit(&mut state);
    let (mut before, mut text) = (0.0, "time,a,b\n".to_owned());
    for row in 0..200 {
        let a = noise();
        text += &format!("{},{a},{}\n", 0.1 * f64::from(row), before + 0.3 * noise());
        before = a;
    }
    text
}

/// A folder in which every place where settings can travel says the same bad things: `run.mcap` (its metadata), `side.mcap` (the file
/// beside it), `data.csv` (`roscausal.toml` beside it), `batch/` (a batch's .json) and `live/` (the folder of a demo).
fn poisoned(traps: &Traps) -> tempfile::TempDir {
    let dir = tempfile::tempdir().expect("a folder");
    let at = |name: &str| dir.path().join(name);
    for place in ["metadata", "sidecar", "beside", "batch"] {
        fs::create_dir(at(place)).expect("makes");
    }
    with_settings(&traps.parameters(), &at("metadata/run.mcap"));
    fs::copy(recorded().join("run.mcap"), at("sidecar/run.mcap")).expect("copies");
    fs::write(at("sidecar/run.mcap.roscausal.toml"), traps.toml()).expect("writes");
    fs::copy(recorded().join("run.mcap"), at("beside/run.mcap")).expect("copies");
    fs::write(at("beside/data.csv"), table()).expect("writes");
    fs::write(at("beside/roscausal.toml"), traps.toml()).expect("writes");
    fs::write(at("batch/data_20200101_000000.csv"), table()).expect("writes");
    let parameters = serde_json::json!(traps.parameters());
    let facts = serde_json::json!({"complete": true, "ids": [1], "parameters": parameters, "pp_script": traps.path("post.py"),
        "data_dir": traps.path("raw"), "out": traps.path("models"), "context": []});
    fs::write(at("batch/data_20200101_000000.json"), facts.to_string()).expect("writes");
    let copy =
        Command::new("cp").arg("-r").arg(recorded().join("live")).arg(at("live")).status().expect("copies");
    assert!(copy.success());
    fs::write(at("live/roscausal.toml"), traps.toml()).expect("writes");
    dir
}

/// The command lines that read each place, and whether they succeed.
fn lines() -> Vec<Vec<&'static str>> {
    let discover = |what| vec!["discover", what];
    let report = |what| vec!["report", what, "--output", "OUT/report.html"];
    let mut lines = Vec::new();
    for what in [
        "metadata/run.mcap",
        "metadata",
        "sidecar/run.mcap",
        "beside/run.mcap",
        "beside/data.csv",
        "batch",
        "batch/data_20200101_000000.csv",
        "live",
    ] {
        let of_results = what == "live";
        lines.push([&discover(what)[..], &QUICK, &["--out", "OUT/found"]].concat());
        lines.push([&["roll", what, "--window", "40", "--out", "OUT/rolled"][..], &QUICK].concat());
        if what.ends_with("mcap") || what == "metadata" {
            lines
                .push([&["replay", what, "--ts-length", "10", "--out", "OUT/replayed"][..], &QUICK].concat());
            lines.push(vec!["topics", what]);
        }
        if what != "batch" && what != "metadata" {
            lines.push([&report(what)[..], if of_results { &[] } else { &QUICK }].concat());
        }
    }
    lines
}

/// Runs a line under strace in `dir`; returns its output and what it did that data may not make it do.
fn watched(dir: &Path, line: &[&str]) -> (Output, Vec<String>) {
    let own = tempfile::tempdir().expect("a folder");
    let (out, temporary, trace) =
        (own.path().join("out"), own.path().join("temporary"), own.path().join("trace"));
    fs::create_dir(&out).expect("makes");
    fs::create_dir(&temporary).expect("makes");
    let words = line.iter().map(|word| word.replace("OUT", &out.display().to_string()));
    let output = Command::new("strace")
        .args(["-f", "-qq", "-s", "4096", "-e", "trace=process,network,file", "-o"])
        .arg(&trace)
        .arg(env!("CARGO_BIN_EXE_roscausal"))
        .args(words)
        .current_dir(dir)
        .env("TMPDIR", &temporary)
        .env("XDG_CONFIG_HOME", own.path().join("configuration"))
        .output()
        .expect("strace starts");
    let text = fs::read_to_string(&trace).expect("a trace");
    assert!(text.contains("execve("), "strace saw nothing: {}", stated(&output));
    let allowed = [out.display().to_string(), temporary.display().to_string(), "/dev/".to_owned()];
    let is_bad = |call: &&str| {
        let call = call.split_once(' ').map_or(*call, |(_, call)| call).trim_start();
        let name = call.split('(').next().unwrap_or_default();
        let inside = || allowed.iter().any(|folder| call.contains(&format!("\"{folder}")));
        match name {
            "execve" | "execveat" => !call.contains(env!("CARGO_BIN_EXE_roscausal")),
            "fork" | "vfork" => true,
            "clone" | "clone3" => !call.contains("CLONE_THREAD"),
            "socket" | "bind" | "connect" | "listen" | "socketpair" => true,
            "open" | "openat" | "openat2" | "creat" => {
                ["O_WRONLY", "O_RDWR", "O_CREAT", "O_TRUNC", "O_APPEND"].iter().any(|way| call.contains(way))
                    && !inside()
            }
            "unlink" | "unlinkat" | "rename" | "renameat" | "renameat2" | "mkdir" | "mkdirat" | "rmdir"
            | "link" | "linkat" | "symlink" | "symlinkat" | "truncate" | "chmod" | "fchmodat" => !inside(),
            _ => false,
        }
    };
    let mut bad: Vec<String> = text.lines().filter(is_bad).map(str::to_owned).collect();
    // Calls that name no file: relative to an open folder, which is one of the allowed or has been reported when it was opened.
    bad.retain(|call| !call.contains("unlinkat(") || call.contains("AT_FDCWD"));
    (output, bad)
}

#[test]
#[ignore = "needs strace: tests/safety.sh"]
fn strace_sees_what_the_user_asks_for_on_purpose() {
    let traps = Traps::new();
    let dir = recorded();
    let folder = format!("data.pp_script_dir={}", traps.path(""));
    let args = ["discover", "run.mcap", "--param", "data.postprocess=script", "--param", &folder];
    let (_, bad) = watched(dir, &[&args[..], &["--param", "data.pp_script=post.py"]].concat());
    assert!(bad.iter().any(|call| call.contains("post.py")), "{bad:?}");
    assert!(Path::new(&traps.path("ran")).exists());
}

#[test]
#[ignore = "needs strace: tests/safety.sh"]
fn nothing_that_is_read_runs_a_program_writes_elsewhere_or_opens_a_socket() {
    let traps = Traps::new();
    let dir = poisoned(&traps);
    let before = traps.contents();
    for line in lines() {
        let (output, bad) = watched(dir.path(), &line);
        assert!(bad.is_empty(), "{line:?}\n{bad:#?}\n{}", stated(&output));
        assert!(output.status.success(), "{line:?}: {}", stated(&output));
        assert_eq!(traps.contents(), before, "{line:?}");
    }
}

#[test]
fn what_is_left_out_is_named_once_with_the_flag_that_says_it_on_purpose() {
    let traps = Traps::new();
    let dir = poisoned(&traps);
    for (file, names) in [
        (
            "metadata/run.mcap",
            &["data.pp_script (--param data.pp_script=...)", "discovery.threads (--threads)"][..],
        ),
        ("sidecar/run.mcap", &["data.max_pool_size (--param data.max_pool_size=...)", "--out", "--force"]),
        (
            "beside/data.csv",
            &["--out", "--links", "--threads", "--web", "data.pp_script (--param data.pp_script=...)"],
        ),
    ] {
        let output = roscausal(dir.path(), &[&["discover", file], &QUICK[..]].concat());
        let reported = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{reported}");
        for name in names {
            let times = reported.split([' ', ',', '\n']).collect::<Vec<_>>().join(" ").matches(name).count();
            assert_eq!(times, 1, "{file}: {name}: {reported}");
        }
        let output = roscausal(dir.path(), &[&["discover", file, "--ignore-settings"], &QUICK[..]].concat());
        let reported = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success() && !reported.contains("came with the data"), "{reported}");
    }
}

#[test]
fn three_parameters_beside_the_data_are_three() {
    let dir = tempfile::tempdir().expect("a folder");
    fs::copy(recorded().join("run.mcap"), dir.path().join("run.mcap")).expect("copies");
    let settings = "[data]\nrisk_lag = 0\nrisk_noise = 0.0\nobs_size = 1.5\nrisk_model = 'v1_0'\n";
    fs::write(dir.path().join("roscausal.toml"), settings).expect("writes");
    let reported = |more: &[&str]| {
        let output = roscausal(dir.path(), &[&["discover", "run.mcap"], &QUICK[..], more].concat());
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let all = reported(&[]);
    for parameter in ["risk_lag=0", "risk_noise=0.0", "obs_size=1.5", "risk_model=v1_0"] {
        assert!(all.contains(&format!("--param=data.{parameter}")), "{all}");
    }
    assert!(!reported(&["--ignore-settings"]).contains("risk_lag"));
}

#[test]
fn the_file_in_the_working_folder_is_the_users_own_unless_the_data_lie_there() {
    let dir = tempfile::tempdir().expect("a folder");
    let (work, data) = (dir.path().join("work"), dir.path().join("data"));
    for folder in [&work, &data, &work.join("sub"), &dir.path().join("home/roscausal")] {
        fs::create_dir_all(folder).expect("makes");
    }
    let run = |folder: &Path, file: &str| {
        let output = Command::new(env!("CARGO_BIN_EXE_roscausal"))
            .args([&["discover", file], &QUICK[..]].concat())
            .current_dir(folder)
            .env("XDG_CONFIG_HOME", dir.path().join("home"))
            .output()
            .expect("starts");
        assert!(output.status.success(), "{}", stated(&output));
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    fs::write(data.join("data.csv"), table()).expect("writes");
    fs::write(work.join("sub/data.csv"), table()).expect("writes");
    fs::write(work.join("roscausal.toml"), "out = 'mine'\ntau-max = 2\n").expect("writes");
    let reported = run(&work, "../data/data.csv");
    assert!(reported.contains("settings of roscausal.toml: --out=mine --tau-max=2"), "{reported}");
    assert!(work.join("mine/model.json").exists());
    // The user's own file comes before the stranger's.
    fs::write(data.join("roscausal.toml"), "out = 'theirs'\ntau-max = 3\nalpha = 0.01\n").expect("writes");
    let reported = run(&work, "../data/data.csv");
    assert!(reported.contains("settings of ../data/roscausal.toml: --alpha=0.01\n"), "{reported}");
    assert!(reported.contains("not used") && reported.contains("--out"), "{reported}");
    // Where both are the same folder, it is the stranger's; so it is where the data are a folder beside it.
    fs::remove_dir_all(work.join("mine")).expect("removes");
    fs::write(work.join("data.csv"), table()).expect("writes");
    for file in ["data.csv", "./data.csv", "../work/data.csv", "sub"] {
        let reported = run(&work, file);
        assert!(!work.join("mine").exists(), "{file}: {reported}");
        assert!(
            reported.contains("--tau-max=2") && reported.contains("not about the data: --out"),
            "{file}: {reported}"
        );
    }
    // Data below the working folder, or above it, may be of one archive with its file: that may say where results go within the folder,
    // and nothing that runs, opens or replaces.
    run(&work, "sub/data.csv");
    assert!(work.join("mine/model.json").exists());
    fs::remove_dir_all(work.join("mine")).expect("removes");
    std::os::unix::fs::symlink("../data", work.join("elsewhere")).expect("links");
    std::os::unix::fs::symlink(&data, work.join("sub/elsewhere")).expect("links");
    for out in ["../victim", "sub/../../victim", "/tmp/victim", "elsewhere", "elsewhere/x/y"] {
        let stated =
            "threads = 1\nforce = true\nparam = ['data.postprocess=script']\n[data]\npp_script = 'post.py'\n";
        fs::write(work.join("roscausal.toml"), format!("out = '{out}'\n{stated}")).expect("writes");
        for (folder, file) in [(&work, "sub/data.csv"), (&work.join("sub"), "../data.csv")] {
            fs::copy(work.join("roscausal.toml"), work.join("sub/roscausal.toml")).expect("copies");
            let reported = run(folder, file);
            assert!(
                reported.contains("--threads=1") && !reported.contains("settings of roscausal.toml: --out"),
                "{reported}"
            );
            for left_out in ["--out", "--force", "data.pp_script", "data.postprocess"] {
                assert!(
                    reported.split("not about the data").nth(1).is_some_and(|all| all.contains(left_out)),
                    "{left_out}: {reported}"
                );
            }
        }
    }
    assert!(!data.join("model.json").exists() && !data.join("x").exists());
    fs::remove_file(work.join("sub/roscausal.toml")).expect("removes");
    // Beside tables, what is said of recordings is passed over.
    fs::write(data.join("roscausal.toml"), "tau-max = 3\n[data]\nrisk_lag = 1\n").expect("writes");
    let reported = run(&data, "data.csv");
    assert!(reported.contains("not used for tables: --param data.risk_lag=1"), "{reported}");
    // What is the user's everywhere comes last, and may do more.
    fs::write(dir.path().join("home/roscausal/roscausal.toml"), "tau-max = 4\nthreads = 1\n")
        .expect("writes");
    let reported = run(&data, "data.csv");
    assert!(reported.contains("roscausal/roscausal.toml: --threads=1\n"), "{reported}");
    assert!(!data.join("theirs").exists());
}

#[test]
fn pipes_and_devices_in_a_folder_are_no_data() {
    let dir = tempfile::tempdir().expect("a folder");
    let folder = dir.path().join("z");
    let pipe = |name: &str| Command::new("mkfifo").arg(folder.join(name)).status().expect("mkfifo runs");
    fs::create_dir(&folder).expect("makes");
    fs::write(folder.join("data_1.csv"), table()).expect("writes");
    std::os::unix::fs::symlink("/dev/zero", folder.join("data_2.csv")).expect("links");
    std::os::unix::fs::symlink("/dev/zero", folder.join("walk.mcap")).expect("links");
    for name in ["data_3.csv", "data_1.json", "data_1.roscausal.toml", "roscausal.toml", "walk.bag"] {
        assert!(pipe(name).success(), "{name}");
    }
    for line in [
        &["discover", "z"][..],
        &["discover", "z/data_1.csv"],
        &["roll", "z/data_1.csv", "--window", "100"],
        &["topics", "z"],
        &["replay", "z", "--speed", "0"],
        &["report", "z", "--out", "page"],
    ] {
        let program = env!("CARGO_BIN_EXE_roscausal");
        let mut command = Command::new("timeout");
        command.arg("60").arg(program).args(line).current_dir(dir.path());
        let output = command.output().expect("timeout runs");
        assert!(
            matches!(output.status.code(), Some(0..=2)),
            "{line:?}: {:?} {}",
            output.status,
            stated(&output)
        );
    }
}

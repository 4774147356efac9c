//! Tests of the pool: claims, attempts, limits, and what a killed process leaves behind.

use super::*;

fn pool() -> (tempfile::TempDir, Pool) {
    let dir = tempfile::tempdir().expect("a folder");
    let pool = Pool::open(dir.path().join("pool"), "data_").expect("opens");
    (dir, pool)
}

#[test]
fn batches_come_oldest_first_and_foreign_files_are_told_apart() {
    let (_dir, pool) = pool();
    for name in
        ["data_20240102_000000.csv", "data_20240101_235959.csv", "data_20240101_235959.json", "notes.txt"]
    {
        pool.write(name, b"x").expect("writes");
    }
    fs::write(pool.path(".data_3.csv.tmp"), b"half").expect("writes");
    let contents = pool.contents().expect("lists");
    assert_eq!(contents.batches, ["data_20240101_235959.csv", "data_20240102_000000.csv"]);
    assert_eq!(contents.foreign.into_iter().collect::<Vec<_>>(), ["notes.txt"]);
}

#[test]
fn the_oldest_is_found_by_the_time_in_the_id_whatever_its_format() {
    let (_dir, pool) = pool();
    let pool = pool.with_id_format(IdFormat::new("%d%m%Y_%H%M%S").expect("a format"));
    let names = ["data_31122023_235959.csv", "data_01012024_000000.csv", "data_01012024_000000_2.csv"];
    for name in names {
        pool.write(name, b"x").expect("writes");
    }
    assert_eq!(pool.contents().expect("lists").batches, names);
    let limits = Limits { max_batches: 3, drop_oldest: true, ..Limits::default() };
    assert_eq!(pool.make_room(limits, 1).expect("drops"), Some(vec![names[0].to_owned()]));
    pool.write("data_kitchen.csv", b"x").expect("writes");
    assert_eq!(pool.contents().expect("lists").batches[0], "data_kitchen.csv", "no time: by its name, first");
}

#[test]
fn a_claimed_batch_is_nobody_elses_and_attempts_are_counted() {
    let (_dir, pool) = pool();
    pool.write("data_1.csv", b"x").expect("writes");
    let claim = pool.claim("data_1.csv").expect("claims").expect("is free");
    assert!(pool.claim("data_1.csv").expect("asks").is_none());
    assert_eq!(claim.attempt(), 1);
    drop(claim);
    let again = pool.claim("data_1.csv").expect("claims").expect("is free again");
    assert_eq!(again.attempt(), 2);
    again.abandon().expect("gives back");
    let last = pool.claim("data_1.csv").expect("claims").expect("is free");
    assert_eq!(last.attempt(), 2);
    pool.remove(last).expect("removes");
    assert!(pool.claim("data_1.csv").expect("asks").is_none());
    assert_eq!(fs::read_dir(pool.dir()).expect("lists").count(), 0);
}

#[test]
fn a_rejected_batch_is_kept_with_its_reason() {
    let (_dir, pool) = pool();
    pool.write("data_1.csv", b"x").expect("writes");
    let claim = pool.claim("data_1.csv").expect("claims").expect("is free");
    pool.reject(claim, "line 2 is text").expect("rejects");
    let reason = fs::read_to_string(pool.path("rejected/data_1.csv.reason.txt")).expect("a reason");
    assert_eq!(reason, "line 2 is text\n");
    assert!(pool.path("rejected/data_1.csv").exists() && !pool.path("data_1.csv").exists());
}

#[test]
fn a_name_that_is_taken_gets_a_number_and_stays_in_the_folder() {
    let (_dir, pool) = pool();
    assert_eq!(pool.new_name("../x"), "data_..-x.csv");
    pool.write("data_1.csv", b"x").expect("writes");
    assert_eq!(pool.new_name("1"), "data_1_2.csv");
}

#[test]
fn a_full_pool_drops_its_oldest_batches_or_refuses() {
    let (_dir, pool) = pool();
    let fill =
        || ["data_1.csv", "data_2.csv", "data_3.csv"].iter().for_each(|n| drop(pool.write(n, &[b'x'; 100])));
    fill();
    let limits = Limits { max_batches: 3, max_bytes: 0, drop_oldest: false };
    assert_eq!(pool.make_room(limits, 100).expect("looks"), None);
    assert_eq!(pool.make_room(Limits { max_batches: 4, ..limits }, 100).expect("looks"), Some(vec![]));
    let dropping = Limits { drop_oldest: true, ..limits };
    assert_eq!(pool.make_room(dropping, 100).expect("drops"), Some(vec!["data_1.csv".to_owned()]));
    fill();
    let bytes = Limits { max_batches: 0, max_bytes: 250, drop_oldest: true };
    assert_eq!(pool.make_room(bytes, 100).expect("drops").expect("room").len(), 2);
    assert_eq!(pool.make_room(bytes, 1000).expect("drops").expect("an empty pool").len(), 1);
    assert_eq!(pool.contents().expect("lists").batches.len(), 0);
}

#[test]
fn a_batch_that_is_analysed_is_not_dropped() {
    let (_dir, pool) = pool();
    ["data_1.csv", "data_2.csv"].iter().for_each(|name| drop(pool.write(name, b"x")));
    let claim = pool.claim("data_1.csv").expect("claims");
    let limits = Limits { max_batches: 2, max_bytes: 0, drop_oldest: true };
    assert_eq!(pool.make_room(limits, 1).expect("drops"), Some(vec!["data_2.csv".to_owned()]));
    assert_eq!(pool.make_room(Limits { max_batches: 1, ..limits }, 1).expect("cannot"), None);
    drop(claim);
}

#[test]
fn two_nodes_do_not_record_into_one_folder() {
    let (_dir, pool) = pool();
    let lock = pool.lock_for_recording().expect("is the first");
    let refusal = pool.lock_for_recording().expect_err("is the second").to_string();
    assert!(refusal.contains("another node records into"), "{refusal}");
    drop(lock);
    assert!(pool.lock_for_recording().is_ok());
}

#[test]
fn batches_of_one_model_go_together_even_when_the_process_dies_between() {
    let (_dir, pool) = pool();
    for name in ["data_1.csv", "data_2.csv", "data_3.csv"] {
        pool.write(name, b"x").expect("writes");
    }
    // What a process leaves behind that was killed after the first of two.
    pool.write(".finished-data_1.csv", b"[\"data_1.csv\", \"data_2.csv\", \"data_../../x\"]")
        .expect("writes");
    fs::remove_file(pool.path("data_1.csv")).expect("removes");
    pool.finish_all(None).expect("goes on");
    assert_eq!(pool.contents().expect("lists").batches, ["data_3.csv"]);
    assert_eq!(fs::read_dir(pool.dir()).expect("lists").count(), 1);
}

#[cfg(unix)]
#[test]
fn a_link_with_a_temporary_name_or_that_of_a_lock_is_not_followed() {
    let (dir, pool) = pool();
    let victim = dir.path().join("victim");
    fs::write(&victim, "mine").expect("writes");
    for name in [".data_1.csv.tmp", ".data_1.csv.lock"] {
        std::os::unix::fs::symlink(&victim, pool.path(name)).expect("links");
    }
    pool.stage("data_1.csv", b"a\n1\n").and_then(Staged::publish).expect("is written");
    assert_eq!(fs::read_to_string(pool.path("data_1.csv")).expect("is there"), "a\n1\n");
    assert!(pool.claim("data_1.csv").expect("looks").is_none(), "a link is not a lock");
    assert_eq!(fs::read_to_string(&victim).expect("is there"), "mine");
}

#[test]
fn a_file_that_several_write_at_once_is_one_of_theirs_and_leaves_nothing_beside_it() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("model.json");
    let texts: Vec<Vec<u8>> = (b'a'..b'e').map(|letter| vec![letter; 100_000]).collect();
    std::thread::scope(|scope| {
        for text in &texts {
            scope.spawn(|| (0..20).try_for_each(|_| write_whole(&path, text)).expect("writes"));
        }
    });
    assert!(texts.contains(&fs::read(&path).expect("is there")));
    assert_eq!(fs::read_dir(dir.path()).expect("lists").count(), 1);
}

//! Tables in words: what is read, and what is complained of.

use super::*;

fn parse(text: &str) -> Parsed<Table> {
    Table::parse(text.as_bytes(), &Reading::default())
}

fn complaint(text: &str) -> String {
    match parse(text) {
        Err(Complaint::File(reason)) => reason,
        other => panic!("{text}: {other:?}"),
    }
}

#[test]
fn a_file_of_the_original_with_a_broken_header_is_read() {
    let table = parse("time,r_{gx},r_{,heta},r_v\n1,2,3,4,\n1.3,2,4,4,\n").expect("reads");
    assert_eq!(table.names, ["r_{gx}", "r_{\\theta}", "r_v"]);
    assert_eq!(table.values[[1, 1]], 4.0);
    assert!((table.dt().expect("has times") - 0.3).abs() < 1e-12);
}

#[test]
fn a_header_with_a_real_tab_is_read() {
    let table = parse("r_{\theta},r_v\n1,2\n3,4\n").expect("reads");
    assert_eq!(table.names, ["r_{\\theta}", "r_v"]);
}

#[test]
fn separators_of_other_countries_are_found() {
    assert_eq!(parse("a;b\n1;2\n").expect("reads").names, ["a", "b"]);
    assert_eq!(parse("a\tb\n1\t2\n").expect("reads").names, ["a", "b"]);
}

#[test]
fn a_complaint_names_line_column_and_the_way_out() {
    assert!(complaint("").contains("empty"));
    assert!(complaint("a,b\n").contains("only a header"));
    let reported = roscausal_discovery::spelled_out(&complaint("a,b\n1,2\n3,fast\n"), |id| format!("--{id}"));
    assert_eq!(
        reported,
        "line 3, column 'b': 'fast' is not a number; correct it, leave the cell empty, name the columns to use with \
         --columns, turn words into codes with --encode codes, or, if they say whose a row is, make recordings of them with \
         --recording 'b'"
    );
    assert!(
        complaint("a,b\nm,kg\n1,2\n")
            .contains("'m' is not a number (units, or a second header? remove the line);")
    );
    assert!(complaint("a,b\n1,2\n3\n").starts_with("line 3 has 1 cells, the header has 2 names"));
    assert!(complaint("a,b\n1,2\n1,2,3\n").starts_with("line 3 has 3 cells"));
    assert!(complaint("a,b,a\n1,2,3\n").contains("both column 1 and column 3"));
    assert!(complaint("a,b\n1,inf\n").contains("infinite"));
    assert!(complaint("time,b\n1,2\n0.5,2\n").starts_with("line 3, column 'time': time goes back"));
}

#[test]
fn a_date_and_a_time_of_day_are_one_time_in_either_order() {
    for (header, row) in [("date,time,a", "1970-01-02,00:00:0"), ("time,date,a", "")] {
        let cells = |second: usize| match row.is_empty() {
            true => format!("00:00:0{second},1970-01-02,1\n"),
            false => format!("{row}{second},1\n"),
        };
        let table = parse(&format!("{header}\n{}{}", cells(1), cells(2))).expect("reads");
        assert_eq!((table.names, table.time), (vec!["a".to_owned()], Some(vec![86_401.0, 86_402.0])));
    }
}

#[test]
fn seconds_and_nanoseconds_in_two_columns_are_one_time() {
    for header in ["stamp.sec,stamp.nanosec,a", "header.stamp.secs,header.stamp.nsecs,a", "sec,nsec,a"] {
        let table = parse(&format!("{header}\n100,900000000,1\n101,0,2\n101,100000000,3\n")).expect("reads");
        assert_eq!(
            (table.names, table.time),
            (vec!["a".to_owned()], Some(vec![100.9, 101.0, 101.1])),
            "{header}"
        );
    }
    // Where there is a time, they are columns like others; seconds alone are, too.
    let table = parse("time,sec,nsec,a\n0,100,9,1\n1,101,0,2\n").expect("reads");
    assert_eq!((table.names.len(), table.time), (3, Some(vec![0.0, 1.0])));
    assert_eq!(parse("lap_sec,a\n1,2\n2,3\n").expect("reads").time, None);
}

#[test]
fn prose_before_a_header_behind_a_hash_is_passed_over() {
    let rows = "  260,20200101,  73\n  260,20200102,  41\n  260,20200103,  23\n";
    let table = parse(&format!("BRON: KNMI\nSTN = Station\n\n# STN,YYYYMMDD,  FG\n{rows}")).expect("reads");
    assert_eq!((table.names, table.values[[1, 1]]), (vec!["STN".to_owned(), "FG".to_owned()], 41.0));
    assert_eq!(table.time.map(|time| time[1] - time[0]), Some(steps::DAY));
    // KNMI's own files have a bare `#` between the header and the rows.
    for prose in ["# BRON: KNMI\n#\n", "BRON: KNMI\n\n"] {
        let table = parse(&format!("{prose}# STN,YYYYMMDD,  FG\n# \n{rows}")).expect("reads");
        assert_eq!(table.names, ["STN", "FG"], "{prose}");
    }
    // A comment below a header is a comment.
    let table = parse("a,b,c\n# s,m,m\n1,2,3\n").expect("reads");
    assert_eq!(table.names, ["a", "b", "c"]);
}

#[test]
fn a_later_t_is_a_temperature_and_a_table_on_its_side_is_named_so() {
    let table = parse("n,T,b\n1,20,3\n2,19,4\n").expect("reads");
    assert_eq!((table.names.len(), table.time), (3, None));
    // Also where a number comes twice in the first line.
    for different in [40, 7] {
        let number = |k: usize| format!(",0.{}", 100 + k % different);
        let numbers = |first: &str| (0..40).fold(first.to_owned(), |line, k| line + &number(k)) + "\n";
        let reported = complaint(&[numbers("a"), numbers("b"), numbers("c")].concat());
        assert!(reported.contains("lie on its side"), "{reported}");
    }
}

#[test]
fn a_t_that_is_a_temperature_is_told_how_to_be_one() {
    let reported = complaint("p,t\n1,16.5\n2,15.5\n3,17.0\n");
    assert!(reported.contains("goes back") && reported.contains("none"), "{reported}");
}

#[test]
fn a_date_that_may_be_day_or_month_first_is_named_so() {
    let rows = |date: &str| format!("date,a\n{date}/2026,1\n15/02/2026,2\n");
    assert!(complaint(&rows("01/02")).contains("may be day or month first"));
    assert!(!complaint(&rows("yesterday")).contains("day or month"));
}

#[test]
fn missing_cells_and_constant_columns_are_told() {
    let table = parse("a,b,c\n1,,5\n2,NaN,5\n3,1,5\n").expect("reads");
    assert!(table.values[[0, 1]].is_nan());
    let missing = Note::Missing { column: "b".into(), missing: 2, cells: 3 };
    let constant = |column: &str, value| Note::Constant { column: column.into(), value };
    assert_eq!(table.notes, [missing, constant("b", 1.0), constant("c", 5.0)]);
    assert!(table.notes[0].to_string().starts_with("column 'b': 2 of 3 cells"));
    assert!(table.notes[2].to_string().starts_with("column 'c' is constant (5)"));
}

#[test]
fn recordings_of_one_system_have_one_step() {
    let table = |text: &str| parse(text).expect("reads");
    let (slow, fast) = (table("time,a\n0,1\n0.3,2\n0.6,3\n"), table("time,a\n0,1\n0.1,2\n0.2,3\n"));
    let (jittery, timeless) = (table("time,a\n0,1\n0.301,2\n0.602,3\n"), table("a\n1\n2\n"));
    let step = |tables: &[&Table]| {
        common_step(
            tables.iter().zip(["x.csv", "y.csv", "z.csv"]).map(|(table, name)| (Path::new(name), *table)),
        )
    };
    assert_eq!(step(&[&slow, &jittery]).expect("one step"), slow.dt());
    assert_eq!(step(&[&timeless, &timeless]).expect("none"), None);
    let error = step(&[&slow, &jittery, &fast]).expect_err("two steps").to_string();
    assert!(
        error.contains("z.csv") && error.contains("its step is 0.1 s, that of x.csv is 0.3 s"),
        "{error}"
    );
}

#[test]
fn recordings_with_and_without_times_have_no_common_step_in_any_order() {
    let (timed, timeless) =
        (parse("time,a\n0,1\n0.3,2\n").expect("reads"), parse("a\n1\n2\n").expect("reads"));
    let [x, y] = [("x.csv", &timed), ("y.csv", &timeless)].map(|(name, table)| (Path::new(name), table));
    for (files, reported) in
        [([x, y], "y.csv: it has no times, unlike x.csv"), ([y, x], "x.csv: it has times, unlike y.csv")]
    {
        let error = common_step(files).expect_err("no step of y").to_string();
        assert!(error.contains(reported), "{error}");
    }
}

#[test]
fn to_see_whose_rows_are_words_of_other_columns_are_not_kept() {
    let look = Reading { encode: true, whose: true, ..Reading::default() };
    let read = |text: &str| Table::parse(text.as_bytes(), &look).map_err(Complaint::reason);
    let table = read("frame,ped_id,note,a\n0,anna,waits,1\n0,ben,,2\n1,anna,7,3\n").expect("reads");
    assert_eq!(table.values.column(1).to_vec(), [0.0, 1.0, 0.0]);
    assert!(table.values[[0, 2]].is_nan() && table.values[[2, 2]] == 7.0);
    // Nothing to see, so its rows are not read: one has a cell too many.
    let reason = read("a,note\n1,waits\n2,3,4\n").expect_err("nobody's");
    assert_eq!(reason, "no column says whose a row is");
}

#[test]
fn only_the_wanted_columns_are_read() {
    let wanted = ["h_dg".to_owned(), "h_v".to_owned()];
    let reading = Reading { columns: Some(wanted.to_vec()), ..Reading::default() };
    let table = Table::parse(b"h_v,note,h_dg\n1,fast,2\n2,slow,3\n", &reading).expect("reads");
    assert_eq!(table.names, wanted);
    assert_eq!(table.values[[1, 0]], 3.0);
}

#[test]
fn an_unknown_column_gets_the_nearest_name() {
    let reading = Reading { columns: Some(vec!["h_gd".to_owned()]), ..Reading::default() };
    match Table::parse(b"h_v,h_dg\n1,2\n2,3\n", &reading) {
        Err(Complaint::Setting("columns", reason)) => {
            assert!(reason.contains("did you mean 'h_dg'?"), "{reason}")
        }
        other => panic!("{other:?}"),
    }
}

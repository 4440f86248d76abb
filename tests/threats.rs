//! `THREATS.md` stays true: its rows count up, and each names a test that is there.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// The rows that the table must have at least.
const LEAST: usize = 60;

struct Row {
    number: usize,
    tests: Vec<(String, String)>,
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A row of the table: number, what comes in, what must happen, tests as `file::name` in code marks.
fn row(line: &str) -> Option<Row> {
    let cells: Vec<_> =
        line.strip_prefix('|')?.trim_end().strip_suffix('|')?.split('|').map(str::trim).collect();
    let number = cells.first()?.parse().ok()?;
    assert_eq!(cells.len(), 4, "{line}");
    assert!(cells.iter().all(|cell| !cell.is_empty()), "{line}");
    let named = cells[3].split('`').skip(1).step_by(2).map(|named| {
        let (file, name) = named.split_once("::").unwrap_or_else(|| panic!("{named} names no test"));
        (file.to_owned(), name.to_owned())
    });
    Some(Row { number, tests: named.collect() })
}

fn rows() -> Vec<Row> {
    fs::read_to_string(root().join("THREATS.md")).unwrap().lines().filter_map(row).collect()
}

/// Whether the file has a test of that name: in Rust with its attribute before it, in Python as a function.
fn has_test(file: &str, name: &str) -> bool {
    let text = fs::read_to_string(root().join(file)).unwrap_or_else(|error| panic!("{file}: {error}"));
    if Path::new(file).extension().is_some_and(|kind| kind == "py") {
        return text.lines().any(|line| line.starts_with(&format!("def {name}(")));
    }
    let lines: Vec<_> = text.lines().map(str::trim).collect();
    let is_it = |line: &&str| line.trim_start_matches("async ").starts_with(&format!("fn {name}("));
    let Some(at) = lines.iter().position(is_it) else { return false };
    let attributes =
        lines[..at].iter().rev().take_while(|line| line.starts_with("#[") || line.starts_with("//"));
    attributes.into_iter().any(|line| ["#[test]", "#[tokio::test]"].contains(line))
}

#[test]
fn the_rows_count_up_and_are_at_least_so_many() {
    let numbers: Vec<_> = rows().iter().map(|row| row.number).collect();
    assert_eq!(numbers, (1..=numbers.len()).collect::<Vec<_>>());
    assert!(numbers.len() >= LEAST, "{} rows", numbers.len());
}

#[test]
fn every_row_names_tests_that_are_there() {
    for Row { number, tests } in rows() {
        assert!(!tests.is_empty(), "row {number} names no test");
        for (file, name) in tests {
            assert!(has_test(&file, &name), "row {number}: {file} has no test {name}");
        }
    }
}

#[test]
fn every_fuzz_target_stands_in_the_text() {
    let text = fs::read_to_string(root().join("THREATS.md")).unwrap();
    let targets = fs::read_dir(root().join("fuzz/fuzz_targets")).unwrap();
    let names: BTreeSet<_> = targets
        .map(|target| target.unwrap().path().file_stem().unwrap().to_str().unwrap().to_owned())
        .collect();
    assert!(!names.is_empty() && names.iter().all(|name| text.contains(&format!("`{name}`"))), "{names:?}");
}

#[test]
fn a_test_that_is_not_there_is_missed() {
    let file = "tests/threats.rs";
    assert!(has_test(file, "a_test_that_is_not_there_is_missed"));
    assert!(!has_test(file, "has_test") && !has_test(file, "no_such_test"));
}

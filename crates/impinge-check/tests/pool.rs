//! Children that hang, die, run out of memory or print nonsense: each affects only the row of its
//! mesh.
//!
//! The children here are shell scripts that use the protocol of `serve`.
#![cfg(unix)]

use std::path::PathBuf;
use std::process::Command;
use std::time::Duration;

use impinge::CancelToken;
use impinge_check::{ErrorKind, Pool, PoolError, Row};

/// A row with an error of kind `file`, as a child would print it; `$p` is the path as JSON.
const ANSWER: &str =
    r#"printf '{"path":%s,"welded":true,"error":"seen","error_kind":"file"}\n' "$p""#;

/// Runs a pool of scripts over meshes and returns the rows in the order of the meshes.
fn run(script: &str, names: &[&str], jobs: usize, seconds: f64) -> Result<Vec<Row>, PoolError> {
    let script = script.replace("ANSWER", ANSWER);
    let command = || {
        let mut command = Command::new("sh");
        command.arg("-c").arg(&script);
        command
    };
    let pool = Pool {
        command: &command,
        jobs,
        timeout: Some(Duration::from_secs_f64(seconds)),
        weld: true,
    };
    let paths: Vec<PathBuf> = names.iter().map(PathBuf::from).collect();
    let mut rows = vec![None; names.len()];
    pool.run(&paths, &CancelToken::new(), |ix, row| rows[ix] = Some(row))?;
    Ok(rows.into_iter().map(Option::unwrap).collect())
}

fn kinds(rows: &[Row]) -> Vec<ErrorKind> {
    rows.iter()
        .map(|row| row.result.as_ref().unwrap_err().kind)
        .collect()
}

const LONG: f64 = 120.0;

#[test]
fn many_meshes_go_through_few_children() {
    let names: Vec<String> = (0..100).map(|ix| format!("mesh {ix}")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let rows = run("while read -r p; do ANSWER; done", &names, 3, LONG).unwrap();
    assert!(rows.iter().zip(&names).all(|(row, name)| row.path == *name));
    assert!(kinds(&rows).iter().all(|&kind| kind == ErrorKind::File));
}

#[test]
fn one_that_hangs_is_killed_at_its_time() {
    let script =
        r#"while read -r p; do case $p in *slow*) exec sleep 600;; *) ANSWER;; esac; done"#;
    let rows = run(script, &["a", "slow", "b", "slow too", "c"], 1, 3.0).unwrap();
    use ErrorKind::{File, Timeout};
    assert_eq!(kinds(&rows), [File, Timeout, File, Timeout, File]);
    assert_eq!(
        rows[1].result.as_ref().unwrap_err().message,
        "took longer than 3 s"
    );
}

#[test]
fn one_that_dies_is_tried_once_more_in_a_child_of_its_own() {
    // Each child answers one mesh and dies at the second one; no row shows it.
    let rows = run(
        "read -r p; ANSWER; read -r p; kill -9 $$",
        &["a", "b", "c", "d"],
        1,
        LONG,
    )
    .unwrap();
    assert_eq!(kinds(&rows), [ErrorKind::File; 4]);
    // A child that dies at a certain mesh does so again.
    let script = r#"while read -r p; do case $p in *bad*) echo panicked >&2; kill -9 $$;; *) ANSWER;; esac; done"#;
    let rows = run(script, &["a", "bad", "b"], 1, LONG).unwrap();
    assert_eq!(
        kinds(&rows),
        [ErrorKind::File, ErrorKind::Crash, ErrorKind::File]
    );
    let message = &rows[1].result.as_ref().unwrap_err().message;
    assert!(
        message.contains("signal: 9") && message.ends_with("panicked"),
        "{message}"
    );
}

#[test]
fn one_that_runs_out_of_memory_says_so() {
    let script = "read -r p; echo memory allocation of 99 bytes failed >&2; kill -ABRT $$";
    assert_eq!(
        kinds(&run(script, &["a"], 1, LONG).unwrap()),
        [ErrorKind::Memory]
    );
}

#[test]
fn a_trace_is_no_part_of_the_message() {
    let said =
        r"memory allocation of 9 bytes failed\nstack backtrace:\n   0: f\nnote: Some details";
    let script = format!("read -r p; printf '{said}\\n' >&2; kill -ABRT $$");
    let rows = run(&script, &["a"], 1, LONG).unwrap();
    let message = &rows[0].result.as_ref().unwrap_err().message;
    assert!(
        message.ends_with(": memory allocation of 9 bytes failed"),
        "{message}"
    );
}

#[test]
fn one_that_talks_nonsense_or_nothing_has_crashed() {
    let rows = run("read -r p; echo hello", &["a", "b"], 2, LONG).unwrap();
    assert_eq!(kinds(&rows), [ErrorKind::Crash; 2]);
    let other = r#"read -r p; p='"other"'; ANSWER"#;
    assert_eq!(
        kinds(&run(other, &["a"], 1, LONG).unwrap()),
        [ErrorKind::Crash]
    );
    assert_eq!(
        kinds(&run("exit 0", &["a"], 1, LONG).unwrap()),
        [ErrorKind::Crash]
    );
}

#[test]
fn a_program_that_is_not_there_ends_the_run() {
    let command = || Command::new("/nowhere/impinge");
    let pool = Pool {
        command: &command,
        jobs: 2,
        timeout: None,
        weld: true,
    };
    let ran = pool.run(&["a".into()], &CancelToken::new(), |_, _| {});
    assert!(matches!(ran, Err(PoolError::Start(_))));
}

#[test]
fn cancelling_ends_children_that_hang() {
    let command = || {
        let mut command = Command::new("sh");
        command.args(["-c", "exec sleep 600"]);
        command
    };
    let pool = Pool {
        command: &command,
        jobs: 2,
        timeout: None,
        weld: true,
    };
    let cancel = CancelToken::new();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(Duration::from_millis(200));
            cancel.cancel();
        });
        let ran = pool.run(&["a".into(), "b".into()], &cancel, |_, _| {});
        assert!(matches!(ran, Err(PoolError::Cancelled)));
    });
}

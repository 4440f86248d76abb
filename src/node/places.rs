//! What a middleware says of an error, without where in its source it says so.

/// The words of an error without the places in the middleware's source: Zenoh names them as ` at /.../a.rs:7.`, by the folders of whoever
/// has built the program.
pub(super) fn without_places(text: &str) -> String {
    let mut parts = text.split(" at ");
    let mut words = parts.next().unwrap_or_default().trim_end().to_owned();
    for part in parts {
        let place = part.strip_prefix('/').and_then(|part| part.split_once(".rs:"));
        let line = place.map(|(_, line)| line.trim_start_matches(|c: char| c.is_ascii_digit()));
        match line.and_then(|line| line.strip_prefix('.')) {
            Some(after) => words.push_str(after.trim_end()),
            None => words = format!("{words} at {}", part.trim_end()),
        }
    }
    words
}

#[cfg(test)]
mod tests {
    use super::super::middleware::OpenError;
    use super::*;

    #[test]
    fn the_words_of_an_error_do_not_name_the_folders_of_who_has_built_the_program() {
        let place = " at /home/some body/.cargo/registry/src/zenoh-1.10.2/src/net/orchestrator.rs:447.";
        for (text, words) in [
            (format!("Unable to connect to any of [a]! {place}"), "Unable to connect to any of [a]!"),
            (format!("it{place} - Caused by that{place}"), "it - Caused by that"),
            ("nobody is at /dev/null, at home".to_owned(), "nobody is at /dev/null, at home"),
            ("wrong at /a.rs:7: no end".to_owned(), "wrong at /a.rs:7: no end"),
            (String::new(), ""),
        ] {
            assert_eq!(without_places(&text), words);
        }
        let error = OpenError::opening("a Zenoh session")(format!("none{place}"));
        assert_eq!(error.to_string(), "cannot open a Zenoh session: none");
    }
}

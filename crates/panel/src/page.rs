//! The files of the page. They are part of the program: it asks no other server for anything.

/// A file of the page.
pub struct File {
    /// Its path.
    pub path: &'static str,
    /// Its media type.
    pub media_type: &'static str,
    /// What is in it.
    pub text: &'static str,
}

macro_rules! file {
    ($path:literal, $name:literal, $media_type:literal) => {
        File { path: $path, media_type: $media_type, text: include_str!(concat!("page/", $name)) }
    };
}

/// The page itself: what is in the middle, and what all pages have around it.
macro_rules! html {
    ($middle:literal) => {
        File {
            path: "/",
            media_type: "text/html; charset=utf-8",
            text: concat!(
                include_str!("page/top.html"),
                include_str!(concat!("page/", $middle)),
                include_str!("page/bottom.html")
            ),
        }
    };
}

/// What the pages of a running controller and of commissioning share.
const SHARED: [File; 9] = [
    file!("/panel.css", "panel.css", "text/css; charset=utf-8"),
    file!("/connection.js", "connection.js", "text/javascript; charset=utf-8"),
    file!("/texts.js", "texts.js", "text/javascript; charset=utf-8"),
    file!("/chinese.js", "chinese.js", "text/javascript; charset=utf-8"),
    file!("/frame.js", "frame.js", "text/javascript; charset=utf-8"),
    file!("/units.js", "units.js", "text/javascript; charset=utf-8"),
    file!("/monitor.js", "monitor.js", "text/javascript; charset=utf-8"),
    file!("/plots.js", "plots.js", "text/javascript; charset=utf-8"),
    file!("/icon.svg", "icon.svg", "image/svg+xml"),
];
const CONTROLLER: [File; 4] = [
    html!("controller.html"),
    file!("/page.js", "panel.js", "text/javascript; charset=utf-8"),
    file!("/axes.js", "axes.js", "text/javascript; charset=utf-8"),
    file!("/motion.js", "motion.js", "text/javascript; charset=utf-8"),
];
const BENCH: [File; 3] = [
    html!("bench.html"),
    file!("/page.js", "bench.js", "text/javascript; charset=utf-8"),
    file!("/tasks.js", "tasks.js", "text/javascript; charset=utf-8"),
];

/// The page of a running controller.
pub fn of_controller() -> Vec<&'static File> {
    SHARED.iter().chain(&CONTROLLER).collect()
}

/// The page of commissioning.
pub fn of_bench() -> Vec<&'static File> {
    SHARED.iter().chain(&BENCH).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use takt_rt::{DriveState, OperationMode, Phase, Rule};

    use super::*;
    use takt::telemetry::words;

    fn file(path: &str) -> &'static str {
        text_of(of_controller(), path)
    }

    fn text_of(files: Vec<&'static File>, path: &str) -> &'static str {
        files.into_iter().find(|file| file.path == path).unwrap().text
    }

    /// The rows of the table: a key, and its text in English and in Chinese.
    fn texts() -> BTreeMap<&'static str, (String, String)> {
        let table = file("/texts.js").split_once("TEXTS = {\n").unwrap().1.split_once("\n};").unwrap().0;
        let mut texts = BTreeMap::new();
        for row in table.lines().map(str::trim).filter(|row| !row.is_empty()) {
            let (key, values) = row.strip_suffix(',').unwrap().split_once(": ").unwrap();
            let (english, chinese) =
                serde_json::from_str(values).unwrap_or_else(|error| panic!("{row}: {error}"));
            assert!(texts.insert(key, (english, chinese)).is_none(), "{key} is there twice");
        }
        assert!(texts.len() > 150, "{}", texts.len());
        texts
    }

    #[test]
    fn every_text_is_there_in_english_and_in_chinese_with_the_same_parts() {
        let is_chinese = |text: &str| text.chars().any(|letter| ('\u{4e00}'..='\u{9fff}').contains(&letter));
        for (key, (english, chinese)) in texts() {
            assert!(!english.is_empty() && !chinese.is_empty(), "{key}");
            // The switch names the other language.
            if !["switch_language", "version"].contains(&key) {
                assert!(!is_chinese(&english) && is_chinese(&chinese), "{key}: {english}, {chinese}");
            }
            for part in ["{0}", "{1}", "{2}", "{3}"] {
                assert_eq!(english.contains(part), chinese.contains(part), "{key}: {part}");
            }
        }
    }

    #[test]
    fn what_the_page_shows_has_a_text() {
        let texts = texts();
        let mut wanted: Vec<String> = vec![];
        let pages = [file("/"), text_of(of_bench(), "/")];
        for (page, attribute) in pages.into_iter().flat_map(|page| {
            ["data-text=\"", "data-label=\"", "data-hint=\""].map(|attribute| (page, attribute))
        }) {
            let found = page.split(attribute).skip(1).filter_map(|rest| rest.split_once('"'));
            wanted.extend(found.map(|(key, _)| key.to_owned()));
        }
        let scripts =
            ["/page.js", "/axes.js", "/motion.js", "/plots.js", "/frame.js", "/monitor.js"].map(file);
        let of_bench = ["/page.js", "/tasks.js"].map(|path| text_of(of_bench(), path));
        for script in scripts.into_iter().chain(of_bench) {
            let calls = script
                .split(" text(\"")
                .chain(script.split("(text(\""))
                .filter_map(|rest| rest.split_once('"'));
            wanted.extend(
                calls
                    .map(|(key, _)| key.to_owned())
                    .filter(|key| key.chars().all(|letter| letter.is_ascii_lowercase() || letter == '_')),
            );
        }
        assert!(wanted.len() > 50, "{}", wanted.len());
        wanted.extend(Phase::ALL.map(|phase| format!("phase_{}", words::phase(phase))));
        wanted.extend(
            DriveState::ALL.map(|state| format!("drive_{}", state.name().replace(' ', "_").to_lowercase())),
        );
        wanted.extend(OperationMode::ALL.map(|mode| format!("mode_{}", mode as i8)));
        let faults = Rule::ALL.into_iter().filter(|rule| *rule != Rule::Requested);
        wanted.extend(faults.map(|rule| format!("rule_{}", rule.key())));
        wanted.extend(["normal", "warning", "degraded", "unfit"].map(|level| format!("timing_{level}")));
        wanted
            .extend(["error_active", "error_passive", "bus_off", "down"].map(|state| format!("bus_{state}")));
        let missing: Vec<&String> = wanted.iter().filter(|key| !texts.contains_key(&***key)).collect();
        assert!(missing.is_empty(), "{missing:?}");
    }
}

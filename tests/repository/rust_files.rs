//! Rust files of the repository, and the words in them.

use std::fs;
use std::path::{Path, PathBuf};

/// A file of the repository as messages name it.
pub fn shown(path: &Path) -> String {
    path.strip_prefix(env!("CARGO_MANIFEST_DIR")).unwrap().display().to_string()
}

/// The Rust files below a folder of the repository.
pub fn rust_files(folder: &str) -> Vec<PathBuf> {
    fn add(directory: &Path, to: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(directory).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                add(&path, to);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                to.push(path);
            }
        }
    }
    let mut all = vec![];
    add(&Path::new(env!("CARGO_MANIFEST_DIR")).join(folder), &mut all);
    all.sort();
    assert!(all.len() > 10, "{folder}/ was not found");
    all
}

/// The names and signs of a Rust text with their lines, without comments, texts and characters.
pub fn words(text: &str) -> Vec<(String, usize)> {
    let letters: Vec<char> = text.chars().collect();
    let letter = |at: usize| letters.get(at).copied().unwrap_or('\0');
    let is_of_name = |letter: char| letter.is_alphanumeric() || letter == '_';
    let (mut words, mut at, mut line) = (vec![], 0, 1);
    while at < letters.len() {
        let begin = at;
        match (letter(at), letter(at + 1)) {
            ('/', '/') => {
                while at < letters.len() && letter(at) != '\n' {
                    at += 1;
                }
            }
            ('/', '*') => {
                let mut depth = 1;
                at += 2;
                while depth > 0 && at < letters.len() {
                    match (letter(at), letter(at + 1)) {
                        ('/', '*') => (depth, at) = (depth + 1, at + 2),
                        ('*', '/') => (depth, at) = (depth - 1, at + 2),
                        _ => at += 1,
                    }
                }
            }
            ('r', '"' | '#') if letter(at + 1) == '"' || matches!(letter(at + 2), '"' | '#') => {
                let hashes = (at + 1..).take_while(|place| letter(*place) == '#').count();
                let end: String = std::iter::once('"').chain("#".repeat(hashes).chars()).collect();
                at += hashes + 2;
                while at < letters.len()
                    && !end.chars().zip(at..).all(|(of_end, place)| of_end == letter(place))
                {
                    at += 1;
                }
                at += end.len();
            }
            ('"', _) => {
                at += 1;
                while at < letters.len() && letter(at) != '"' {
                    at += if letter(at) == '\\' { 2 } else { 1 };
                }
                at += 1;
            }
            ('\'', '\\') => {
                at += 3;
                while at < letters.len() && letter(at) != '\'' {
                    at += 1;
                }
                at += 1;
            }
            ('\'', _) if letter(at + 2) == '\'' => at += 3,
            (':', ':') => {
                words.push(("::".to_owned(), line));
                at += 2;
            }
            (first, _) if is_of_name(first) => {
                while is_of_name(letter(at)) {
                    at += 1;
                }
                words.push((letters[begin..at].iter().collect(), line));
            }
            (sign, _) => {
                if !sign.is_whitespace() {
                    words.push((sign.to_string(), line));
                }
                at += 1;
            }
        }
        line += letters[begin..at.min(letters.len())].iter().filter(|letter| **letter == '\n').count();
    }
    words
}

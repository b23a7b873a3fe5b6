//! The rows of the tables in this folder.

/// The columns of a line; commas within quotation marks do not divide them.
pub fn columns(line: &str) -> Vec<String> {
    let mut columns = vec![String::new()];
    let mut is_quoted = false;
    for character in line.chars() {
        match character {
            '"' => is_quoted = !is_quoted,
            ',' if !is_quoted => columns.push(String::new()),
            _ => columns.last_mut().unwrap().push(character),
        }
    }
    columns
}

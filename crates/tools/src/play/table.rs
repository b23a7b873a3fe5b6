//! Comma-separated values as RFC 4180 has them: cells in quotes may hold commas, line breaks and doubled quotes. Lines end with
//! LF, CRLF or the file. A byte-order mark, spaces around cells, and lines without any text are passed over.

use super::error::{FileProblem, PlayFileError};

/// A cell, and where it begins: both counted from 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Cell {
    pub text: String,
    pub line: usize,
    pub column: usize,
}

/// The rows of a text. None of them is without a cell.
pub(super) fn rows(text: &str) -> Result<Vec<Vec<Cell>>, PlayFileError> {
    let mut reader = Reader { rest: text.strip_prefix('\u{feff}').unwrap_or(text), line: 1, column: 1 };
    let mut rows = Vec::new();
    while !reader.rest.is_empty() {
        let row = reader.row()?;
        if row.len() > 1 || row.iter().any(|cell| !cell.text.is_empty()) {
            rows.push(row);
        }
    }
    Ok(rows)
}

/// What is still to be read, and where it begins.
struct Reader<'a> {
    rest: &'a str,
    line: usize,
    column: usize,
}

impl Reader<'_> {
    fn next(&mut self) -> Option<char> {
        let letter = self.rest.chars().next()?;
        self.rest = self.rest.get(letter.len_utf8()..).unwrap_or("");
        if letter == '\n' {
            (self.line, self.column) = (self.line + 1, 1);
        } else {
            self.column += 1;
        }
        Some(letter)
    }

    fn begins_with(&self, letter: char) -> bool {
        self.rest.starts_with(letter)
    }

    fn ends_line(&self) -> bool {
        self.rest.is_empty() || self.begins_with('\n') || self.rest.starts_with("\r\n")
    }

    fn skip_spaces(&mut self) {
        while self.begins_with(' ') || self.begins_with('\t') {
            self.next();
        }
    }

    fn error(&self, problem: FileProblem) -> PlayFileError {
        PlayFileError { line: self.line, column: Some(self.column), problem }
    }

    /// A row up to the end of its line.
    fn row(&mut self) -> Result<Vec<Cell>, PlayFileError> {
        let mut cells = vec![self.cell()?];
        while self.begins_with(',') {
            self.next();
            cells.push(self.cell()?);
        }
        while !self.rest.is_empty() && self.next() != Some('\n') {}
        Ok(cells)
    }

    /// A cell up to the comma behind it, or to the end of the line.
    fn cell(&mut self) -> Result<Cell, PlayFileError> {
        self.skip_spaces();
        let (line, column) = (self.line, self.column);
        let text = if self.begins_with('"') { self.quoted()? } else { self.plain() };
        if !self.begins_with(',') && !self.ends_line() {
            return Err(self.error(FileProblem::BehindQuote));
        }
        Ok(Cell { text, line, column })
    }

    fn plain(&mut self) -> String {
        let mut text = String::new();
        while !self.begins_with(',') && !self.ends_line() {
            text.extend(self.next());
        }
        text.truncate(text.trim_end().len());
        text
    }

    fn quoted(&mut self) -> Result<String, PlayFileError> {
        let unclosed = self.error(FileProblem::UnclosedQuote);
        let mut text = String::new();
        self.next();
        loop {
            match self.next() {
                None => return Err(unclosed),
                Some('"') if self.begins_with('"') => {
                    self.next();
                    text.push('"');
                }
                Some('"') => break,
                Some(letter) => text.push(letter),
            }
        }
        self.skip_spaces();
        Ok(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(text: &str) -> Vec<Vec<String>> {
        let rows = rows(text).unwrap();
        rows.into_iter().map(|row| row.into_iter().map(|cell| cell.text).collect()).collect()
    }

    #[test]
    fn cells_are_read_whatever_ends_the_lines_and_stands_around_them() {
        let expected = [["a", "b c", ""], ["1", "", "3"]];
        for text in [
            "a,b c,\n1,,3\n",
            "a,b c,\r\n1,,3\r\n",
            "\u{feff}a , b c,\t\n\n 1,, 3",
            "\"a\",\"b c\",\"\"\r\n\r\n\"1\" ,,3",
        ] {
            assert_eq!(texts(text), expected, "{text:?}");
        }
        assert_eq!(texts(""), Vec::<Vec<String>>::new());
        assert_eq!(texts("\u{feff}\r\n \n"), Vec::<Vec<String>>::new());
    }

    #[test]
    fn a_cell_in_quotes_may_hold_anything() {
        assert_eq!(texts("\"a,\"\"b\"\"\nc\",d"), [["a,\"b\"\nc", "d"]]);
    }

    #[test]
    fn cells_know_their_place_and_wrong_quotes_are_refused_at_theirs() {
        let rows = rows("α, b\n\"x\ny\",\"z\"\n").unwrap();
        let places: Vec<(usize, usize)> =
            rows.iter().flatten().map(|cell| (cell.line, cell.column)).collect();
        assert_eq!(places, [(1, 1), (1, 4), (2, 1), (3, 4)]);
        let refused = |text: &str| {
            let error = super::rows(text).unwrap_err();
            (error.line, error.column, error.problem)
        };
        assert_eq!(refused("a,b\n1,\"2"), (2, Some(3), FileProblem::UnclosedQuote));
        assert_eq!(refused("a,b\n\"1\"0,2"), (2, Some(4), FileProblem::BehindQuote));
    }
}

//! Tables with aligned columns that fit the terminal. Where it is too narrow for the columns, each row is a sentence.

use std::fmt;

use comfy_table::{CellAlignment, ColumnConstraint, ContentArrangement, Width, presets};

use super::columns::{broken, columns};

/// A table. A heading that begins with `>` makes its column one that is aligned to the right. Where a row is too long for the
/// terminal, cells are broken between words.
#[derive(Debug)]
pub struct Table {
    table: comfy_table::Table,
    headings: Vec<&'static str>,
    /// Of each column, the letters of its longest word.
    longest_words: Vec<usize>,
}

/// A space at which a cell is not broken.
pub const UNBROKEN: char = '\u{a0}';

/// The letters of a word that is broken nowhere.
const LONGEST_UNBROKEN: u16 = 14;

/// The spaces before each column.
const GAP: u16 = 2;

/// The spaces before the second line of a row that is a sentence.
const BELOW: usize = 6;

impl Table {
    /// A table with these headings.
    pub fn new<const N: usize>(headings: [&'static str; N]) -> Self {
        let mut table = comfy_table::Table::new();
        table
            .load_preset(presets::NOTHING)
            .set_header(headings.map(|heading| heading.trim_start_matches('>')));
        for (column, heading) in table.column_iter_mut().zip(headings) {
            column.set_padding((GAP, 0));
            if heading.starts_with('>') {
                column.set_cell_alignment(CellAlignment::Right);
            }
        }
        let longest_words = headings.map(longest_word).to_vec();
        Self {
            table,
            headings: headings.map(|heading| heading.trim_start_matches('>')).to_vec(),
            longest_words,
        }
    }

    /// Adds a row.
    pub fn row<const N: usize>(&mut self, cells: [String; N]) {
        for (longest, cell) in self.longest_words.iter_mut().zip(&cells) {
            *longest = longest_word(cell).max(*longest);
        }
        self.table.add_row(cells);
    }

    /// The text for a terminal of so many columns; without them, each row in one line.
    fn fitted(&self, columns: Option<u16>) -> String {
        let mut table = self.table.clone();
        if let Some(columns) = columns {
            table.set_content_arrangement(ContentArrangement::Dynamic).set_width(columns);
            for (column, longest) in table.column_iter_mut().zip(&self.longest_words) {
                let word = u16::try_from(*longest).unwrap_or(u16::MAX).min(LONGEST_UNBROKEN);
                let width = word.saturating_add(GAP);
                column.set_constraint(ColumnConstraint::LowerBoundary(Width::Fixed(width)));
            }
        }
        let text = table.trim_fmt().replace(UNBROKEN, " ");
        match columns.map(usize::from) {
            Some(columns) if text.lines().any(|line| line.chars().count() > columns) => {
                self.sentences(columns)
            }
            _ => text,
        }
    }

    /// Each row as a sentence: its first cell, then the headings of the others with what they have.
    fn sentences(&self, columns: usize) -> String {
        let sentence = |row: &comfy_table::Row| {
            let mut cells = row.cell_iter().map(comfy_table::Cell::content).zip(&self.headings);
            let first = cells.next().map_or(String::new(), |(cell, _)| cell);
            let others = cells.filter(|(cell, _)| !matches!(cell.as_str(), "" | "-"));
            let others: Vec<String> = others.map(|(cell, heading)| format!("{heading} {cell}")).collect();
            let sentence = format!("{}{first}: {}", " ".repeat(GAP.into()), others.join("; "));
            broken(&sentence, BELOW, columns).replace(UNBROKEN, " ")
        };
        self.table.row_iter().map(sentence).collect::<Vec<_>>().join("\n")
    }
}

fn longest_word(text: &str) -> usize {
    text.trim_start_matches('>').split(' ').map(|word| word.chars().count()).max().unwrap_or(0)
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.fitted(columns()))
    }
}

#[cfg(test)]
mod tests {
    use super::{Table, UNBROKEN};

    #[test]
    fn words_are_aligned_to_the_left_and_numbers_to_the_right() {
        let mut table = Table::new(["name", ">µs"]);
        table.row(["a".to_owned(), "5".to_owned()]);
        table.row(["longer".to_owned(), "1000".to_owned()]);
        assert_eq!(table.fitted(None), "  name      µs\n  a          5\n  longer  1000");
    }

    #[test]
    fn a_number_stays_with_its_unit() {
        let mut table = Table::new(["name", ">torque"]);
        table.row(["a longer name".to_owned(), format!("87.0{UNBROKEN}Nm")]);
        assert!(table.fitted(Some(18)).contains("87.0 Nm"), "{}", table.fitted(Some(18)));
    }

    #[test]
    fn a_row_that_is_too_long_is_broken_between_words() {
        let mut table = Table::new(["name", "what the drive does", ">counts at full speed"]);
        table.row(["joint1".to_owned(), "holds its last set-point".to_owned(), "199.6".to_owned()]);
        let text = table.fitted(Some(36));
        assert!(text.lines().all(|line| line.chars().count() <= 36), "{text}");
        assert!(text.contains("joint1") && text.contains("set-point") && text.contains("199.6"), "{text}");
    }

    #[test]
    fn where_the_columns_find_no_room_each_row_is_a_sentence() {
        let mut table = Table::new(["axis", "unit", ">lowest", ">highest", ">jerk"]);
        table.row(["joint1", "deg", "-170.00", "170.00", "-"].map(str::to_owned));
        table.row(["joint2", "mm", "0.00", "800.00", "5.0"].map(str::to_owned));
        let text = table.fitted(Some(30));
        assert!(text.lines().all(|line| line.chars().count() <= 30), "{text}");
        assert_eq!(
            text.replace("\n      ", " "),
            "  joint1: unit deg; lowest -170.00; highest 170.00\n  joint2: unit mm; lowest 0.00; highest 800.00; jerk 5.0"
        );
    }
}

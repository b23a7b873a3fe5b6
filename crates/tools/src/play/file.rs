//! Reads a file of points: what the columns of a table mean, and its rows as numbers.

use std::io;
use std::path::Path;

use takt_wire::text_file;

use super::error::{FileProblem, PlayFileError};
use super::joint_trajectory;
use super::points::{JointColumns, JointPoint, LONGEST_S, PlayFile, PlayRow};
use super::table::{self, Cell};

/// Reads the bytes of a file of points.
///
/// # Errors
/// It cannot be read, is no regular file, or is longer than 64 MiB.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    text_file::read(path)
}

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Column {
    Arrive,
    At,
    /// When it is meant for; it is there from the start.
    FromStart,
    Chunk,
    /// Of an axis.
    Joint(usize, JointQuantity),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum JointQuantity {
    Position,
    Velocity,
    Acceleration,
    Torque,
}

/// The suffixes of the columns of a joint.
const SUFFIXES: [(JointQuantity, &str); 5] = [
    (JointQuantity::Position, ""),
    (JointQuantity::Position, ".position"),
    (JointQuantity::Velocity, ".velocity"),
    (JointQuantity::Acceleration, ".acceleration"),
    (JointQuantity::Torque, ".torque"),
];

impl PlayFile {
    /// Reads a file, for axes with these names.
    ///
    /// # Errors
    /// The first problem of the file, with its line and column.
    pub fn parse(bytes: &[u8], axes: &[String]) -> Result<Self, PlayFileError> {
        let text = std::str::from_utf8(bytes).map_err(|error| {
            let before = bytes.get(..error.valid_up_to()).unwrap_or_default();
            let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
            PlayFileError { line, column: None, problem: FileProblem::NotText }
        })?;
        if joint_trajectory::is_message(text) {
            return joint_trajectory::parse(text, axes);
        }
        let rows = table::rows(text)?;
        let Some((header, rows)) = rows.split_first() else {
            return Err(PlayFileError { line: 1, column: None, problem: FileProblem::Empty });
        };
        let header = Header::read(header, axes)?;
        let mut read: Vec<PlayRow> = Vec::with_capacity(rows.len());
        for cells in rows {
            let row = header.row(cells)?;
            if let Some(previous) = read.last().filter(|previous| row.arrive_s < previous.arrive_s) {
                let problem =
                    FileProblem::ArrivalOrder { arrive_s: row.arrive_s, previous_s: previous.arrive_s };
                return Err(at(header.cell_of(cells, Column::Arrive), problem));
            }
            read.push(row);
        }
        if read.is_empty() {
            return Err(PlayFileError { line: header.line + 1, column: None, problem: FileProblem::NoRow });
        }
        let is_trajectory = header.place(Column::FromStart).is_some();
        Ok(Self { torque_column: header.torque_column(), joints: header.joints, rows: read, is_trajectory })
    }
}

fn at(cell: Option<&Cell>, problem: FileProblem) -> PlayFileError {
    let (line, column) = cell.map_or((1, None), |cell| (cell.line, Some(cell.column)));
    PlayFileError { line, column, problem }
}

/// The columns, with their names as they are written, and their places.
struct Header {
    line: usize,
    columns: Vec<(Column, String)>,
    places: Vec<usize>,
    /// The joints in the order of their positions.
    joints: Vec<JointColumns>,
}

impl Header {
    fn read(cells: &[Cell], axes: &[String]) -> Result<Self, PlayFileError> {
        let mut columns: Vec<(Column, String)> = Vec::with_capacity(cells.len());
        for cell in cells {
            let Some(column) = column_of(&cell.text, axes) else {
                let problem = FileProblem::UnknownColumn { name: cell.text.clone(), joints: axes.to_vec() };
                return Err(at(Some(cell), problem));
            };
            if columns.iter().any(|(other, _)| *other == column) {
                return Err(at(Some(cell), FileProblem::RepeatedColumn { name: cell.text.clone() }));
            }
            columns.push((column, cell.text.clone()));
        }
        let line = cells.first().map_or(1, |cell| cell.line);
        let places = cells.iter().map(|cell| cell.column).collect();
        let header = Self { line, joints: joints_of(&columns), columns, places };
        let other_time = |(column, _): &(Column, String)| matches!(column, Column::Arrive | Column::At);
        if header.place(Column::FromStart).is_some()
            && let Some(place) = header.columns.iter().position(other_time)
        {
            let name = header.columns.get(place).map(|(_, name)| name.clone()).unwrap_or_default();
            return Err(at(cells.get(place), FileProblem::TwoTimes { name }));
        }
        let missing = |problem| PlayFileError { line, column: None, problem };
        let has_own_start = header.place(Column::FromStart).is_some();
        for (column, name) in [(Column::Arrive, "arrive"), (Column::At, "at")] {
            if header.place(column).is_none() && !has_own_start {
                return Err(missing(FileProblem::MissingColumn { name }));
            }
        }
        if !header.columns.iter().any(|(column, _)| matches!(column, Column::Joint(..))) {
            return Err(missing(FileProblem::NoJoint { joints: axes.to_vec() }));
        }
        header.check_companions(cells, axes)?;
        Ok(header)
    }

    /// Checks that each joint has a position, and a velocity where it has an acceleration.
    fn check_companions(&self, cells: &[Cell], axes: &[String]) -> Result<(), PlayFileError> {
        for ((column, name), cell) in self.columns.iter().zip(cells) {
            let Column::Joint(axis, quantity) = *column else { continue };
            let needs = match quantity {
                JointQuantity::Acceleration => &[JointQuantity::Position, JointQuantity::Velocity][..],
                _ => &[JointQuantity::Position],
            };
            for needed in needs {
                if self.place(Column::Joint(axis, *needed)).is_none() {
                    let suffix = SUFFIXES
                        .iter()
                        .find(|(quantity, _)| quantity == needed)
                        .map_or("", |(_, suffix)| suffix);
                    let needed = format!("{}{suffix}", axes.get(axis).map_or("", String::as_str));
                    return Err(at(Some(cell), FileProblem::WithoutColumn { name: name.clone(), needed }));
                }
            }
        }
        Ok(())
    }

    fn place(&self, column: Column) -> Option<usize> {
        self.columns.iter().position(|(other, _)| *other == column)
    }

    fn cell_of<'a>(&self, cells: &'a [Cell], column: Column) -> Option<&'a Cell> {
        cells.get(self.place(column)?)
    }

    fn torque_column(&self) -> Option<usize> {
        let is_torque = |column: &Column| matches!(column, Column::Joint(_, JointQuantity::Torque));
        let index = self.columns.iter().position(|(column, _)| is_torque(column))?;
        self.places.get(index).copied()
    }

    fn row(&self, cells: &[Cell]) -> Result<PlayRow, PlayFileError> {
        let line = cells.first().map_or(self.line, |cell| cell.line);
        let (given, columns) = (cells.len(), self.columns.len());
        if given != columns {
            let problem = FileProblem::CellCount { cells: given, columns };
            return Err(PlayFileError { line, column: None, problem });
        }
        let time = |column: Column, name: &'static str, lowest: f64| {
            let time_s = self.needed(cells, column)?;
            if (lowest..=LONGEST_S).contains(&time_s) {
                Ok(time_s)
            } else {
                Err(at(self.cell_of(cells, column), FileProblem::Time { name, time_s }))
            }
        };
        let point = |joint: &JointColumns| {
            let of = |quantity| self.number(cells, Column::Joint(joint.axis, quantity));
            Ok(JointPoint {
                position: self.needed(cells, Column::Joint(joint.axis, JointQuantity::Position))?,
                velocity: of(JointQuantity::Velocity)?,
                acceleration: of(JointQuantity::Acceleration)?,
                torque: of(JointQuantity::Torque)?,
            })
        };
        let (arrive_s, at_s) = if self.place(Column::FromStart).is_some() {
            let at_s = time(Column::FromStart, "time_from_start", 0.0)?;
            (at_s, at_s)
        } else {
            (time(Column::Arrive, "arrive", 0.0)?, time(Column::At, "at", -LONGEST_S)?)
        };
        Ok(PlayRow {
            line,
            arrive_s,
            at_s,
            chunk: self.chunk(cells)?,
            points: self.joints.iter().map(point).collect::<Result<_, PlayFileError>>()?,
        })
    }

    fn chunk(&self, cells: &[Cell]) -> Result<Option<u64>, PlayFileError> {
        let Some(cell) = self.cell_of(cells, Column::Chunk).filter(|cell| !cell.text.is_empty()) else {
            return Ok(None);
        };
        match cell.text.parse() {
            Ok(chunk) => Ok(Some(chunk)),
            Err(_) => Err(at(Some(cell), FileProblem::Chunk { text: cell.text.clone() })),
        }
    }

    /// The number in a column; `None` where there is no such column or the cell is empty.
    fn number(&self, cells: &[Cell], column: Column) -> Result<Option<f64>, PlayFileError> {
        let Some(cell) = self.cell_of(cells, column).filter(|cell| !cell.text.is_empty()) else {
            return Ok(None);
        };
        match cell.text.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(Some(number)),
            _ => {
                let problem = FileProblem::NotANumber { name: self.name(column), text: cell.text.clone() };
                Err(at(Some(cell), problem))
            }
        }
    }

    fn needed(&self, cells: &[Cell], column: Column) -> Result<f64, PlayFileError> {
        let number = self.number(cells, column)?;
        number.ok_or_else(|| {
            at(self.cell_of(cells, column), FileProblem::EmptyCell { name: self.name(column) })
        })
    }

    fn name(&self, column: Column) -> String {
        self.place(column)
            .and_then(|place| self.columns.get(place))
            .map_or_else(String::new, |(_, name)| name.clone())
    }
}

/// The joints in the order of their positions in the header.
fn joints_of(columns: &[(Column, String)]) -> Vec<JointColumns> {
    let has = |axis, quantity| columns.iter().any(|(column, _)| *column == Column::Joint(axis, quantity));
    let joints = columns.iter().filter_map(|(column, _)| match column {
        Column::Joint(axis, JointQuantity::Position) => Some(*axis),
        _ => None,
    });
    joints
        .map(|axis| JointColumns {
            axis,
            has_velocity: has(axis, JointQuantity::Velocity),
            has_acceleration: has(axis, JointQuantity::Acceleration),
            has_torque: has(axis, JointQuantity::Torque),
        })
        .collect()
}

/// What a column of this name holds. The name of a joint may have a dot in it.
fn column_of(name: &str, axes: &[String]) -> Option<Column> {
    match name {
        "arrive" => return Some(Column::Arrive),
        "at" => return Some(Column::At),
        "time_from_start" => return Some(Column::FromStart),
        "chunk" => return Some(Column::Chunk),
        _ => {}
    }
    SUFFIXES.iter().find_map(|(quantity, suffix)| {
        let joint = name.strip_suffix(suffix)?;
        let axis = axes.iter().position(|axis| axis == joint)?;
        Some(Column::Joint(axis, *quantity))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axes() -> Vec<String> {
        ["shoulder", "elbow", "wrist.roll"].map(str::to_owned).to_vec()
    }

    fn parse(text: &str) -> PlayFile {
        PlayFile::parse(text.as_bytes(), &axes()).unwrap()
    }

    /// Line, column and problem.
    fn refused(text: &str) -> (usize, Option<usize>, String) {
        let error = PlayFile::parse(text.as_bytes(), &axes()).unwrap_err();
        (error.line, error.column, error.problem.to_string())
    }

    #[test]
    fn columns_are_found_by_their_names_in_any_order() {
        let file = parse(
            "at,elbow.velocity,arrive,elbow,wrist.roll,chunk\n0.1,2,0.05,1,-3,7\n0.2,,0.05,1.5,-3.5,\n",
        );
        assert_eq!(file.joints.iter().map(|joint| joint.axis).collect::<Vec<_>>(), [1, 2]);
        assert_eq!(file.joints.iter().map(|joint| joint.has_velocity).collect::<Vec<_>>(), [true, false]);
        let first = &file.rows[0];
        assert_eq!((first.line, first.arrive_s, first.at_s, first.chunk), (2, 0.05, 0.1, Some(7)));
        assert_eq!(
            first.points[0],
            JointPoint { position: 1.0, velocity: Some(2.0), ..JointPoint::default() }
        );
        assert_eq!(first.points[1], JointPoint { position: -3.0, ..JointPoint::default() });
        let second = &file.rows[1];
        assert_eq!((second.chunk, second.points[0].velocity, second.points[0].position), (None, None, 1.5));
    }

    #[test]
    fn a_table_with_time_from_start_is_a_trajectory() {
        let file = parse("time_from_start,elbow,shoulder.position,elbow.velocity\n0,1,2,0\n1.5,1.2,2.1,0\n");
        assert!(file.is_trajectory && !parse("arrive,at,elbow\n0,0,1\n").is_trajectory);
        assert_eq!(
            file.rows.iter().map(|row| (row.arrive_s, row.at_s)).collect::<Vec<_>>(),
            [(0.0, 0.0), (1.5, 1.5)]
        );
        assert_eq!((file.duration_s(), file.rows[1].points[1].position), (1.5, 2.1));
        let (line, column, words) = refused("time_from_start,at,elbow\n0,0,1\n");
        assert_eq!((line, column), (1, Some(17)), "{words}");
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line_and_column() {
        let problem = |text: &str, line: usize, column: Option<usize>, words: &str| {
            let (found_line, found_column, found) = refused(text);
            assert_eq!((found_line, found_column), (line, column), "{text:?}: {found}");
            assert!(found.contains(words), "{found}");
        };
        problem("", 1, None, "empty");
        problem("\r\n\n", 1, None, "empty");
        problem("arrive,at,elbow\n", 2, None, "no row");
        problem("at,elbow\n0,0\n", 1, None, "`arrive`");
        problem("arrive,elbow\n0,0\n", 1, None, "`at`");
        problem("arrive,at\n0,0\n", 1, None, "no joint; the joints are shoulder, elbow, wrist.roll");
        problem("arrive,at,knee\n0,0,0\n", 1, Some(11), "`knee` is not known");
        problem("arrive,at,elbow,elbow\n", 1, Some(17), "comes twice");
        problem("arrive,at,elbow.velocity\n", 1, Some(11), "needs one of `elbow`");
        problem("arrive,at,elbow,elbow.acceleration\n", 1, Some(17), "needs one of `elbow.velocity`");
        problem("arrive,at,elbow\n0,0\n", 2, None, "2 cells");
        problem("arrive,at,elbow\n0,0,0\n\n0,0.1, x1\n", 4, Some(8), "`x1`");
        problem("arrive,at,elbow\n0,0,NaN\n", 2, Some(5), "not a finite number: `NaN`");
        problem("arrive,at,elbow\n0,inf,0\n", 2, Some(3), "`at` is not a finite number");
        problem("arrive,at,elbow\n0,0,\n", 2, Some(5), "`elbow` has no value");
        problem("arrive,at,elbow\n-0.5,0,0\n", 2, Some(1), "`arrive` is -0.5 s");
        problem("arrive,at,elbow\n0,1e12,0\n", 2, Some(3), "`at` is 1000000000000 s");
        problem("arrive,at,elbow\n0.2,0,0\n0.1,0,0\n", 3, Some(1), "order of their arrival");
        problem("arrive,at,elbow,chunk\n0,0,0,1.5\n", 2, Some(7), "whole number: `1.5`");
        let error = PlayFile::parse(b"arrive,at,elbow\n0,0,\xff\n", &axes()).unwrap_err();
        assert_eq!((error.line, error.problem), (2, FileProblem::NotText));
    }
}

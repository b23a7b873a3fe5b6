//! The axes: a line each, with as many columns as there is room for.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Modifier, Style};
use ratatui::text::Line;
use ratatui::widgets::{Paragraph, Widget};
use takt_rt::{AxisLimits, AxisSnapshot, DriveState, Nanoseconds, OperationMode};

use super::palette::Palette;
use super::times::duration;
use crate::top::model::Model;
use takt::telemetry::Unit;

/// The columns of a name.
const NAME: usize = 12;
/// The columns of a bar, at least and at most.
const BAR: (usize, usize) = (8, 40);

/// A column beside name, position, bar and state, in the order of importance.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Column {
    Error,
    Torque,
    Velocity,
    Temperature,
    Mode,
    Current,
    Age,
}

impl Column {
    const ALL: [Self; 7] =
        [Self::Error, Self::Torque, Self::Velocity, Self::Temperature, Self::Mode, Self::Current, Self::Age];

    const fn heading(self) -> &'static str {
        match self {
            Self::Error => "follow.err",
            Self::Torque => "torque",
            Self::Velocity => "velocity",
            Self::Temperature => "temp.",
            Self::Mode => "mode",
            Self::Current => "current",
            Self::Age => "age",
        }
    }

    const fn columns(self) -> usize {
        match self {
            Self::Error => 13,
            Self::Torque => 12,
            Self::Velocity => 14,
            Self::Temperature | Self::Current => 8,
            Self::Mode => 6,
            Self::Age => 9,
        }
    }

    /// Returns `true` if there is anything to show in it.
    fn is_told(self, axes: &[AxisSnapshot]) -> bool {
        match self {
            Self::Torque => axes.iter().any(|axis| axis.torque.is_some()),
            Self::Temperature => axes.iter().any(|axis| axis.temperature.is_some()),
            Self::Current => axes.iter().any(|axis| axis.current_per_mille.is_some()),
            Self::Error | Self::Velocity | Self::Mode | Self::Age => true,
        }
    }

    fn cell(self, axis: &AxisSnapshot, unit: Unit, now_ns: Nanoseconds) -> String {
        let none = || "-".to_owned();
        match self {
            Self::Error if axis.following_error.is_finite() => {
                format!("{:+.2} {}", axis.following_error * 1e3, unit.milli_symbol())
            }
            Self::Error => none(),
            Self::Torque => {
                let unit = if unit == Unit::Radian { "Nm" } else { "N" };
                axis.torque.map_or_else(none, |torque| format!("{torque:+.2} {unit}"))
            }
            Self::Velocity => format!("{:+.3} {}/s", axis.velocity, unit.symbol()),
            Self::Temperature => axis.temperature.map_or_else(none, |celsius| format!("{celsius:.0} °C")),
            Self::Mode => mode(axis),
            Self::Current => {
                axis.current_per_mille.map_or_else(none, |part| format!("{:.1} %", f64::from(part) / 10.0))
            }
            Self::Age => axis.feedback_age_ns(now_ns).map_or_else(none, duration),
        }
    }
}

/// The abbreviation of the mode that the drive shows, or that is commanded.
fn mode(axis: &AxisSnapshot) -> String {
    let number = axis.mode.unwrap_or(axis.mode_set);
    let word = match OperationMode::from_number(number) {
        Some(OperationMode::ProfilePosition) => "PP",
        Some(OperationMode::Velocity) => "VL",
        Some(OperationMode::ProfileVelocity) => "PV",
        Some(OperationMode::ProfileTorque) => "PT",
        Some(OperationMode::Homing) => "HM",
        Some(OperationMode::InterpolatedPosition) => "IP",
        Some(OperationMode::CyclicSynchronousPosition) => "CSP",
        Some(OperationMode::CyclicSynchronousVelocity) => "CSV",
        Some(OperationMode::CyclicSynchronousTorque) => "CST",
        None => return number.to_string(),
    };
    word.to_owned()
}

/// The power of a drive in a word, and how old its report is where that is stale.
fn state(axis: &AxisSnapshot, now_ns: Nanoseconds, is_silent: bool) -> String {
    if is_silent {
        return "STALE".to_owned();
    }
    if axis.is_stale() {
        return match axis.feedback_age_ns(now_ns) {
            None => "NO REPORT".to_owned(),
            Some(age_ns) => format!("STALE {}", duration(age_ns)),
        };
    }
    match axis.drive_state {
        DriveState::OperationEnabled => "enabled".to_owned(),
        DriveState::Fault | DriveState::FaultReactionActive => format!("FAULT {:04X}", axis.error_code),
        DriveState::QuickStopActive => "quick stop".to_owned(),
        DriveState::SwitchedOn => "power, off".to_owned(),
        DriveState::ReadyToSwitchOn => "ready".to_owned(),
        DriveState::SwitchOnDisabled => "off".to_owned(),
        DriveState::NotReadyToSwitchOn => "not ready".to_owned(),
        DriveState::Undefined => "undefined".to_owned(),
    }
}

/// Where the axis is between its limits: `[···○●····]`.
fn bar(axis: &AxisSnapshot, limits: Option<AxisLimits>, columns: usize) -> String {
    let inside = columns.saturating_sub(2);
    let Some(limits) = limits.filter(|limits| (limits.position_max - limits.position_min).is_finite()) else {
        return format!("{:^columns$}", "no limit");
    };
    let span = limits.position_max - limits.position_min;
    let place = |position: f64| {
        let part = (position - limits.position_min) / span;
        (part * inside as f64).floor().clamp(0.0, inside.saturating_sub(1) as f64) as usize
    };
    let mut cells = vec!['·'; inside];
    for (position, sign) in [(axis.position_set, '○'), (axis.position, '●')] {
        let sign = match position {
            _ if sign == '○' => sign,
            beyond if beyond < limits.position_min => '◄',
            beyond if beyond > limits.position_max => '►',
            _ => sign,
        };
        if position.is_finite()
            && let Some(cell) = cells.get_mut(place(position))
        {
            *cell = sign;
        }
    }
    format!("[{}]", cells.into_iter().collect::<String>())
}

/// Draws as many axes as there is room for, the selected one among them.
pub fn draw(area: Rect, buffer: &mut Buffer, model: &Model, now_ns: Nanoseconds, palette: Palette) {
    let Some(room) = usize::from(area.height).checked_sub(1) else { return };
    let width = usize::from(area.width);
    let fixed = 1 + NAME + 1 + 12 + 1 + 1 + 12;
    let (mut columns, mut left) = (vec![], width.saturating_sub(fixed + BAR.0));
    let axes = model.seen.snapshot.axes();
    for column in Column::ALL.into_iter().filter(|column| column.is_told(axes)) {
        if left < column.columns() {
            break;
        }
        left -= column.columns();
        columns.push(column);
    }
    let bar_columns = (BAR.0 + left).min(BAR.1);
    let mut heading =
        format!(" {:<NAME$} {:>12} {:<bar_columns$} {:<12}", "AXIS", "position", "limits", "state");
    columns.iter().for_each(|column| heading += &format!("{:>1$}", column.heading(), column.columns()));
    let first = (model.axis + 1).saturating_sub(room).min(axes.len().saturating_sub(room));
    if axes.len() > room {
        heading = format!(
            " {:<NAME$}{}",
            format!("AXIS {}/{}", model.axis + 1, axes.len()),
            heading.chars().skip(NAME + 1).collect::<String>()
        );
    }
    let mut lines = vec![Line::styled(heading, palette.heading())];
    for (number, axis) in axes.iter().enumerate().skip(first).take(room) {
        let description = model.machine.axes.get(number);
        let unit = description.map_or(Unit::Radian, |axis| axis.unit);
        let name: String =
            description.map_or_else(String::new, |axis| axis.name.chars().take(NAME).collect());
        let is_selected = number == model.axis;
        let is_stale = axis.is_stale() || model.is_silent();
        let position =
            if axis.is_heard { format!("{:+.4} {}", axis.position, unit.symbol()) } else { "-".to_owned() };
        let limits = model.limits.get(number).copied().flatten();
        let marker = if is_selected { '▶' } else { ' ' };
        let mut text = format!(
            "{marker}{name:<NAME$} {position:>12} {} {:<12}",
            bar(axis, limits, bar_columns),
            state(axis, now_ns, model.is_silent())
        );
        for column in &columns {
            text += &format!("{:>1$}", column.cell(axis, unit, now_ns), column.columns());
        }
        let style = match axis.drive_state {
            _ if is_stale => palette.notable(),
            state if state.is_faulted() => palette.bad(),
            DriveState::OperationEnabled => palette.good(),
            _ => Style::new(),
        };
        let style = if is_selected { style.add_modifier(Modifier::BOLD) } else { style };
        lines.push(Line::styled(text, style));
    }
    Paragraph::new(lines).render(area, buffer);
}

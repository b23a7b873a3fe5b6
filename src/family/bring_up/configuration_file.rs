//! The configuration file of an axis (`dcf`): its values are written to the drive.

use takt_wire::canopen::object::Object;

use super::axis_session::{AxisSession, StepResult};

/// Writes the values of the file. They come first, so that what the controller needs overrides them.
pub async fn write(c: &AxisSession<'_>) -> StepResult {
    c.step(
        "configuration file",
        "the file named by `dcf` does not suit this drive: correct it there, or leave the object out",
    );
    for download in c.axis.dcf.iter().flat_map(|file| &file.downloads) {
        c.write_download(download).await?;
    }
    Ok(())
}

/// Writes a setting that the drive may lack, unless the file has a value for it: then the file wins.
pub(crate) async fn write_unless_in_file(c: &AxisSession<'_>, object: Object, value: i64) -> StepResult {
    if !is_in_file(c, object) {
        c.write_optional(object, value).await?;
    }
    Ok(())
}

/// Writes a bound that the drive may lack if it is lower than this, unless the file has a value for it. 0 is no bound.
pub(crate) async fn raise_unless_in_file(c: &AxisSession<'_>, object: Object, least: i64) -> StepResult {
    let mut present = 0;
    c.read_optional(object, |_, value| present = value).await?;
    if (1..least).contains(&present) { write_unless_in_file(c, object, least).await } else { Ok(()) }
}

fn is_in_file(c: &AxisSession<'_>, object: Object) -> bool {
    let mut downloads = c.axis.dcf.iter().flat_map(|file| &file.downloads);
    let address = c.of_axis(object).address;
    downloads.any(|download| download.object == address)
}

//! The configuration file of an axis (`dcf`): its values are written to the drive.

use super::axis_session::{AxisSession, StepResult};
use crate::canopen::object::Object;

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
pub async fn write_unless_in_file(c: &AxisSession<'_>, object: Object, value: i64) -> StepResult {
    let mut downloads = c.axis.dcf.iter().flat_map(|file| &file.downloads);
    let address = c.of_axis(object).address;
    if !downloads.any(|download| download.object == address) {
        c.write_optional(object, value).await?;
    }
    Ok(())
}

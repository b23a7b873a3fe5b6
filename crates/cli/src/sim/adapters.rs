//! Simulated buses behind SLCAN adapters on pseudo-terminals.

use std::convert::Infallible;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use crate::usage_error::UsageError;
use takt::config::{Bus, Config, Interface};
use takt::family::simulated_drives;
use takt_sim::LiveDrives;
use takt_sim::pseudo_terminal::PseudoTerminal;
use takt_sim::slcan_adapter::{AdapterBitRates, SlcanAdapter};

/// A second path for the adapter of a bus, or the wish for adapters alone.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterLink {
    bus: Option<String>,
    link: Option<PathBuf>,
}

impl AdapterLink {
    /// The second path.
    pub fn link(&self) -> Option<&Path> {
        self.link.as_deref()
    }
}

impl FromStr for AdapterLink {
    type Err = Infallible;

    /// `BUS=LINK`, `LINK`, or nothing.
    fn from_str(text: &str) -> Result<Self, Infallible> {
        let (bus, link) = match text.split_once('=') {
            Some((bus, link)) => (Some(bus.to_owned()), link),
            None => (None, text),
        };
        Ok(Self { bus, link: (!link.is_empty()).then(|| link.into()) })
    }
}

/// The drives of every simulated bus, behind an adapter on a pseudo-terminal of its own. None without `--pty`.
pub fn open(config: &Config, wishes: &[AdapterLink]) -> Result<Vec<(String, LiveDrives)>, UsageError> {
    if wishes.is_empty() {
        return Ok(vec![]);
    }
    let is_simulated = |(index, bus): &(usize, &Bus)| {
        bus.interface == Interface::Simulated && !config.is_serial_line(*index)
    };
    let simulated: Vec<(usize, &Bus)> = config.buses.iter().enumerate().filter(is_simulated).collect();
    check(wishes, &simulated)?;
    let mut all = vec![];
    for (index, bus) in simulated {
        let failed =
            |action: String, error| UsageError::from(format!("bus `{}`: {action}: {error}", bus.name));
        let mut line =
            PseudoTerminal::open().map_err(|error| failed("opening a pseudo-terminal".to_owned(), error))?;
        let is_of_bus = |wish: &&AdapterLink| wish.bus.as_ref().is_none_or(|name| *name == bus.name);
        for link in wishes.iter().filter(is_of_bus).filter_map(|wish| wish.link.as_ref()) {
            let named = |error| failed(format!("naming its pseudo-terminal {}", link.display()), error);
            line.link(link).map_err(named)?;
        }
        let path = line.linked_path().unwrap_or(line.path()).display();
        say!("bus `{}`: {path}; takt run … --bus {}=slcan:{path}", bus.name, bus.name);
        let rates = AdapterBitRates { nominal: bus.bit_rate, data: bus.data_bit_rate };
        let adapter = SlcanAdapter::new(line, rates);
        all.push((bus.name.clone(), LiveDrives::new(simulated_drives(config, index), Box::new(adapter))));
    }
    Ok(all)
}

/// Every link is for one simulated bus, and no bus has two.
fn check(wishes: &[AdapterLink], simulated: &[(usize, &Bus)]) -> Result<(), UsageError> {
    let names = || simulated.iter().map(|(_, bus)| bus.name.as_str()).collect::<Vec<_>>().join(", ");
    let mut linked = vec![];
    if simulated.is_empty() {
        return Err("--pty: no bus is simulated: every one has a real interface".to_owned().into());
    }
    for AdapterLink { bus, link } in wishes {
        let bus = match (bus, link, simulated) {
            (Some(name), ..) => match simulated.iter().find(|(_, bus)| bus.name == *name) {
                Some((_, bus)) => &bus.name,
                None => {
                    let problem =
                        format!("--pty {name}=…: no simulated bus is called {name:?}; they are: {}", names());
                    return Err(problem.into());
                }
            },
            (None, None, _) => continue,
            (None, Some(_), [(_, bus)]) => &bus.name,
            (None, Some(link), _) => {
                let link = link.display();
                return Err(
                    format!("--pty {link}: say of which bus, as BUS={link}; they are: {}", names()).into()
                );
            }
        };
        if linked.contains(&bus) {
            return Err(format!("--pty: the bus {bus:?} has a link already").into());
        }
        linked.push(bus);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(wishes: &[&str]) -> String {
        let config = Config::load(Path::new("../../configs/arm6-erob.toml")).unwrap();
        let wishes: Vec<AdapterLink> = wishes.iter().map(|text| text.parse().unwrap()).collect();
        match open(&config, &wishes) {
            Ok(_) => panic!("{wishes:?} is accepted"),
            Err(UsageError::Words(words)) => words,
            Err(UsageError::File(error)) => panic!("{error}"),
        }
    }

    #[test]
    fn a_link_is_for_one_bus_that_is_there() {
        assert!(refused(&["/tmp/takt-none"]).contains("say of which bus, as BUS=/tmp/takt-none"));
        assert!(refused(&["elbow=/tmp/takt-none"]).contains("they are: base, wrist"));
        assert!(refused(&["base=/tmp/takt-a", "base=/tmp/takt-b"]).contains("has a link already"));
        assert!(refused(&["base=/takt-none/folder/link"]).contains("naming its pseudo-terminal"));
    }

    #[test]
    fn without_the_option_no_bus_is_behind_an_adapter() {
        let config = Config::load(Path::new("../../configs/arm6-erob.toml")).unwrap();
        assert!(open(&config, &[]).is_ok_and(|drives| drives.is_empty()));
        let all = open(&config, &["".parse().unwrap()]);
        assert!(all.is_ok_and(|drives| drives.len() == config.buses.len()));
    }
}

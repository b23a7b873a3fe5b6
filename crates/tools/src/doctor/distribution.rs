//! The Linux distribution, for commands that differ between distributions.

use super::source::Source;

/// A distribution, as far as its commands differ.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Distribution {
    /// Debian and its derivatives.
    Debian,
    /// Ubuntu and its derivatives.
    Ubuntu,
    /// A Raspberry Pi with its own boot files, under any distribution.
    RaspberryPi,
    /// Fedora, Red Hat and their derivatives.
    Fedora,
    /// Arch Linux.
    Arch,
    /// Another one.
    Other,
}

const PI_COMMAND_LINE: &str = "/boot/firmware/cmdline.txt";

impl Distribution {
    pub fn of(source: &Source) -> Self {
        if source.exists(PI_COMMAND_LINE) {
            return Self::RaspberryPi;
        }
        source.text("/etc/os-release").map_or(Self::Other, |text| Self::of_release(&text))
    }

    /// From `os-release`(5): `ID` counts first, then the entries of `ID_LIKE`.
    fn of_release(text: &str) -> Self {
        let value = |key: &str| {
            let line = text.lines().find_map(|line| line.strip_prefix(key));
            line.unwrap_or_default().trim_matches(['"', '\'']).to_owned()
        };
        let names = format!("{} {}", value("ID="), value("ID_LIKE="));
        let known = names.split_whitespace().find_map(|name| match name {
            "debian" => Some(Self::Debian),
            "ubuntu" => Some(Self::Ubuntu),
            "fedora" | "rhel" | "centos" => Some(Self::Fedora),
            "arch" => Some(Self::Arch),
            _ => None,
        });
        known.unwrap_or(Self::Other)
    }

    /// How to get a kernel with PREEMPT_RT.
    pub fn realtime_kernel(self) -> &'static str {
        match self {
            Self::Debian => "sudo apt-get install linux-image-rt-$(dpkg --print-architecture) && sudo reboot",
            Self::Ubuntu => "sudo pro enable realtime-kernel && sudo reboot",
            Self::Arch => {
                "sudo pacman -S linux-rt && sudo grub-mkconfig -o /boot/grub/grub.cfg && sudo reboot"
            }
            Self::RaspberryPi => "sudo apt-get install linux-image-rpi-v8-rt && sudo reboot",
            Self::Fedora => "sudo dnf install kernel-rt && sudo reboot",
            Self::Other => {
                "scripts/config --enable EXPERT --enable PREEMPT_RT   # in the source of Linux 6.12 or later, then build it"
            }
        }
    }

    /// How to add parameters to the kernel's command line.
    pub fn boot_with(self, parameters: &str) -> String {
        match self {
            Self::RaspberryPi => {
                format!("sudo sed -i 's/$/ {parameters}/' {PI_COMMAND_LINE} && sudo reboot")
            }
            Self::Fedora => format!("sudo grubby --update-kernel=ALL --args='{parameters}' && sudo reboot"),
            Self::Debian | Self::Ubuntu => format!(
                "echo 'GRUB_CMDLINE_LINUX=\"$GRUB_CMDLINE_LINUX {parameters}\"' | sudo tee \
                 /etc/default/grub.d/takt.cfg && sudo update-grub && sudo reboot"
            ),
            Self::Arch | Self::Other => format!(
                "sudo sed -i 's/^GRUB_CMDLINE_LINUX=\"/&{parameters} /' /etc/default/grub && sudo grub-mkconfig -o \
                 /boot/grub/grub.cfg && sudo reboot"
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Distribution;

    #[test]
    fn a_distribution_is_known_by_its_own_name_or_by_the_one_it_follows() {
        for (text, distribution) in [
            ("PRETTY_NAME=\"Debian GNU/Linux 12\"\nVERSION_ID=\"12\"\nID=debian\n", Distribution::Debian),
            ("ID=ubuntu\nID_LIKE=debian\n", Distribution::Ubuntu),
            ("ID=linuxmint\nID_LIKE=\"ubuntu debian\"\n", Distribution::Ubuntu),
            ("ID=\"almalinux\"\nID_LIKE=\"rhel centos fedora\"\n", Distribution::Fedora),
            ("ID=arch\n", Distribution::Arch),
            ("ID=alpine\n", Distribution::Other),
            ("", Distribution::Other),
        ] {
            assert_eq!(Distribution::of_release(text), distribution, "{text}");
        }
    }
}

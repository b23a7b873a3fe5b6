//! The kernel's command line, and the parameters in it that reserve the loop's CPU.

use super::distribution::Distribution;

/// The value of a parameter on the kernel's command line, the last one when it is given more than once. A value in
/// quotation marks may hold spaces.
pub fn parameter<'a>(command_line: &'a str, name: &str) -> Option<&'a str> {
    let mut is_quoted = false;
    let words = command_line.split(move |c: char| {
        is_quoted ^= c == '"';
        c.is_whitespace() && !is_quoted
    });
    let values = words.filter_map(|word| match word.split_once('=') {
        Some((key, value)) => (key == name).then_some(value.trim_matches('"')),
        None => (word == name).then_some(""),
    });
    // Not `last`: quotation marks must be counted from the front.
    values.fold(None, |_, value| Some(value))
}

/// The command that reserves a CPU for the loop. One command satisfies every check of the CPU's isolation.
pub fn set_aside(distribution: Distribution, cpu: usize, others: &str) -> String {
    let parameters =
        format!("isolcpus=managed_irq,domain,{cpu} nohz_full={cpu} rcu_nocbs={cpu} irqaffinity={others}");
    distribution.boot_with(&parameters)
}

#[cfg(test)]
mod tests {
    use super::parameter;

    #[test]
    fn parameters_are_found_whole_and_the_last_one_counts() {
        let line = "BOOT_IMAGE=/vmlinuz root=UUID=1-2 ro quiet isolcpus=2 dyndbg=\"file a.c +p isolcpus=9\" \
                    isolcpus=managed_irq,3 threadirqs";
        assert_eq!(parameter(line, "isolcpus"), Some("managed_irq,3"));
        assert_eq!(parameter(line, "root"), Some("UUID=1-2"));
        assert_eq!(parameter(line, "threadirqs"), Some(""));
        assert_eq!(parameter(line, "dyndbg"), Some("file a.c +p isolcpus=9"));
        assert_eq!(parameter(line, "cpus"), None);
        assert_eq!(parameter("", "isolcpus"), None);
    }
}

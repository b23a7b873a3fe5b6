//! Sets of CPUs as the kernel writes them.

/// A list such as `0-3,8,10-14:2/4`, with what the boot command line puts before it (`isolcpus=managed_irq,2`) left
/// out. `(null)`, which some kernels print for no CPU at all, is an empty list; `all` and `N` are not numbers that
/// can be known here and are given as the CPUs up to `last`.
pub fn parse(text: &str, last: usize) -> Vec<usize> {
    let mut cpus: Vec<usize> = text.trim().split(',').flat_map(|part| range(part.trim(), last)).collect();
    cpus.sort_unstable();
    cpus.dedup();
    cpus
}

fn range(part: &str, last: usize) -> Vec<usize> {
    if part == "all" {
        return (0..=last).collect();
    }
    let (span, groups) = match part.split_once(':') {
        Some((span, groups)) => (span, groups.split_once('/')),
        None => (part, None),
    };
    let number = |text: &str| if text == "N" { Some(last) } else { text.parse().ok() };
    let (first, end) = match span.split_once('-') {
        Some((first, end)) => (number(first), number(end)),
        None => (number(span), number(span)),
    };
    let (Some(first), Some(end)) = (first, end) else { return vec![] };
    let group = groups.and_then(|(used, of)| Some((used.parse::<usize>().ok()?, of.parse::<usize>().ok()?)));
    (first..=end.min(MOST_CPUS))
        .filter(|cpu| group.is_none_or(|(used, of)| of > 0 && (cpu - first) % of < used))
        .collect()
}

/// More CPUs than any kernel supports.
const MOST_CPUS: usize = 8_192;

/// A list in the shortest form: `0-3,8`.
pub fn write(cpus: &[usize]) -> String {
    let mut spans: Vec<(usize, usize)> = vec![];
    for cpu in cpus {
        match spans.last_mut() {
            Some((_, end)) if *end + 1 == *cpu => *end = *cpu,
            _ => spans.push((*cpu, *cpu)),
        }
    }
    let words = spans.iter().map(|(first, end)| match first == end {
        true => first.to_string(),
        false => format!("{first}-{end}"),
    });
    words.collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_read_as_the_kernel_writes_them() {
        for (text, cpus) in [
            ("", &[][..]),
            ("(null)", &[]),
            ("\n", &[]),
            ("1", &[1]),
            ("0-2,5", &[0, 1, 2, 5]),
            ("managed_irq,domain,2-3", &[2, 3]),
            ("nohz,3", &[3]),
            ("0-7:2/4", &[0, 1, 4, 5]),
            ("6-N", &[6, 7]),
            ("all", &[0, 1, 2, 3, 4, 5, 6, 7]),
            ("3,1,1-2", &[1, 2, 3]),
            ("5-3", &[]),
            ("0-7:1/0", &[]),
            ("rubbish-,-4,,", &[]),
        ] {
            assert_eq!(parse(text, 7), cpus, "{text:?}");
        }
        assert_eq!(parse("0-18446744073709551615", 7).len(), MOST_CPUS + 1);
    }

    #[test]
    fn a_list_is_written_in_its_shortest_form() {
        assert_eq!(write(&[0, 1, 2, 5, 7, 8]), "0-2,5,7-8");
        assert_eq!(write(&[]), "");
    }
}

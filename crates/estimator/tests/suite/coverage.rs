//! How often intervals hold the truth.

/// Checks that of the seeds' intervals as many hold the truth as may of intervals that hold it nine
/// times in ten to 98 times in a hundred: of 200, no fewer and no more than that; of fewer, chance
/// (three deviations) on top. Each parameter's are judged by 1.96 deviations and by bootstrap.
pub fn covers(
    seeds: std::ops::Range<u64>,
    truths: &[(&str, f64)],
    find: impl Fn(u64) -> atvrec_estimator::finding::Findings,
) {
    let count = (seeds.end - seeds.start) as f64;
    let found: Vec<_> = seeds.map(find).collect();
    let chance = |part: f64| 3.0 * (part * (1.0 - part) / count).sqrt();
    let holds = if count < 200.0 {
        0.9 - chance(0.9)..=0.98 + chance(0.98)
    } else {
        0.9..=0.98
    };
    let mut missed = Vec::new();
    for (name, truth) in truths {
        let (mut by_sigma, mut by_bootstrap) = (0, 0);
        let (mut sum, mut square) = (0.0, 0.0);
        for one in &found {
            let finding = one.get(name).expect("was looked for");
            let [low, high] = finding.interval.expect("has an interval");
            let off = (finding.value - truth) / finding.sigma;
            by_sigma += u32::from(off.abs() < 1.96);
            by_bootstrap += u32::from((low..=high).contains(truth));
            sum += off / count;
            square += off * off / count;
        }
        let [by_sigma, by_bootstrap] = [by_sigma, by_bootstrap].map(|held| f64::from(held) / count);
        let spread = (square - sum * sum).sqrt();
        println!(
            "covered: {name} {by_sigma:.3} by deviation, {by_bootstrap:.3} by bootstrap; errors of \
             {sum:.2} +- {spread:.2} deviations"
        );
        let off = [by_sigma, by_bootstrap].into_iter();
        missed.extend(
            off.filter(|part| !holds.contains(part))
                .map(|part| (*name, part)),
        );
    }
    assert!(missed.is_empty(), "{missed:?} are not in {holds:?}");
}

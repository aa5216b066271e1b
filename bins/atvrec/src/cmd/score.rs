//! `atvrec score`: compare the estimates of a log with the truth or with the estimates of another log.

use report::score::{
    Channels, Comparison, ForceScore, InnovationScore, LandingScore, Lifts, Roads, Score,
    ScoreError, ScoreOptions, SurfaceChanges, compare, innovations, innovations_json,
    score_methods, score_with,
};
use sample::Wheel;
use store::{Reader, Stage};

use crate::cli::ScoreArgs;
use crate::exit::Outcome;
use crate::interrupt::Interrupt;
use crate::progress::Progress;

/// Runs the command.
pub fn run(args: &ScoreArgs, quiet: bool) -> anyhow::Result<Outcome> {
    let reader = Reader::open(&args.logs)?;
    let stage = if args.smoothed {
        Stage::Smoothed
    } else {
        Stage::Estimate
    };
    if !args.against.is_empty() {
        let other = Reader::open(&args.against)?;
        let found = compare(&reader, &other, stage, args.from_s)?;
        if args.json {
            println!("{:#}", found.to_json());
        } else {
            print_comparison(&found);
        }
        return Ok(Outcome::Good);
    }
    if args.innovations {
        let found = innovations(&reader, args.from_s)?;
        if args.json {
            println!(
                "{:#}",
                serde_json::json!({ "innovations": innovations_json(&found) })
            );
        } else {
            print_innovations(&found);
        }
        return Ok(Outcome::Good);
    }
    let bytes = reader.info().files.iter().map(|(_, bytes)| bytes).sum();
    let progress = Progress::bytes("score", bytes, quiet);
    let interrupt = Interrupt::listen()?;
    let options = ScoreOptions {
        stage,
        from_s: args.from_s,
        low_pass_hz: args.low_pass_hz,
    };
    let found = score_with(&reader, options, &mut |part| {
        progress.set_part(part);
        interrupt.check().map_err(|_| ScoreError::Interrupted)
    })?;
    progress.finish();
    let methods = if args.methods {
        let simple = engine::simple_methods_of(&reader)?.by_name();
        Some(score_methods(&reader, simple, args.from_s)?)
    } else {
        None
    };
    if args.json {
        let mut json = found.to_json();
        if let Some(methods) = &methods {
            json["methods"] = methods.iter().map(ForceScore::to_json).collect();
        }
        println!("{json:#}");
    } else {
        print_score(&found);
        if let Some(methods) = &methods {
            println!();
            print_forces(methods);
        }
    }
    Ok(Outcome::Good)
}

fn optional(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
}

/// Factor and unit for printing; angles are printed in degrees.
fn printed_unit(unit: &'static str) -> (f64, &'static str) {
    match unit {
        "rad" => (1.0_f64.to_degrees(), "deg"),
        "rad/s" => (1.0_f64.to_degrees(), "deg/s"),
        unit => (1.0, unit),
    }
}

fn print_score(found: &Score) {
    println!(
        "{:<20}{:<6}{:<7}{:>10}{:>10}{:>10}{:>10}{:>8}{:>9}{:>8}{:>9}",
        "signal",
        "wheel",
        "unit",
        "mean",
        "rmse",
        "95 %",
        "peak",
        "%",
        "delay ms",
        "nees",
        "inside %"
    );
    for row in &found.signals {
        let (scale, unit) = printed_unit(row.unit);
        let [mean, rmse, most, peak] = [
            row.errors.mean,
            row.errors.rmse,
            row.errors.percentile_95,
            row.errors.peak,
        ]
        .map(|value| value * scale);
        println!(
            "{:<20}{:<6}{unit:<7}{mean:>10.3}{rmse:>10.3}{most:>10.3}{peak:>10.3}{:>8}{:>9}{:>8}\
             {:>9}",
            row.signal,
            row.wheel.map_or("", Wheel::abbreviation),
            optional(row.normalised_percent, 2),
            optional(row.delay_s.map(|delay_s| delay_s * 1e3), 1),
            optional(row.nees, 2),
            optional(row.nees_inside.map(|part| part * 100.0), 0),
        );
    }
    println!();
    print_forces(&found.forces);
    println!();
    print_near(found);
    if let Some(low_passed) = &found.low_passed {
        println!("\nforces below {} Hz:", low_passed.hz);
        print_forces(&low_passed.forces);
    }
    println!();
    print_innovations(&found.innovations);
    println!();
    print_lifts("lifts", &found.lifts);
    print_lifts("two-wheel lifts", &found.two_wheel_lifts);
    found.landings.iter().for_each(print_landings);
    if let Some(surfaces) = &found.surface_changes {
        print_surface_changes(surfaces);
    }
    if let Some(road) = &found.road {
        print_road(road);
    }
    if let Some(channels) = &found.channels {
        print_channels(channels);
    }
    for (kind, count) in &found.events {
        println!("events: {count} {kind}");
    }
}

fn print_road(found: &Roads) {
    for row in &found.outputs {
        let [bank, grade, warp] = &row.plane;
        println!(
            "road, {}: height above 0.5 Hz {:.1} mm rms (truth {:.1}), nees {:.2}; bank {:.2} deg, \
             grade {:.2} deg, warp {:.1} mm rms",
            row.output,
            row.height.rms * 1e3,
            row.height.truth_rms * 1e3,
            row.height.nees,
            bank.rms.to_degrees(),
            grade.rms.to_degrees(),
            warp.rms * 1e3,
        );
    }
    let roughness = &found.roughness;
    if let Some([estimate, truth]) = &roughness.last {
        let [best, worst] = estimate.class_bounds();
        println!(
            "road: class {} (bounds {best} to {worst}), by the truth {}; Gd(n0) {:.0}e-6 m3, by the truth \
             {:.0}e-6 m3; the class agrees for {:.0} % of the time",
            estimate.class(),
            truth.class(),
            estimate.gd_n0_m3 * 1e6,
            truth.gd_n0_m3 * 1e6,
            roughness.class_agrees * 100.0,
        );
    }
    if let Some([estimate, truth]) = roughness.iri_m_km {
        println!("road: IRI {estimate:.2} m/km, by the truth {truth:.2} m/km");
    }
    for (why, count) in &found.unknown {
        println!("road: {count} instants without values ({why})");
    }
}

fn print_channels(found: &Channels) {
    println!(
        "{} channels excluded though healthy, {} of them used again; {} faults injected, {} missed",
        found.healthy.len(),
        found.healthy_recovered,
        found.faults,
        found.missed.len()
    );
    for name in &found.missed {
        println!("missed fault of {name}");
    }
}

/// Prints the largest error of all wheels and the consistency, by output and frame.
fn print_forces(found: &[ForceScore]) {
    println!(
        "{:<11}{:<15}{:<15}{:>8}{:>8}{:>8}{:>8}{:>8}{:>21}{:>20}{:>9}{:>9}{:>9}",
        "output",
        "frame",
        "estimate's",
        "Fx %",
        "Fy %",
        "Fz %",
        "Mx %",
        "Mz %",
        "nees x y z",
        "median x y z",
        "windows",
        "below %",
        "median"
    );
    let three = |values: [Option<f64>; 3]| values.map(|value| optional(value, 1)).join(" ");
    for row in found {
        let [x, y, z] = row.worst_percent.map(|percent| optional(percent, 2));
        let [roll, yaw] = row.worst_moment_percent.map(|percent| optional(percent, 2));
        let windows = row.windows.as_ref();
        println!(
            "{:<11}{:<15}{:<15}{x:>8}{y:>8}{z:>8}{roll:>8}{yaw:>8}{:>21}{:>20}{:>9}{:>9}{:>9}",
            row.output,
            row.frame.name(),
            row.estimate_frame.name(),
            three(row.nees),
            three(row.nees_median),
            windows.map_or_else(|| "-".to_owned(), |all| all.windows.to_string()),
            optional(windows.map(|all| 100.0 * (1.0 - all.above)), 0),
            optional(windows.map(|all| all.median), 2),
        );
    }
}

/// Prints the errors near stops, touchdowns and standstills, and those elsewhere, by output and frame.
fn print_near(found: &Score) {
    let stops = &found.stops;
    println!(
        "{} touchdowns, {} strut stops, {} standstills; samples within 0.1 s of them and others:",
        stops.touchdowns,
        stops
            .strut_stops
            .map_or_else(|| "unknown".to_owned(), |count| count.to_string()),
        stops.standstills,
    );
    println!(
        "{:<17}{:<11}{:<15}{:>9}{:>8}{:>8}{:>8}{:>21}",
        "samples", "output", "frame", "count", "Fx %", "Fy %", "Fz %", "nees x y z"
    );
    for row in &found.forces {
        let Some(near) = &row.near else {
            continue;
        };
        for (name, part) in [
            ("near stops", &near.stops),
            ("elsewhere", &near.elsewhere),
            ("near standstills", &near.standstills),
        ] {
            let [x, y, z] = part.worst_percent.map(|percent| optional(percent, 2));
            println!(
                "{name:<17}{:<11}{:<15}{:>9}{x:>8}{y:>8}{z:>8}{:>21}",
                row.output,
                row.frame.name(),
                part.count,
                part.nees.map(|value| optional(value, 1)).join(" "),
            );
        }
    }
}

fn print_surface_changes(found: &SurfaceChanges) {
    for change in &found.changes {
        println!(
            "{} axle: friction changes by the factor {:.2} at {:.2} s ({}); detected {} s later, \
             lateral force factor {}",
            change.axle,
            change.friction_ratio,
            change.at_s,
            if change.detectable {
                "detectable"
            } else {
                "not detectable"
            },
            optional(change.declared_after_s, 2),
            optional(change.declared_force_ratio, 2),
        );
    }
    println!(
        "{} surface changes, {} false detections",
        found.changes.len(),
        found.false_changes
    );
}

fn print_innovations(found: &[InnovationScore]) {
    println!(
        "{:<20}{:>10}{:>10}{:>8}{:>8}{:>10}{:>10}{:>9}  bounds",
        "innovations", "count", "rejected", "nis", "median", "inside %", "below %", "windows"
    );
    for row in found {
        println!(
            "{:<20}{:>10}{:>10}{:>8.2}{:>8.2}{:>10.0}{:>10.0}{:>9}  {:.2} to {:.2}",
            row.kind.name(),
            row.count,
            row.rejected,
            row.mean,
            row.median,
            100.0 * row.inside,
            100.0 * (1.0 - row.above),
            row.windows,
            row.bounds[0],
            row.bounds[1],
        );
    }
}

fn print_lifts(name: &str, found: &Lifts) {
    for lift in &found.lifts {
        println!(
            "{} lifts at {:.2} s for {:.2} s: detected {} s later, warning {} s before; the load fell \
             for {} s, warning due {} s before",
            lift.what,
            lift.at_s,
            lift.duration_s,
            optional(lift.declared_after_s, 2),
            optional(lift.warned_before_s, 2),
            optional(lift.fall_s, 2),
            optional(lift.warning_due_s(), 2),
        );
    }
    println!(
        "{} {name}, {} missed; {} detections, {} false; {} warnings, {} false",
        found.lifts.len(),
        found.missed(),
        found.declared,
        found.false_lifts,
        found.warnings,
        found.false_warnings
    );
    let leads = found.warning_leads();
    println!(
        "{name}: {} warnings due, {} in time, {} late, {} missed; {} lifts without a due warning",
        leads.due, leads.in_time, leads.late, leads.missed, leads.not_due
    );
    let off_ground = &found.off_ground;
    println!(
        "{name}: {} times off the ground of any length, {} per km, {:.2} % of the time",
        off_ground.count,
        optional(off_ground.per_km, 1),
        100.0 * off_ground.share_of_time
    );
}

fn print_landings(found: &LandingScore) {
    println!(
        "landings, {}: {} peaks of the load, error {:.1} % in the mean, standard deviation {} %",
        found.output,
        found.count,
        found.mean_percent,
        optional(found.standard_deviation_percent, 1)
    );
}

fn print_comparison(found: &Comparison) {
    println!(
        "{:<20}{:<6}{:<7}{:>12}{:>12}{:>12}{:>10}{:>11}{:>12}",
        "signal", "wheel", "unit", "mean", "rms", "largest", "at s", "one-sided", "of sigma"
    );
    for row in &found.signals {
        let (scale, unit) = printed_unit(row.unit);
        let [mean, rms, largest] = [row.mean, row.rms, row.largest].map(|value| value * scale);
        println!(
            "{:<20}{:<6}{unit:<7}{mean:>12.4}{rms:>12.4}{largest:>12.4}{:>10.2}{:>11}{:>12}",
            row.signal,
            row.wheel.map_or("", Wheel::abbreviation),
            row.largest_at_s,
            row.one_sided,
            optional(row.largest_of_sigma.map(|sigma| sigma * scale), 4),
        );
    }
    println!(
        "{} estimates in both, {} only in the first, {} only in the second; {} of {} parameter \
         reports differ; {} events are identical, {} similar",
        found.common,
        found.only_here,
        found.only_there,
        found.parameters[1],
        found.parameters[0],
        found.same_events,
        found.similar_events
    );
    for (place, events) in [
        ("first", &found.events_only_here),
        ("second", &found.events_only_there),
    ] {
        for event in events {
            println!(
                "only in the {place}, at {:.2} s: {} ({})",
                event.at_s, event.kind, event.text
            );
        }
    }
}

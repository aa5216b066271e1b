//! Output of calibration and identification: printed results and the page with their figures.

use estimator::finding::{Figure, Finding, Findings};
use report::findings::{Page, Table};
use report::{Data, Kind, Panel, Pen, Trace};
use serde_json::{Value, json};

/// Prints all results as tables or as one JSON document.
pub fn print(results: &[Findings], as_json: bool) -> anyhow::Result<()> {
    if as_json {
        println!("{:#}", to_json(results)?);
        return Ok(());
    }
    for result in results {
        println!("{}", result.what);
        if !result.findings.is_empty() {
            println!(
                "  {:<42}{:>14}{:>12}  {:<14}{:<28}{:>9}",
                "", "value", "sigma", "unit", "95 %", "cond."
            );
        }
        for finding in &result.findings {
            let [value, sigma, unit, interval, condition] = cells(finding);
            println!(
                "  {:<42}{value:>14}{sigma:>12}  {unit:<14}{interval:<28}{condition:>9}",
                finding.name
            );
        }
        for (name, value, unit) in &result.beside {
            println!("  {name:<42}{:>14}{:>12}  {unit}", number(*value), "");
        }
        for note in &result.notes {
            println!("  note: {note}");
        }
    }
    Ok(())
}

/// Results as one JSON document with the key `results`, a list of [`Findings`].
pub fn to_json(results: &[Findings]) -> anyhow::Result<Value> {
    Ok(json!({ "results": serde_json::to_value(results)? }))
}

/// HTML page of the results.
pub fn page(title: &str, facts: Vec<(String, String)>, results: &[Findings]) -> String {
    let mut page = Page {
        title: title.to_owned(),
        facts,
        ..Page::default()
    };
    for (place, result) in results.iter().enumerate() {
        page.warnings.extend(result.notes.iter().cloned());
        if !result.findings.is_empty() {
            page.tables.push(table(result));
        }
        if !result.beside.is_empty() {
            page.tables.push(beside(result));
        }
        let figures = result.figures.iter().enumerate();
        page.figures
            .extend(figures.map(|(k, found)| figure(&format!("figure-{place}-{k}"), found)));
    }
    report::findings::html(&page)
}

/// Value, standard deviation, unit, interval and condition number of a finding as texts.
fn cells(finding: &Finding) -> [String; 5] {
    // Angles are printed in degrees.
    let (factor, unit) = match finding.unit.as_str() {
        "rad" => (1.0_f64.to_degrees(), "deg"),
        "rad/s" => (1.0_f64.to_degrees(), "deg/s"),
        unit => (1.0, unit),
    };
    let interval = finding.interval.map_or_else(String::new, |[low, high]| {
        format!("{} to {}", number(low * factor), number(high * factor))
    });
    [
        number(finding.value * factor),
        number(finding.sigma * factor),
        unit.to_owned(),
        interval,
        if finding.condition.is_finite() {
            format!("{:.1}", finding.condition)
        } else {
            String::new()
        },
    ]
}

/// Formats a number with five significant digits, without an exponent if the text is short.
pub fn number(value: f64) -> String {
    if !value.is_finite() {
        return "-".to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let size = math::log10(value.abs()).floor();
    if !(-4.0..=7.0).contains(&size) {
        return format!("{value:.3e}");
    }
    let digits = (4.0 - size).max(0.0) as usize;
    format!("{value:.digits$}")
}

fn table(result: &Findings) -> Table {
    let columns = [
        "quantity",
        "value",
        "sigma",
        "unit",
        "95 % interval",
        "condition",
        "excitation",
        "Durbin-Watson",
        "data",
    ];
    let row = |finding: &Finding| {
        let mut row: Vec<String> = vec![finding.name.clone()];
        row.extend(cells(finding));
        row.push(
            finding
                .excitation
                .as_ref()
                .map_or_else(String::new, |e| format!("{} {}", number(e.rms), e.unit)),
        );
        row.push(
            finding
                .whiteness
                .map_or_else(String::new, |w| format!("{:.2}", w.durbin_watson)),
        );
        let span = finding.span;
        row.push(format!(
            "{} rows, {:.1} s within {:.1} to {:.1} s",
            span.rows, span.used_s, span.from_s, span.to_s
        ));
        row
    };
    Table {
        heading: result.what.clone(),
        columns: columns.map(str::to_owned).to_vec(),
        rows: result.findings.iter().map(row).collect(),
    }
}

fn beside(result: &Findings) -> Table {
    let row = |(name, value, unit): &(String, f64, String)| {
        vec![name.clone(), number(*value), unit.clone()]
    };
    Table {
        heading: format!("{}: other quantities", result.what),
        columns: ["quantity", "value", "unit"].map(str::to_owned).to_vec(),
        rows: result.beside.iter().map(row).collect(),
    }
}

fn figure(id: &str, found: &Figure) -> report::Figure {
    let traces = found.series.iter().enumerate().map(|(k, series)| Trace {
        name: series.name.clone(),
        pen: if series.line {
            Pen::Other(k)
        } else {
            Pen::Points(k)
        },
        data: Data::Own {
            x: series.x.clone(),
            y: series.y.clone(),
        },
    });
    report::Figure {
        id: id.to_owned().into(),
        title: found.title.clone().into(),
        caption: "".into(),
        panels: vec![Panel {
            y_label: found.y_label.clone(),
            traces: traces.collect(),
            ..Panel::default()
        }],
        x_label: found.x_label.clone().into(),
        kind: Kind::Plain,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_five_digits() {
        let texts = [-511.254_321, 0.012_345_67, 12_345.678, 1e-9, 0.0, f64::NAN].map(number);
        assert_eq!(
            texts,
            ["-511.25", "0.012346", "12346", "1.000e-9", "0", "-"]
        );
    }
}

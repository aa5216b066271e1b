//! Tables of a report below its figures.

use std::fmt::Write;

use sample::text::{html, html_lines};
use sample::{LossPlace, TerrainClass};
use store::Attachment;

use crate::drive::Drive;

pub fn learnt(drive: &Drive, body: &mut String) {
    let Some(learnt) = &drive.learnt.last else {
        return;
    };
    body.push_str(
        "<h2 id=\"learnt\">Learnt</h2><p class=\"caption\">What the estimator had found of the \
         sensors by the end of the drive, beyond the calibration.</p>\
         <div class=\"wide\"><table><tr><th></th><th class=\"n\">value</th>\
         <th class=\"n\">standard deviation</th><th></th></tr>",
    );
    let mut row = |name: &str, value: f64, sigma: f64, unit: &str| {
        let _ = write!(
            body,
            "<tr><td>{name}</td><td class=\"n\">{value:.3}</td><td class=\"n\">{sigma:.3}</td>\
             <td>{unit}</td></tr>"
        );
    };
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        row(
            &format!("accelerometer bias, {name}"),
            learnt.accel_bias_m_s2[axis],
            learnt.accel_bias_sigma_m_s2[axis],
            "m/s²",
        );
        row(
            &format!("gyro bias, {name}"),
            learnt.gyro_bias_rad_s[axis].to_degrees(),
            learnt.gyro_bias_sigma_rad_s[axis].to_degrees(),
            "deg/s",
        );
    }
    row(
        "steer offset at the road wheels, left positive",
        learnt.steer_offset_rad.to_degrees(),
        learnt.steer_offset_sigma_rad.to_degrees(),
        "deg",
    );
    body.push_str("</table></div>");
    limits(drive, body);
    terrain(drive, body);
}

/// The limits at the end of the drive.
fn limits(drive: &Drive, body: &mut String) {
    let Some((_, limits)) = drive.reachable.last() else {
        return;
    };
    let mut parts: Vec<String> = limits.reason().into_iter().collect();
    for (name, limit, factor, unit) in [
        (
            "lateral acceleration left",
            limits.lateral_m_s2,
            1.0,
            "m/s²",
        ),
        (
            "side slope",
            limits.side_slope_rad,
            1_f64.to_degrees(),
            "deg",
        ),
        ("grade", limits.grade_rad, 1_f64.to_degrees(), "deg"),
    ] {
        if limit.at_least.is_nan() {
            continue;
        }
        let mut part = format!("{name} at least {:.1} {unit}", factor * limit.at_least);
        if limit.value.is_finite() {
            let _ = write!(part, " (estimate {:.1} {unit})", factor * limit.value);
        }
        parts.push(part);
    }
    let _ = write!(
        body,
        "<p>Limits at the end of the drive: {}.</p>",
        html(&parts.join("; "))
    );
}

/// Part of the drive on each kind of ground.
fn terrain(drive: &Drive, body: &mut String) {
    let all: usize = drive.terrain_named.iter().sum();
    if all == 0 {
        return;
    }
    body.push_str(
        "<div class=\"wide\"><table><tr><th>kind of ground</th><th class=\"n\">part of the drive, %</th></tr>",
    );
    for class in TerrainClass::ALL {
        let part = 100.0 * drive.terrain_named[class.index()] as f64 / all as f64;
        let name = class.name();
        let _ = write!(
            body,
            "<tr><td>{name}</td><td class=\"n\">{part:.0}</td></tr>"
        );
    }
    body.push_str("</table></div>");
}

pub fn sources(drive: &Drive, body: &mut String) {
    let Some(health) = &drive.health else { return };
    body.push_str(
        "<h2 id=\"sources\">Sources</h2><div class=\"wide\"><table><tr><th>source</th>\
         <th>state</th><th class=\"n\">messages</th><th class=\"n\">bytes</th>\
         <th class=\"n\">bad checksums</th><th class=\"n\">skipped bytes</th>\
         <th class=\"n\">gaps</th><th class=\"n\">malformed</th><th class=\"n\">reopened</th>",
    );
    for place in LossPlace::ALL {
        let _ = write!(body, "<th class=\"n\">lost: {}</th>", place.name());
    }
    body.push_str("</tr>");
    for source in &health.sources {
        let state = match (source.open, source.silent) {
            (false, _) => "closed",
            (true, true) => "silent",
            (true, false) => "open",
        };
        let _ = write!(body, "<tr><td>{}</td><td>{state}</td>", html(&source.name));
        let counters = [
            source.messages,
            source.bytes,
            source.checksum_errors,
            source.skipped_bytes,
            source.gaps,
            source.malformed,
            source.reopened,
        ];
        for value in counters.into_iter().chain(source.lost) {
            let _ = write!(body, "<td class=\"n\">{value}</td>");
        }
        body.push_str("</tr>");
    }
    body.push_str("</table></div>");
    if !health.faulty_sensors.is_empty() {
        let names = html(&health.faulty_sensors.join(", "));
        let _ = write!(
            body,
            "<p>Found faulty and left out at the end: {names}.</p>"
        );
    }
}

pub fn clocks(drive: &Drive, body: &mut String) {
    if drive.clocks.is_empty() {
        return;
    }
    body.push_str(
        "<h2 id=\"clocks\">Clocks</h2><p class=\"caption\">Each device's clock against the log \
         clock, as fitted at the end of the drive.</p><div class=\"wide\"><table><tr>\
         <th>source</th><th class=\"n\">offset (s)</th><th class=\"n\">drift (ppm)</th>\
         <th class=\"n\">residual (ms)</th><th class=\"n\">steps</th></tr>",
    );
    for (name, fit) in &drive.clocks {
        let _ = write!(
            body,
            "<tr><td>{}</td><td class=\"n\">{:.4}</td><td class=\"n\">{:.1}</td>\
             <td class=\"n\">{:.2}</td><td class=\"n\">{}</td></tr>",
            html(name),
            fit.offset_s,
            fit.drift_ppm,
            1e3 * fit.residual_sigma_s,
            fit.steps
        );
    }
    body.push_str("</table></div>");
}

pub fn files(drive: &Drive, large: &[(String, Attachment)], directory: &str, body: &mut String) {
    body.push_str("<h2 id=\"files\">Files</h2><ul>");
    for (path, bytes) in &drive.files {
        let _ = write!(
            body,
            "<li>{} ({:.1} MB)</li>",
            html(path),
            *bytes as f64 / 1e6
        );
    }
    body.push_str("</ul>");
    for attachment in &drive.attachments {
        let text = String::from_utf8_lossy(&attachment.data);
        let _ = write!(
            body,
            "<details><summary>{} ({} bytes, in the log)</summary><pre>{}</pre></details>",
            html(&attachment.name),
            attachment.data.len(),
            html_lines(&text)
        );
    }
    for (name, attachment) in large {
        let _ = write!(
            body,
            "<p><a href=\"{directory}/{name}\">{}</a> ({:.1} MB, in the log), written beside this page</p>",
            html(&attachment.name),
            attachment.data.len() as f64 / 1e6,
            directory = html(directory),
            name = html(name),
        );
    }
}

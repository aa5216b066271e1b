//! Curves from columns: units, gaps, single samples or envelopes.

use crate::blob::{Blob, Id};
use crate::drive::Drive;
use crate::frame::{Frame, GAP_S};
use crate::options::{Options, Quantity};
use crate::plot::{Data, Panel, Pen, Trace};
use crate::reference::Reference;

/// Samples of a column from which on only the most important curves have single samples.
const LONG: usize = 60_000;
/// Stretch of an envelope, s.
const STRETCH_S: f64 = 0.1;
/// Angles of the motion have no meaning below this speed, m/s.
const SLOWEST_M_S: f64 = 1.0;

/// Makes curves of columns.
pub struct Curves<'a> {
    pub drive: &'a Drive,
    pub reference: Option<&'a Reference>,
    pub options: &'a Options,
    blob: &'a mut Blob,
    /// Instants of the motion that are too slow for angles.
    is_slow: Vec<bool>,
}

/// A column and how it is drawn.
#[derive(Clone, Copy)]
pub struct Spec<'a> {
    pub name: &'a str,
    pub pen: Pen,
    pub column: &'a str,
    pub sigma: Option<&'a str>,
    pub quantity: Quantity,
    /// Single samples, however long the drive is.
    pub is_important: bool,
    /// Left out while the vehicle is slow.
    pub needs_speed: bool,
}

impl<'a> Spec<'a> {
    pub fn new(name: &'a str, column: &'a str, quantity: Quantity) -> Self {
        Self {
            name,
            pen: Pen::Measured,
            column,
            sigma: None,
            quantity,
            is_important: false,
            needs_speed: false,
        }
    }

    pub const fn pen(self, pen: Pen) -> Self {
        Self { pen, ..self }
    }

    pub const fn sigma(self, sigma: &'a str) -> Self {
        Self {
            sigma: Some(sigma),
            ..self
        }
    }

    pub const fn important(self) -> Self {
        Self {
            is_important: true,
            ..self
        }
    }

    pub const fn needs_speed(self) -> Self {
        Self {
            needs_speed: true,
            ..self
        }
    }
}

impl<'a> Curves<'a> {
    pub fn new(
        drive: &'a Drive,
        reference: Option<&'a Reference>,
        options: &'a Options,
        blob: &'a mut Blob,
    ) -> Self {
        let speed = drive.motion.get("velocity_x_m_s").unwrap_or_default();
        blob.is_long = drive.motion.len() > LONG;
        let is_slow = speed.iter().map(|v| f64::from(v.abs()) < SLOWEST_M_S);
        Self {
            drive,
            reference,
            options,
            blob,
            is_slow: is_slow.collect(),
        }
    }

    pub fn unit(&self, quantity: Quantity) -> &'static str {
        self.options.units.of(quantity).1
    }

    /// A curve; `None` without a finite value.
    pub fn curve(&mut self, frame: &Frame, spec: Spec<'_>) -> Option<Trace> {
        if !spec.is_important
            && !spec.needs_speed
            && let Some(stretches) = frame.stretches(spec.column)
        {
            let (factor, _) = self.options.units.of(spec.quantity);
            let scaled = |value: f32| (f64::from(value) * factor) as f32;
            let stretches = stretches.map(|(time_s, values)| (time_s, values.map(scaled)));
            return Some(Trace {
                name: spec.name.to_owned(),
                pen: spec.pen,
                data: self.envelope(stretches)?,
            });
        }
        let values = self.column(frame, spec, spec.column)?;
        let sigma = spec.sigma.and_then(|sigma| self.column(frame, spec, sigma));
        self.of_values(&frame.time_s, values, sigma, spec)
    }

    /// A curve of numbers that are in the units of the page.
    pub fn of_values(
        &mut self,
        time_s: &[f64],
        values: Vec<f32>,
        sigma: Option<Vec<f32>>,
        spec: Spec<'_>,
    ) -> Option<Trace> {
        let is_long = values.len() > LONG && !self.options.full && !spec.is_important;
        let data = if is_long {
            let samples = time_s.iter().zip(&values);
            self.envelope(samples.map(|(time_s, value)| (*time_s, [*value; 2])))?
        } else {
            let (x, y) = self.samples(time_s, &values, Blob::add)?;
            let sigma = sigma.and_then(|sigma| self.samples(time_s, &sigma, Blob::add_sigma));
            Data::Samples {
                x,
                y,
                sigma: sigma.map(|(_, sigma)| sigma),
                time: None,
            }
        };
        Some(Trace {
            name: spec.name.to_owned(),
            pen: spec.pen,
            data,
        })
    }

    /// Points of two quantities with their times.
    pub fn points(&mut self, name: &str, pen: Pen, points: &[[f64; 3]]) -> Option<Trace> {
        let list = |axis: usize| -> Vec<f32> { points.iter().map(|p| p[axis] as f32).collect() };
        let x = self.blob.add(&list(1))?;
        let y = self.blob.add(&list(2))?;
        let times: Vec<f64> = points.iter().map(|point| point[0]).collect();
        Some(Trace {
            name: name.to_owned(),
            pen,
            data: Data::Samples {
                x,
                y,
                sigma: None,
                time: Some(self.blob.add_times(&times)),
            },
        })
    }

    /// A column in the units of the page.
    fn column(&self, frame: &Frame, spec: Spec<'_>, name: &str) -> Option<Vec<f32>> {
        let (factor, _) = self.options.units.of(spec.quantity);
        let mut values = frame.get(name)?.to_vec();
        for value in &mut values {
            *value = (f64::from(*value) * factor) as f32;
        }
        if spec.needs_speed && self.is_slow.len() == values.len() {
            for (value, is_slow) in values.iter_mut().zip(&self.is_slow) {
                if *is_slow {
                    *value = f32::NAN;
                }
            }
        }
        Some(values)
    }

    /// Time and values of all samples, with a break in each gap.
    fn samples(
        &mut self,
        time_s: &[f64],
        values: &[f32],
        add: impl Fn(&mut Blob, &[f32]) -> Option<Id>,
    ) -> Option<(Id, Id)> {
        let gap_s = self.drive.thinning.gap_s(GAP_S);
        let has_gap = time_s.windows(2).any(|pair| pair[1] - pair[0] > gap_s);
        if !has_gap {
            let y = add(self.blob, values)?;
            return Some((self.blob.add_times(time_s), y));
        }
        let (mut times, mut broken) = (Vec::new(), Vec::new());
        for (time, value) in time_s.iter().zip(values) {
            if let Some(last) = times.last().copied()
                && time - last > gap_s
            {
                times.push(last + 1e-3);
                broken.push(f32::NAN);
            }
            times.push(*time);
            broken.push(*value);
        }
        let y = add(self.blob, &broken)?;
        Some((self.blob.add_times(&times), y))
    }

    /// Least and greatest value of each stretch of time, from those of samples or of shorter stretches; a
    /// long time without any is a break.
    fn envelope(&mut self, samples: impl Iterator<Item = (f64, [f32; 2])>) -> Option<Data> {
        let thinning = self.drive.thinning;
        let (stretch_s, gap_s) = (thinning.stretch_s(STRETCH_S), thinning.gap_s(GAP_S));
        // A drive that is thinned begins with a stretch of its own.
        let begin_s = if thinning.is_on() {
            self.drive.span_s[0]
        } else {
            0.0
        };
        let (mut times, mut low, mut high) = (Vec::new(), Vec::new(), Vec::new());
        let mut before = None;
        for (time_s, [least, greatest]) in samples {
            let stretch = ((time_s - begin_s) / stretch_s).floor() as i64;
            if before != Some(stretch) {
                let is_gap = |before| (stretch - before - 1) as f64 * stretch_s >= gap_s;
                if before.is_some_and(is_gap) {
                    times.push(times.last().copied().unwrap_or_default() + 1e-3);
                    low.push(f32::NAN);
                    high.push(f32::NAN);
                }
                before = Some(stretch);
                times.push(begin_s + (stretch as f64 + 0.5) * stretch_s);
                low.push(least);
                high.push(greatest);
            } else if let (Some(low), Some(high)) = (low.last_mut(), high.last_mut()) {
                *low = low.min(least);
                *high = high.max(greatest);
            }
        }
        let low = self.blob.add_envelope(&low)?;
        let high = self.blob.add_envelope(&high)?;
        let x = self.blob.add_times(&times);
        Some(Data::Envelope { x, low, high })
    }

    /// Panels of an estimated motion: the estimate, the reference, and below it the error.
    pub fn motion_panels(&mut self, y_label: &str, specs: &[Spec<'_>]) -> Vec<Panel> {
        let drive = self.drive;
        let reference = self
            .reference
            .map(|reference| (&reference.motion, reference));
        self.compared(&drive.motion, reference, y_label, specs)
    }

    /// Panels of estimated columns beside those of the reference.
    pub fn compared(
        &mut self,
        frame: &Frame,
        reference: Option<(&Frame, &Reference)>,
        y_label: &str,
        specs: &[Spec<'_>],
    ) -> Vec<Panel> {
        let mut main = super::panel(y_label, None);
        let mut error = Panel {
            is_error: true,
            ..super::panel(format!("error ({})", self.unit(specs[0].quantity)), None)
        };
        for spec in specs {
            main.traces.extend(self.curve(frame, *spec));
            let Some((other, reference)) = reference else {
                continue;
            };
            let name = match specs.len() {
                1 => reference.name.to_owned(),
                _ => format!("{}, {}", spec.name, reference.name),
            };
            let beside = Spec {
                name: &name,
                pen: reference.pen,
                sigma: None,
                is_important: false,
                ..*spec
            };
            main.traces.extend(self.curve(other, beside));
            let own = self.column(frame, *spec, spec.column);
            let others = self.column(other, *spec, spec.column);
            if let Some((own, others)) = own.zip(others)
                && own.len() == others.len()
            {
                let difference = own.iter().zip(&others).map(|(a, b)| a - b).collect();
                let name = match specs.len() {
                    1 => "error".to_owned(),
                    _ => format!("{}, error", spec.name),
                };
                let of_error = Spec {
                    name: &name,
                    is_important: false,
                    ..*spec
                };
                let trace = self.of_values(&frame.time_s, difference, None, of_error);
                error.traces.extend(trace);
            }
        }
        vec![main, error]
    }
}

mod rough;

use model::vehicle::Vehicle;

use crate::driver::{self, Intent, Plan, SurfaceLine};
use crate::jackstand::{self, smooth};
use crate::slope::Slope;
use crate::{Motion, SimError, workshop};

/// A manoeuvre that the model drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Manoeuvre {
    /// A circle of 15.24 m (50 ft) radius at slowly rising speed.
    Circle,
    /// Sine steer at 0.3 Hz.
    SlowSine,
    /// Sine steer at 0.7 Hz.
    FastSine,
    /// Sine steer of rising frequency.
    SteerSweep,
    /// A step of the steering wheel.
    StepSteer,
    /// Sine steer from asphalt onto gravel.
    AsphaltToGravel,
    /// Full throttle from rest, then hard braking.
    LaunchBrake,
    /// On jackstands, lowered, then at rest on the ground.
    Jackstand,
    /// At rest, turned by half a turn on a floor that is not level, at rest.
    Turned,
    /// On scales, with load put in and taken out.
    Weighed,
    /// On stands, one wheel after the other pushed by known forces.
    LoadRig,
    /// On turn plates, steered from side to side.
    TurnPlates,
    /// A minute of ordinary driving that ends as it begins, to be [repeated](Motion::repeated).
    MixedDriving,
    /// Circles of 25 m radius on a slope of 15 %.
    Hillside,
    /// S-curves at 8 to 12 m/s on a road of ISO 8608 class C.
    RoughRoad,
    /// At 3 to 6 m/s over rocks of 0.06 to 0.10 m under one wheel or an axle.
    Rocks,
    /// From 5 to 12 m/s over a washboard of 0.8 m, through wheel hop.
    Washboard,
    /// At 2 m/s through ditches in turn on the left and the right side.
    TwistDitch,
    /// Five jumps off ramps at 7 to 9 m/s.
    Jump,
    /// 90 s of class D, bumps, side slope, gravel and braking.
    Trail,
    /// Circles of 20 m radius on a slope of 15 % of class D.
    HillsideRough,
    /// Forwards, then backwards, on class D.
    Reverse,
    /// A known force of 400 N on the hitch, on class C.
    Tow,
}

impl Manoeuvre {
    /// All manoeuvres.
    pub const ALL: [Self; 23] = [
        Self::Circle,
        Self::SlowSine,
        Self::FastSine,
        Self::SteerSweep,
        Self::StepSteer,
        Self::AsphaltToGravel,
        Self::LaunchBrake,
        Self::Jackstand,
        Self::Turned,
        Self::Weighed,
        Self::LoadRig,
        Self::TurnPlates,
        Self::MixedDriving,
        Self::Hillside,
        Self::RoughRoad,
        Self::Rocks,
        Self::Washboard,
        Self::TwistDitch,
        Self::Jump,
        Self::Trail,
        Self::HillsideRough,
        Self::Reverse,
        Self::Tow,
    ];

    /// The name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Circle => "circle",
            Self::SlowSine => "slow-sine",
            Self::FastSine => "fast-sine",
            Self::SteerSweep => "steer-sweep",
            Self::StepSteer => "step-steer",
            Self::AsphaltToGravel => "asphalt-to-gravel",
            Self::LaunchBrake => "launch-brake",
            Self::Jackstand => "jackstand",
            Self::Turned => "turned",
            Self::Weighed => "weighed",
            Self::LoadRig => "load-rig",
            Self::TurnPlates => "turn-plates",
            Self::MixedDriving => "mixed-driving",
            Self::Hillside => "hillside",
            Self::RoughRoad => "rough-road",
            Self::Rocks => "rocks",
            Self::Washboard => "washboard",
            Self::TwistDitch => "twist-ditch",
            Self::Jump => "jump",
            Self::Trail => "trail",
            Self::HillsideRough => "hillside-rough",
            Self::Reverse => "reverse",
            Self::Tow => "tow",
        }
    }

    /// Description in one line.
    #[must_use]
    pub const fn description(self) -> &'static str {
        match self {
            Self::Circle => "left turn of 15.24 m radius, speed increases until a wheel lifts",
            Self::SlowSine => "sine steer at 0.3 Hz",
            Self::FastSine => "sine steer at 0.7 Hz",
            Self::SteerSweep => "three sine sweeps of the steering wheel from 0.2 to 2.5 Hz",
            Self::StepSteer => "step of the steering wheel at constant speed",
            Self::AsphaltToGravel => "sine steer, surface changes from asphalt to gravel",
            Self::LaunchBrake => "launch from rest, then hard braking",
            Self::Jackstand => "at rest on jackstands, then lowered to the ground, at rest",
            Self::Turned => "at rest on a sloping floor, turned by 180 degrees, at rest",
            Self::Weighed => "on scales, loaded and unloaded in steps, with marks",
            Self::LoadRig => "on stands, known forces on each wheel, with marks",
            Self::TurnPlates => "on turn plates, steered from side to side, with marks",
            Self::MixedDriving => "a minute of turns, braking and acceleration, can be repeated",
            Self::Hillside => "circles of 25 m radius on a slope of 15 %",
            Self::RoughRoad => "S-curves at 8 to 12 m/s on a road of ISO 8608 class C",
            Self::Rocks => "at 3 to 6 m/s over rocks of 0.06 to 0.10 m under one wheel or an axle",
            Self::Washboard => "from 5 to 12 m/s over a washboard of 0.8 m, through wheel hop",
            Self::TwistDitch => "at 2 m/s through ditches in turn on the left and the right side",
            Self::Jump => "five jumps off ramps at 7 to 9 m/s",
            Self::Trail => "90 s of class D, bumps, side slope, gravel and braking",
            Self::HillsideRough => "circles of 20 m radius on a slope of 15 % of class D",
            Self::Reverse => "forwards, then backwards, on class D",
            Self::Tow => "a known force of 400 N on the hitch, on class C",
        }
    }

    /// The manoeuvre of this name.
    ///
    /// # Errors
    /// A name that none has; the message lists all.
    pub fn by_name(name: &str) -> Result<Self, SimError> {
        Self::ALL
            .into_iter()
            .find(|manoeuvre| manoeuvre.name() == name)
            .ok_or_else(|| SimError::UnknownManoeuvre {
                name: name.to_owned(),
                known: Self::ALL.map(Self::name).join(", "),
            })
    }

    /// Lets a driver perform it: with the model of 14 degrees of freedom where the vehicle file has
    /// springs and unsprung masses, else with the four-wheel model; what happens in the workshop
    /// follows from geometry. Link forces and strut lengths follow from the tyre forces where the vehicle
    /// file has hard-points.
    ///
    /// # Errors
    /// A linkage that cannot stand as the model moves it.
    pub fn drive(self, vehicle: &Vehicle) -> Result<Motion, SimError> {
        if let Some(road) = self.road()? {
            return self.drive_on(vehicle, &road);
        }
        let plan = self.plan();
        let (states, tips_over) = match (self, &plan) {
            (_, Some(plan)) => driver::drive(vehicle, plan)?,
            (Self::Turned, _) => return workshop::turned(vehicle),
            (Self::Weighed, _) => return workshop::weighed(vehicle),
            (Self::LoadRig, _) => return workshop::rigged(vehicle),
            (Self::TurnPlates, _) => return workshop::plated(vehicle),
            _ => (jackstand::states(vehicle)?, false),
        };
        let states = match self {
            // The tyres' first deflection would be a jump at the end of each lap; on the slope the
            // springs settle first.
            Self::MixedDriving | Self::Hillside => states
                .into_iter()
                .filter(|state| state.time_s >= RUN_IN_S)
                .collect(),
            _ => states,
        };
        let mut motion = Motion::new(self.name(), states)?.with_end(tips_over);
        motion.complete(vehicle)?;
        Ok(match plan.and_then(|plan| plan.slope) {
            Some(slope) => motion.laid_on(&slope),
            None => motion,
        })
    }

    /// What the driver intends on a plane; none where nobody drives, or on a road.
    fn plan(self) -> Option<Plan> {
        if let Some(plan) = self.steering_test() {
            return Some(plan);
        }
        Some(match self {
            Self::Circle => Plan {
                surface_line: Some(FRESH_ASPHALT),
                ..plan(
                    54.0,
                    3.5,
                    |t| (3.5 + 0.13 * t).min(9.7),
                    Intent::Curvature(|t| smooth(t / 3.0) / CIRCLE_RADIUS_M),
                )
            },
            Self::AsphaltToGravel => Plan {
                surface_line: Some(GRAVEL),
                ..plan(
                    24.0,
                    8.0,
                    |_| 8.0,
                    Intent::SteeringWheel(|t| 1.9 * sine(t - 1.0, 0.3, 6.0)),
                )
            },
            Self::LaunchBrake => plan(
                15.0,
                0.0,
                |t| {
                    // 3 m/s^2 to 15 m/s, then 0.5 g to walking pace (a standing tyre's stiction is
                    // not in the model), each set in within half a second.
                    let launch = (3.0 * gathered(t - 1.0)).min(15.0);
                    let brake = 4.9 * gathered(t - 8.0);
                    (launch - brake).max(launch.min(WALKING_M_S))
                },
                Intent::SteeringWheel(|_| 0.0),
            ),
            Self::MixedDriving => plan(
                RUN_IN_S + 60.0,
                8.0,
                |t| mixed_speed(t - RUN_IN_S),
                Intent::SteeringWheel(|t| mixed_steering_wheel(t - RUN_IN_S)),
            ),
            Self::Hillside => Plan {
                slope: Some(Slope::turned(HILLSIDE_RAD[0], HILLSIDE_RAD[1])),
                ..plan(
                    RUN_IN_S + 56.0,
                    7.0,
                    |_| 7.0,
                    Intent::Curvature(|t| smooth((t - RUN_IN_S) / 3.0) / HILLSIDE_RADIUS_M),
                )
            },
            _ => return None,
        })
    }

    /// Tests with a given steering wheel at constant speed on level ground of one surface.
    fn steering_test(self) -> Option<Plan> {
        Some(match self {
            Self::SlowSine => plan(
                26.0,
                8.0,
                |_| 8.0,
                Intent::SteeringWheel(|t| 1.9 * sine(t - 1.0, 0.3, 7.0)),
            ),
            Self::FastSine => plan(
                16.0,
                8.0,
                |_| 8.0,
                Intent::SteeringWheel(|t| 2.0 * sine(t - 1.0, 0.7, 9.0)),
            ),
            Self::SteerSweep => plan(
                3.0 * SWEEP_S + 2.0,
                10.0,
                |_| 10.0,
                Intent::SteeringWheel(|t| 0.7 * sweep(t - 1.0)),
            ),
            Self::StepSteer => plan(
                14.0,
                8.0,
                |_| 8.0,
                Intent::SteeringWheel(|t| {
                    let step = |at: f64| smooth((t - at) / STEP_TIME_S);
                    1.6 * (step(2.0) - step(5.0) - step(8.0) + step(11.0))
                }),
            ),
            _ => return None,
        })
    }
}

/// A plan on level ground of one surface.
fn plan(
    duration_s: f64,
    start_speed_m_s: f64,
    speed_m_s: fn(f64) -> f64,
    steering: Intent,
) -> Plan {
    Plan {
        duration_s,
        start_speed_m_s,
        speed_m_s,
        steering,
        surface_line: None,
        slope: None,
    }
}

/// 50 feet, as the thesis drove it.
const CIRCLE_RADIUS_M: f64 = 15.24;

/// Walking pace.
const WALKING_M_S: f64 = 1.2;

/// How long a quick driver takes to turn the steering wheel.
const STEP_TIME_S: f64 = 0.3;

/// Loose gravel: half of the grip, and softer.
const GRAVEL: SurfaceLine = SurfaceLine {
    east_m: 95.0,
    friction_scale: 0.5,
    stiffness_scale: 0.7,
};

/// Asphalt that grips sooner. On the surface for which the thesis gives its front tyres' stiffness
/// they run out of steer before a wheel of this circle lifts, as it did in the thesis.
const FRESH_ASPHALT: SurfaceLine = SurfaceLine {
    east_m: f64::NEG_INFINITY,
    friction_scale: 1.3,
    stiffness_scale: 2.2,
};

/// The hillside's turn about east and north, rad, and its circles' radius.
const HILLSIDE_RAD: [f64; 2] = [0.12, -0.09];
const HILLSIDE_RADIUS_M: f64 = 25.0;

/// Straight driving before a manoeuvre begins that must not begin with a jump.
const RUN_IN_S: f64 = 4.0;

/// Speed of mixed driving: 8 m/s at both ends.
fn mixed_speed(time_s: f64) -> f64 {
    let change =
        |from_s: f64, over_s: f64, by_m_s: f64| by_m_s * smooth((time_s - from_s) / over_s);
    8.0 + change(8.0, 6.0, 3.0)
        + change(19.0, 4.0, -6.0)
        + change(33.0, 5.0, 3.0)
        + change(41.0, 1.5, -1.5)
        + change(46.0, 4.0, 1.5)
}

/// Steering wheel of mixed driving: straight at both ends.
fn mixed_steering_wheel(time_s: f64) -> f64 {
    let bend = |from_s: f64, over_s: f64, by_rad: f64| {
        let into = smooth((time_s - from_s) / (0.3 * over_s));
        let out = smooth((time_s - from_s - 0.7 * over_s) / (0.3 * over_s));
        by_rad * (into - out)
    };
    // A bend at speed, a lane change, a tight turn when slow, a slalom.
    bend(2.0, 5.0, 0.8)
        + bend(14.0, 3.0, -0.5)
        + bend(17.0, 3.0, 0.5)
        + bend(25.0, 7.0, -2.2)
        + bend(36.0, 2.5, 1.2)
        + bend(38.5, 2.5, -1.2)
        + bend(43.0, 8.0, 1.4)
}

/// Seconds that have passed since zero, as an action counts that sets in within half a second.
fn gathered(time_s: f64) -> f64 {
    const ONSET_S: f64 = 0.5;
    let x = time_s.max(0.0);
    if x < ONSET_S {
        0.5 * x * x / ONSET_S
    } else {
        x - 0.5 * ONSET_S
    }
}

/// This many periods of a sine from time zero, zero before and after.
fn sine(time_s: f64, frequency_hz: f64, periods: f64) -> f64 {
    let phase = frequency_hz * time_s;
    if (0.0..=periods).contains(&phase) {
        math::sin(std::f64::consts::TAU * phase)
    } else {
        0.0
    }
}

/// Length of a sweep, and the frequencies at its ends.
const SWEEP_S: f64 = 24.0;
const SWEEP_HZ: [f64; 2] = [0.2, 2.5];

/// Sweeps from time zero, the frequency rising evenly in its logarithm; each begins and ends at zero
/// softly.
fn sweep(time_s: f64) -> f64 {
    let t = time_s.max(0.0) % SWEEP_S;
    let [low, high] = SWEEP_HZ;
    let octaves = math::ln(high / low) / SWEEP_S;
    let phase = low * (math::exp(octaves * t) - 1.0) / octaves;
    let edge = smooth(t) * smooth(SWEEP_S - t);
    edge * math::sin(std::f64::consts::TAU * phase)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_find_their_manoeuvres() {
        for manoeuvre in Manoeuvre::ALL {
            assert_eq!(Manoeuvre::by_name(manoeuvre.name()).ok(), Some(manoeuvre));
        }
        let error = Manoeuvre::by_name("donut").expect_err("no such manoeuvre");
        assert!(error.to_string().contains("circle, slow-sine"), "{error}");
    }
}

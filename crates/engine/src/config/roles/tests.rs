use std::path::Path;

use super::*;
use crate::config::{Config, Meaning};

/// A DBC file with a signal of each of these units: `M.s0`, `M.s1`...
fn dbc(units: &[&str]) -> String {
    let mut text = "VERSION \"\"\nBU_: A\nBO_ 256 M: 64 A\n".to_owned();
    for (number, unit) in units.iter().enumerate() {
        let start = 16 * number;
        text += &format!(" SG_ s{number} : {start}|16@1- (0.1,0) [0|0] \"{unit}\" A\n");
    }
    text
}

/// The roles of a bus with a DBC file of these units.
fn roles(units: &[&str], table: &str, more: &str) -> Result<Vec<Role>, String> {
    let directory = tempfile::tempdir().expect("a directory");
    std::fs::write(directory.path().join("own.dbc"), dbc(units)).expect("written");
    let text = format!(
        "[source.bus]\nkind = \"can\"\ninterface = \"can0\"\ndbc = [\"own.dbc\"]\n\
         [source.bus.roles]\n{table}\n{more}"
    );
    let config = Config::from_text(&text, directory.path()).map_err(|error| error.to_string())?;
    match &config.sources[0].meaning {
        Meaning::Can(can) => Ok(can.roles.iter().map(|role| role.role).collect()),
        other => panic!("{other:?}"),
    }
}

/// Each entry: the unit of a signal, the key of a role, and the role that this signal has.
fn assert_units(cases: &[(&str, &str, Role)]) {
    for (unit, key, expected) in cases {
        let found = roles(&[unit], &format!("{key} = \"M.s0\""), "").expect(key);
        // The last digits depend on how the degrees of a turn are multiplied.
        assert_eq!(found.len(), 1, "{key}");
        let [found, expected] = [format!("{:.12?}", found[0]), format!("{expected:.12?}")];
        assert_eq!(found, expected, "{key} in {unit}");
    }
}

#[test]
fn the_unit_tells_an_angle_of_a_wheel_from_a_travel_of_a_tie_rod() {
    let degree = 1.0_f64.to_radians();
    let angle = Role::Control(ControlValue::WheelAngle(Side::Left), degree);
    let travel = Role::SteerRod(Side::Right, Travel::Length(1e-3));
    assert_units(&[
        ("deg", "steer_left", angle),
        ("deg", "wheel_angle.FL", angle),
        ("mm", "steer_right", travel),
    ]);
}

#[test]
fn roles_take_the_unit_of_the_signal() {
    let degree = 1.0_f64.to_radians();
    let fl = Wheel::FrontLeft;
    let channel = StrainChannel::TieRod;
    let strain = |signal, factor| Role::Strain(fl, channel, StrainUnit::Of(signal, factor));
    assert_units(&[
        ("deg", "steer", Role::Steer(degree)),
        (
            "rpm",
            "wheel_speed.FL",
            Role::WheelSpeed(fl, WheelRate::Angular(6.0 * degree)),
        ),
        (
            "km/h",
            "wheel_speed.FL",
            Role::WheelSpeed(fl, WheelRate::Rolling(1.0 / 3.6)),
        ),
        (
            "mph",
            "wheel_speed.FL",
            Role::WheelSpeed(fl, WheelRate::Rolling(0.447_04)),
        ),
        (
            "count",
            "deflection.FL",
            Role::Deflection(fl, Travel::Counts),
        ),
        (
            "mm",
            "deflection.FL",
            Role::Deflection(fl, Travel::Length(1e-3)),
        ),
        (
            "in",
            "deflection.FL",
            Role::Deflection(fl, Travel::Length(0.0254)),
        ),
        (
            "V",
            "deflection.FL",
            Role::Deflection(fl, Travel::Voltage(1.0)),
        ),
        (
            "",
            "strain.FL.tie_rod",
            Role::Strain(fl, channel, StrainUnit::Counts),
        ),
        ("V", "strain.FL.tie_rod", strain(StrainSignal::Voltage, 1.0)),
        (
            "mV/V",
            "strain.FL.tie_rod",
            strain(StrainSignal::BridgeRatio, 1e-3),
        ),
        (
            "µm/m",
            "strain.FL.tie_rod",
            strain(StrainSignal::Strain, 1e-6),
        ),
        (
            "kN",
            "strain.FL.tie_rod",
            strain(StrainSignal::Load, 1000.0),
        ),
    ]);
}

#[test]
fn roles_of_motion_and_controls_take_the_unit_of_the_signal() {
    let degree = 1.0_f64.to_radians();
    let fl = Wheel::FrontLeft;
    assert_units(&[
        ("mm", "rack", Role::Rack(1e-3)),
        (
            "g",
            "acceleration.z",
            Role::Quantity(Quantity::Acceleration(2), 9.806_65),
        ),
        ("°/s", "rate.x", Role::Quantity(Quantity::Rate(0), degree)),
        (
            "kph",
            "speed.forward",
            Role::Quantity(Quantity::ForwardSpeed, 1.0 / 3.6),
        ),
        (
            "deg",
            "gnss.heading",
            Role::Quantity(Quantity::Heading, degree),
        ),
        ("", "gnss.fix", Role::Fix),
        (
            "kN",
            "hitch_force.x",
            Role::Control(ControlValue::HitchForce(0), 1000.0),
        ),
        (
            "bar",
            "brake_pressure.FL",
            Role::Control(ControlValue::BrakePressure(fl), 1e5),
        ),
        (
            "Nm",
            "drive_torque.FL",
            Role::Control(ControlValue::DriveTorque(fl), 1.0),
        ),
        (
            "Nm",
            "brake_torque.FL",
            Role::Control(ControlValue::BrakeTorque(fl), 1.0),
        ),
        (
            "bar",
            "tyre_pressure.FL",
            Role::Control(ControlValue::TyrePressure(fl), 1e5),
        ),
        (
            "kPa",
            "tyre_pressure.FL",
            Role::Control(ControlValue::TyrePressure(fl), 1e3),
        ),
        (
            "Pa",
            "tyre_pressure.FL",
            Role::Control(ControlValue::TyrePressure(fl), 1.0),
        ),
        // A pound-force on a square inch.
        (
            "psi",
            "tyre_pressure.FL",
            Role::Control(ControlValue::TyrePressure(fl), 6_894.757_293_168),
        ),
        ("%", "throttle", Role::Control(ControlValue::Throttle, 0.01)),
        (
            "Nm",
            "engine_torque",
            Role::Control(ControlValue::EngineTorque, 1.0),
        ),
        (
            "°C",
            "bridge_temperature.FL",
            Role::Control(ControlValue::BridgeTemperature(fl), 1.0),
        ),
    ]);
    let turned = roles(&["g"], "acceleration.z = \"-M.s0\"", "").expect("a minus");
    let expected = Role::Quantity(Quantity::Acceleration(2), -9.806_65);
    assert_eq!(turned, [expected]);
}

/// Earlier, a deflection in mm and strain with a sign passed, and their bits were taken for counts.
#[test]
fn a_unit_that_does_not_fit_is_named_with_what_the_role_needs() {
    for (unit, key, needs) in [
        (
            "deg",
            "deflection.FL",
            "the role deflection.FL needs counts, V, mV, m, mm, cm",
        ),
        (
            "mm",
            "strain.FL.tie_rod",
            "the role strain.FL.tie_rod needs counts, V, mV, mV/V",
        ),
        ("N", "strain.FL.lower_front_bending", "Nm"),
        ("mm", "steer", "the role steer needs rad or deg"),
        (
            "m",
            "wheel_speed.RR",
            "rad/s, deg/s, rpm, rev/s, m/s, km/h, mph or kn",
        ),
        ("rad", "acceleration.x", "m/s^2"),
        ("m/s^2", "rate.z", "rad/s"),
        ("bar", "throttle", "the role throttle needs % or 1"),
        (
            "degC",
            "tyre_pressure.RR",
            "the role tyre_pressure.RR needs Pa, kPa, MPa, bar or psi",
        ),
    ] {
        let error = roles(&[unit], &format!("{key} = \"M.s0\""), "").expect_err(key);
        let told = format!("signal M.s0 has the unit \"{unit}\"");
        assert!(error.contains(&told) && error.contains(needs), "{error}");
    }
}

#[test]
fn a_signal_has_one_role_and_a_measurement_all_of_its_parts() {
    let table = "wheel_speed.FL = \"M.s0\"\nwheel_speed.FR = \"M.s0\"";
    let error = roles(&["rpm"], table, "").expect_err("two roles");
    assert!(error.contains("wheel_speed.FL already"), "{error}");
    let error = roles(&["m/s"], "gnss.speed = \"M.s0\"", "").expect_err("no course");
    assert!(error.contains("without gnss.course"), "{error}");
    let both = "gnss.speed = \"M.s0\"\ngnss.course = \"M.s1\"";
    assert_eq!(roles(&["m/s", "deg"], both, "").expect("both").len(), 2);
    let error = roles(&["count"], "deflection.FL = \"-M.s0\"", "").expect_err("a minus");
    assert!(error.contains("gain_per_count"), "{error}");
    let error = roles(&["mm"], "deflection.FL = \"N.s0\"", "").expect_err("no message");
    assert!(error.contains("no DBC file has a message \"N\""), "{error}");
}

/// Channels of other suspensions have names of their own beside those of a double wishbone.
#[test]
fn channels_of_other_suspensions_have_two_names() {
    let fr = Wheel::FrontRight;
    for (name, channel) in [
        ("strut_side_x", StrainChannel::UpperFront),
        ("upper_front", StrainChannel::UpperFront),
        ("strut_side_y", StrainChannel::UpperRear),
        ("upper_rear", StrainChannel::UpperRear),
        ("outer_bushing_z", StrainChannel::UpperRear),
        ("lower_link", StrainChannel::LowerFront),
        ("panhard_rod", StrainChannel::TieRod),
    ] {
        let table = format!("strain.FR.{name} = \"M.s0\"");
        let found = roles(&["count"], &table, "").expect(name);
        assert_eq!(found, [Role::Strain(fr, channel, StrainUnit::Counts)]);
        let error = roles(&["mm"], &table, "").expect_err(name);
        let told = format!("the role strain.FR.{name} needs counts");
        assert!(error.contains(&told), "{error}");
    }
    let both = "strain.FR.strut_side_x = \"M.s0\"\nstrain.FR.upper_front = \"M.s1\"";
    let error = roles(&["count", "count"], both, "").expect_err("one channel twice");
    assert!(
        error.contains("strain.FR.upper_front is the same channel"),
        "{error}"
    );
}

/// Strain in V needs the excitation, which a chain that is given by its calibration does not have.
#[test]
fn a_unit_that_the_sensors_file_does_not_convert_is_refused() {
    let vehicle = "[vehicle]\nfile = \"prowler\"\nsensors = \"thesis-10bit\"\n";
    let table = "deflection.FL = \"M.s0\"";
    let error = roles(&["V"], table, vehicle).expect_err("no excitation");
    assert!(
        error.contains("excitation_v of these potentiometers"),
        "{error}"
    );
    assert!(error.contains("signal M.s0 has the unit \"V\""), "{error}");
    roles(&["V"], "strain.FL.tie_rod = \"M.s0\"", vehicle).expect("gauges and amplifier");
    let error = roles(&["Nm"], "strain.FL.lower_front_bending = \"M.s0\"", vehicle);
    let error = error.expect_err("no bending bridge");
    assert!(error.contains("no strain.bending"), "{error}");
}

/// A role that the configuration gives goes before that of the built-in file.
#[test]
fn a_role_of_the_built_in_file_gives_way() {
    let text = "[source.can0]\nkind = \"can\"\ninterface = \"can0\"\n\
                [source.can0.roles]\nwheel_speed.FL = \"WheelSpeed.FR\"\n";
    let config = Config::from_text(text, Path::new(".")).expect("a configuration");
    let Meaning::Can(can) = &config.sources[0].meaning else {
        panic!("a bus");
    };
    let wheels: Vec<Wheel> = can
        .roles
        .iter()
        .filter_map(|role| match role.role {
            Role::WheelSpeed(wheel, _) => Some(wheel),
            _ => None,
        })
        .collect();
    assert_eq!(
        wheels,
        [Wheel::FrontLeft, Wheel::RearLeft, Wheel::RearRight]
    );
}

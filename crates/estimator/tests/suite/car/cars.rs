//! Five cars on five roads, with five sets of sensor errors.

use super::road::Lap;
use super::surrogate::{AxleOfCar, Car, Errors};

pub struct Case {
    pub name: &'static str,
    pub car: Car,
    pub lap: Lap,
    pub errors: Errors,
}

const DEG: f64 = std::f64::consts::PI / 180.0;

const AXLE: AxleOfCar = AxleOfCar {
    track_m: 1.5,
    friction: 1.15,
    friction_fall: 0.1,
    stiffness: 16.0,
    load_of_greatest: 2.0,
    shape: 1.35,
    curvature: -0.3,
    relaxation_m: 0.5,
    roll_stiffness_n_m_rad: 50_000.0,
    compliance_rad_n: 1.5e-6,
    roll_steer: 0.0,
};

/// A tyre of low stiffness that slides late.
const SOFT: AxleOfCar = AxleOfCar {
    shape: 1.25,
    curvature: -0.6,
    relaxation_m: 0.6,
    ..AXLE
};

const CAR: Car = Car {
    mass_kg: 1600.0,
    front_m: 1.25,
    rear_m: 1.3,
    cg_height_m: 0.5,
    yaw_inertia_kg_m2: 2500.0,
    roll_inertia_kg_m2: 600.0,
    roll_arm_m: 0.4,
    roll_damping: 6000.0,
    axles: [
        AXLE,
        AxleOfCar {
            stiffness: 18.0,
            roll_stiffness_n_m_rad: 35_000.0,
            compliance_rad_n: 0.2e-6,
            ..AXLE
        },
    ],
    drive_front: 0.0,
    brake_front: 0.65,
    drag_n_s2_m2: 0.4,
};

const LAP: Lap = Lap {
    seed: 1,
    lateral_m_s2: 10.0,
    speed_max_m_s: 38.0,
    push_m_s2: 3.5,
    brake_m_s2: 8.0,
    bend_bank: 0.003,
    bank_rad: 0.015,
    grade: 0.02,
    drift: 0.0,
};

const ERRORS: Errors = Errors {
    steer_rad: 0.4 * DEG,
    steer_gain: 1.0,
    gyro_rad_s: 0.15 * DEG,
    accel_m_s2: 0.07,
    speed_gain: 1.002,
    imu_height_m: 0.1,
    noise: [0.02, 0.0005, 0.002, 0.15],
};

pub const SPORT: Case = Case {
    name: "sport",
    car: CAR,
    lap: LAP,
    errors: ERRORS,
};

/// Engine behind the driver, old tyres: sideslip up to 18 degrees.
const CLASSIC: Case = Case {
    name: "classic",
    car: Car {
        mass_kg: 1500.0,
        front_m: 1.35,
        rear_m: 1.1,
        yaw_inertia_kg_m2: 2000.0,
        brake_front: 0.55,
        axles: [
            AxleOfCar {
                stiffness: 9.0,
                friction: 1.1,
                ..SOFT
            },
            AxleOfCar {
                stiffness: 10.0,
                friction: 1.1,
                roll_stiffness_n_m_rad: 40_000.0,
                ..SOFT
            },
        ],
        ..CAR
    },
    lap: Lap {
        seed: 2,
        lateral_m_s2: 9.0,
        ..LAP
    },
    errors: Errors {
        steer_rad: -0.8 * DEG,
        steer_gain: 0.95,
        gyro_rad_s: -0.1 * DEG,
        accel_m_s2: -0.09,
        ..ERRORS
    },
};

/// Heavy, driven at all four wheels, compliant steering, banked bends, tyres that fade.
const GT: Case = Case {
    name: "gt",
    car: Car {
        mass_kg: 1780.0,
        front_m: 1.28,
        rear_m: 1.42,
        cg_height_m: 0.54,
        yaw_inertia_kg_m2: 3000.0,
        axles: [
            AxleOfCar {
                stiffness: 13.0,
                compliance_rad_n: 3e-6,
                friction: 1.2,
                ..AXLE
            },
            AxleOfCar {
                stiffness: 17.0,
                friction: 1.25,
                roll_steer: 0.03,
                ..AXLE
            },
        ],
        drive_front: 0.3,
        ..CAR
    },
    lap: Lap {
        seed: 3,
        lateral_m_s2: 10.5,
        bend_bank: 0.006,
        bank_rad: 0.01,
        drift: -0.05,
        ..LAP
    },
    errors: Errors {
        steer_rad: 0.3 * DEG,
        steer_gain: 1.06,
        gyro_rad_s: 0.3 * DEG,
        accel_m_s2: 0.1,
        speed_gain: 0.997,
        ..ERRORS
    },
};

/// Oversteers, over a crooked road, on tyres that warm up.
const LOOSE: Case = Case {
    name: "loose",
    car: Car {
        mass_kg: 1550.0,
        front_m: 1.2,
        axles: [
            AxleOfCar {
                stiffness: 15.0,
                ..AXLE
            },
            AxleOfCar {
                stiffness: 14.5,
                roll_steer: -0.02,
                friction: 1.12,
                ..AXLE
            },
        ],
        ..CAR
    },
    lap: Lap {
        seed: 4,
        lateral_m_s2: 7.6,
        bank_rad: 0.025,
        grade: 0.04,
        drift: 0.06,
        ..LAP
    },
    errors: Errors {
        steer_rad: 1.0 * DEG,
        steer_gain: 0.98,
        gyro_rad_s: -0.2 * DEG,
        accel_m_s2: -0.05,
        speed_gain: 1.003,
        ..ERRORS
    },
};

/// Wide tyres, stiff springs, most of the weight behind.
const RACER: Case = Case {
    name: "racer",
    car: Car {
        mass_kg: 1500.0,
        front_m: 1.4,
        rear_m: 1.0,
        cg_height_m: 0.45,
        roll_arm_m: 0.3,
        yaw_inertia_kg_m2: 1800.0,
        axles: [
            AxleOfCar {
                stiffness: 12.0,
                friction: 1.3,
                ..SOFT
            },
            AxleOfCar {
                stiffness: 12.5,
                friction: 1.28,
                roll_stiffness_n_m_rad: 90_000.0,
                ..SOFT
            },
        ],
        brake_front: 0.62,
        ..CAR
    },
    lap: Lap {
        seed: 5,
        lateral_m_s2: 9.6,
        speed_max_m_s: 45.0,
        push_m_s2: 4.5,
        brake_m_s2: 8.5,
        drift: -0.03,
        ..LAP
    },
    errors: Errors {
        steer_rad: 0.5 * DEG,
        steer_gain: 1.1,
        gyro_rad_s: 0.1 * DEG,
        accel_m_s2: 0.06,
        ..ERRORS
    },
};

pub const ALL: [Case; 5] = [SPORT, CLASSIC, GT, LOOSE, RACER];

use nalgebra::{Matrix3, Vector3};
use sample::Wheel;

use crate::Error;
use crate::suspension::linkage::{Coordinates, Linkage, OutboardPart, PARTS, PointPath};
use crate::suspension::{Corner as Wishbone, StraightPath, SuspensionError};
use crate::tyre::Tyre;
use crate::vehicle::{Strut, Unsprung, Vehicle};

/// How a wheel is guided.
#[derive(Clone, Debug, PartialEq)]
pub enum Suspension {
    /// By a double wishbone; the second coordinate is the rack travel.
    Wishbone(Box<Wishbone>),
    /// Along a straight line; the second coordinate is the steer angle.
    Straight(StraightPath),
}

/// A corner's parts at one place of its coordinates.
pub(super) struct Outboard {
    pub wheel: PointPath,
    pub spindle: Vector3<f64>,
    pub parts: [OutboardPart; PARTS],
}

impl Suspension {
    pub(super) fn outboard(
        &self,
        at: Coordinates,
        unsprung: &Unsprung,
    ) -> Result<Outboard, SuspensionError> {
        fn of<L: Linkage>(
            linkage: &L,
            at: Coordinates,
            unsprung: &Unsprung,
        ) -> Result<Outboard, SuspensionError> {
            let pose = linkage.pose(at)?;
            Ok(Outboard {
                wheel: linkage.wheel(&pose),
                spindle: linkage.spindle(&pose),
                parts: linkage.parts(&pose, unsprung),
            })
        }
        match self {
            Self::Wishbone(corner) => of(corner.as_ref(), at, unsprung),
            Self::Straight(path) => of(path, at, unsprung),
        }
    }
}

/// One corner.
#[derive(Clone, Debug, PartialEq)]
pub struct Corner {
    /// Which wheel.
    pub wheel: Wheel,
    /// How the wheel is guided.
    pub suspension: Suspension,
    /// Masses of the outboard parts.
    pub unsprung: Unsprung,
    /// Spring, damper and stops.
    pub strut: Strut,
    /// Force at this wheel per metre that its centre stands higher than the other's, from the
    /// anti-roll bar, N/m.
    pub bar_n_m: f64,
    /// Wheel centre's height in the design position, m.
    pub design_height_m: f64,
    /// Tyre in slip.
    pub tyre: Tyre,
    /// Its file: radius, springs, tread, rolling resistance, relaxation.
    pub tyre_file: crate::vehicle::Tyre,
    /// Radius that carries spin to the ground, m.
    pub rolling_radius_m: f64,
    /// Whether drive torque is reacted by the chassis, otherwise by the wheel's carrier.
    pub drive_on_chassis: bool,
    /// Whether brake torque is reacted by the wheel's carrier, otherwise by the chassis.
    pub brake_on_carrier: bool,
}

/// Parameters of the vehicle.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    /// Sprung mass, kg.
    pub sprung_mass_kg: f64,
    /// Inertia of the sprung part about its centre of gravity, kg m^2.
    pub sprung_inertia_kg_m2: Matrix3<f64>,
    /// Centre of gravity of the sprung part, vehicle axes, m.
    pub sprung_cg_m: Vector3<f64>,
    /// Drag, N s^2/m^2.
    pub drag_n_s2_m2: f64,
    /// Gravity, m/s^2.
    pub gravity_m_s2: f64,
    /// Speed below which slip without relaxation is blended, m/s.
    pub low_speed_m_s: f64,
    /// The corners.
    pub corners: [Corner; 4],
}

impl Parameters {
    /// The parameters of a vehicle: with hard-points and a rack on its linkages, otherwise on the
    /// straight paths that its roll-centre heights give.
    ///
    /// # Errors
    /// Where the file has no unsprung masses or struts, or hard-points that do not assemble.
    pub fn from_vehicle(vehicle: &Vehicle) -> Result<Self, Error> {
        let sprung = vehicle.sprung();
        let [ix, iy, iz] = sprung.inertia_kg_m2;
        let xz = -sprung.inertia_xz_kg_m2;
        let corner = |wheel| corner(vehicle, wheel);
        Ok(Self {
            sprung_mass_kg: sprung.mass_kg,
            sprung_inertia_kg_m2: Matrix3::new(ix, 0.0, xz, 0.0, iy, 0.0, xz, 0.0, iz),
            sprung_cg_m: sprung.cg_m.into(),
            drag_n_s2_m2: vehicle.body.drag_n_s2_m2,
            gravity_m_s2: sample::STANDARD_GRAVITY_M_S2,
            low_speed_m_s: 0.5,
            corners: [
                corner(Wheel::FrontLeft)?,
                corner(Wheel::FrontRight)?,
                corner(Wheel::RearLeft)?,
                corner(Wheel::RearRight)?,
            ],
        })
    }

    /// Total mass, kg.
    #[must_use]
    pub fn mass_kg(&self) -> f64 {
        let unsprung = |corner: &Corner| corner.unsprung.total_mass_kg();
        self.sprung_mass_kg + self.corners.iter().map(unsprung).sum::<f64>()
    }
}

fn corner(vehicle: &Vehicle, wheel: Wheel) -> Result<Corner, Error> {
    let axle = vehicle.axle(wheel);
    let front = wheel.is_front();
    let missing = |part: [&'static str; 2]| Error::MissingPart {
        vehicle: vehicle.name.clone(),
        part: part[usize::from(!front)],
        model: "the vehicle on rough ground",
    };
    let unsprung = axle.unsprung.clone();
    let unsprung = unsprung.ok_or_else(|| missing(["front.unsprung", "rear.unsprung"]))?;
    let struts = ["front.strut", "rear.strut"];
    let strut = axle.strut.clone().ok_or_else(|| missing(struts))?;
    let static_load_n = vehicle.static_load_n(wheel);
    let suspension = if axle.has_hard_points() && vehicle.steering.rack_m_rad.is_some() {
        Suspension::Wishbone(Box::new(Wishbone::of(vehicle, wheel)?))
    } else {
        Suspension::Straight(StraightPath::of(vehicle, wheel).ok_or_else(|| missing(struts))?)
    };
    let design = Coordinates {
        strut: strut.design_length_m,
        rack: 0.0,
    };
    let drivetrain = &vehicle.drivetrain;
    Ok(Corner {
        wheel,
        design_height_m: suspension.outboard(design, &unsprung)?.wheel.point_m.z,
        suspension,
        unsprung,
        strut,
        bar_n_m: axle.anti_roll_bar_n_m_rad / axle.track_m.powi(2),
        tyre: Tyre::from_vehicle(&axle.tyre),
        rolling_radius_m: axle.tyre.rolling_radius_m(static_load_n),
        tyre_file: axle.tyre.clone(),
        drive_on_chassis: drivetrain.drive_reacted_by_chassis,
        brake_on_carrier: if front {
            drivetrain.front_brake_outboard
        } else {
            drivetrain.rear_brake_outboard
        },
    })
}

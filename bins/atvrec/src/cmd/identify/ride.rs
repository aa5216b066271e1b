//! Estimates of a log as arrays for identification.

use anyhow::Context;
use engine::Config;
use engine::config::{FileKind, Files};
use estimator::finding::Refusal;
use estimator::identification::{Drive, tyre};
use model::steering::SteeringGear;
use model::vehicle::Vehicle;
use sample::{LogTime, PerWheel, Wheel};
use store::{Reader, Table, Values};

use crate::cli::IdentifyArgs;

/// Interval of the estimates, s.
const DT_S: f64 = estimator::GRID_NANOS as f64 * 1e-9;
/// Interval of the rows of tyre data that are used.
const TYRE_STRIDE: usize = 10;
/// Smallest speed at which slip angles are used, m/s.
const SLIP_SPEED_MIN_M_S: f64 = 3.0;
/// Value of `source` of a tyre force of the fusion filter.
const FUSION: i32 = 3;

/// Sensors on which the estimates of a drive depend.
#[derive(Clone, Copy, Debug)]
pub enum Sense {
    /// Rates and accelerations.
    Inertia,
    /// Speed over ground and sideslip.
    Velocity,
    /// The steering wheel.
    Steer,
    /// Tyre forces.
    Strain,
}

impl Sense {
    /// Schema of the channels, and their name in messages.
    fn channel(self) -> (&'static str, &'static str) {
        match self {
            Self::Inertia => ("atvrec.Imu", "inertial unit"),
            Self::Velocity => ("atvrec.GnssVelocity", "GNSS velocity"),
            Self::Steer => ("atvrec.Steer", "steer angle"),
            Self::Strain => ("atvrec.Strain", "strain"),
        }
    }
}

/// Returns an error if the estimates of motion or forces depend on the model alone.
fn require(reader: &Reader, what: &str, senses: &[Sense]) -> Result<(), Refusal> {
    let channels = reader.info().channels;
    for sense in senses {
        let (schema, channel) = sense.channel();
        if !channels
            .values()
            .any(|(own, count)| own == schema && *count > 0)
        {
            return Err(Refusal::Missing {
                what: what.to_owned(),
                channel: channel.to_owned(),
                help: "record it: without it, the estimates only repeat the vehicle file"
                    .to_owned(),
            });
        }
    }
    Ok(())
}

/// Drive of a log.
pub struct Ride {
    /// Vehicle of the log, or of the argument `--vehicle`.
    pub vehicle: Vehicle,
    /// Paths of the logs.
    pub logs: Vec<String>,
    /// Motion.
    pub drive: Drive,
    /// Whether the forces are from the fusion filter.
    pub fused: bool,
    forces_n: PerWheel<[Vec<f64>; 2]>,
    slip_angles_rad: PerWheel<Vec<f64>>,
    steer_rad: PerWheel<Vec<f64>>,
}

impl Ride {
    /// Reads the logs of a run. Logs without the data for `what` are an error.
    pub fn read(args: &IdentifyArgs, what: &str, senses: &[Sense]) -> anyhow::Result<Self> {
        let reader = Reader::open(&args.logs)?;
        require(&reader, what, senses)?;
        let vehicle = vehicle(&reader, args)?;
        let motion = Grid::read(&reader, "/estimate/motion", args)?;
        let each = |name: &str| motion.column(name);
        let wheels = |name: &str| {
            PerWheel(
                ["fl", "fr", "rl", "rr"].map(|wheel| motion.column(&format!("{wheel}.{name}"))),
            )
        };
        let (vx, vy) = (each("velocity_x_m_s"), each("velocity_y_m_s"));
        let [ax, ay, az] = ["x", "y", "z"].map(|axis| each(&format!("acceleration_m_s2.{axis}")));
        let (roll_rad, pitch_rad) = (each("roll_rad"), each("pitch_rad"));
        let steer_rad = wheels("steer_rad");
        // The axes lean with the body, but the accelerations of interest are horizontal.
        let horizontal = |along: &[f64], up: &[f64], lean: &[f64], sign: f64| -> Vec<f64> {
            let rows = along.iter().zip(up).zip(lean);
            rows.map(|((a, z), angle)| a * math::cos(*angle) + sign * z * math::sin(*angle))
                .collect()
        };
        let drive = Drive {
            dt_s: DT_S,
            speed_m_s: vx
                .iter()
                .zip(&vy)
                .map(|(x, y)| math::hypot(*x, *y))
                .collect(),
            sideslip_rad: each("sideslip_rad"),
            yaw_rate_rad_s: each("yaw_rate_rad_s"),
            lateral_m_s2: horizontal(&ay, &az, &roll_rad, -1.0),
            longitudinal_m_s2: horizontal(&ax, &az, &pitch_rad, 1.0),
            steer_rad: as_read(&vehicle, &steer_rad, &learnt_offset(&reader, &motion)?),
            roll_rad,
            pitch_rad,
            loads_n: PerWheel::default(),
        };
        let mut ride = Self {
            vehicle,
            logs: args
                .logs
                .iter()
                .map(|path| path.display().to_string())
                .collect(),
            slip_angles_rad: wheels("slip_angle_rad"),
            steer_rad,
            drive,
            forces_n: PerWheel::default(),
            fused: false,
        };
        ride.read_forces(&reader, args, &motion)?;
        Ok(ride)
    }

    fn read_forces(
        &mut self,
        reader: &Reader,
        args: &IdentifyArgs,
        motion: &Grid,
    ) -> anyhow::Result<()> {
        const TOPIC: &str = "/estimate/tyre_forces";
        if !reader.info().channels.contains_key(TOPIC) {
            return Ok(());
        }
        let forces = Grid {
            first_ns: motion.first_ns,
            rows: motion.rows,
            ..Grid::read(reader, TOPIC, args)?
        };
        for wheel in Wheel::ALL {
            let name = wheel.abbreviation().to_lowercase();
            let each = |axis: &str| forces.column(&format!("{name}.{axis}_n"));
            self.drive.loads_n[wheel] = each("z");
            self.forces_n[wheel] = [each("x"), each("y")];
        }
        let source = forces.table.columns.iter().find(|c| c.name == "fl.source");
        self.fused = matches!(
            source.map(|column| &column.values),
            Some(Values::I32(values)) if values.contains(&FUSION)
        );
        Ok(())
    }

    /// Force and slip of the two tyres of an axle, one after the other.
    pub fn tyre(&self, axle: usize) -> tyre::Data {
        let mut data = tyre::Data {
            dt_s: DT_S * TYRE_STRIDE as f64,
            ..tyre::Data::default()
        };
        for wheel in [2 * axle, 2 * axle + 1] {
            let [_, lateral] = &self.forces_n.0[wheel];
            for row in (0..lateral.len()).step_by(TYRE_STRIDE) {
                if self.drive.speed_m_s[row] > SLIP_SPEED_MIN_M_S {
                    data.load_n.push(self.drive.loads_n.0[wheel][row]);
                    data.slip_angle_rad.push(self.slip_angles_rad.0[wheel][row]);
                    data.lateral_n.push(lateral[row]);
                }
            }
        }
        data
    }

    /// Moment of the tyre forces about the centre of gravity, sum of x F_y - y F_x, N m; NaN without
    /// forces.
    pub fn yaw_moment_n_m(&self) -> Vec<f64> {
        let body = &self.vehicle.body;
        (0..self.drive.rows())
            .map(|row| {
                let moment = |wheel: Wheel| {
                    let [along, across] = &self.forces_n[wheel];
                    let (Some(along), Some(across)) = (along.get(row), across.get(row)) else {
                        return f64::NAN;
                    };
                    let (sin, cos) = math::sin_cos(self.steer_rad[wheel][row]);
                    let force = [along * cos - across * sin, along * sin + across * cos];
                    let (ahead_m, track_m) = if wheel.is_front() {
                        (body.front_axle_to_cg_m, self.vehicle.front.track_m)
                    } else {
                        (-body.cg_to_rear_axle_m, self.vehicle.rear.track_m)
                    };
                    ahead_m * force[1] - 0.5 * wheel.side() * track_m * force[0]
                };
                Wheel::ALL.into_iter().map(moment).sum()
            })
            .collect()
    }
}

/// What the estimator has learnt of the steering wheel's zero, on the grid of the motion: how much
/// further left the front wheels stand than the encoder says, rad.
fn learnt_offset(reader: &Reader, motion: &Grid) -> anyhow::Result<Vec<f64>> {
    const TOPIC: &str = "/estimate/parameters";
    if !reader.info().channels.contains_key(TOPIC) {
        return Ok(vec![0.0; motion.rows]);
    }
    let told = Grid {
        table: reader.table(TOPIC, LogTime(0), LogTime(u64::MAX))?,
        first_ns: motion.first_ns,
        rows: motion.rows,
    };
    Ok(told.line("steer_offset_rad"))
}

/// Mean steer angle of the front wheels by the encoder alone. The estimator's zero of it wanders
/// while it is learnt, and what tyres differ from the vehicle file's in a bend goes into it too.
fn as_read(vehicle: &Vehicle, steer_rad: &PerWheel<Vec<f64>>, learnt_rad: &[f64]) -> Vec<f64> {
    let gear = SteeringGear::from_vehicle(vehicle).ok();
    let ratio = vehicle.steering.ratio;
    let rows = steer_rad.0[0].iter().zip(&steer_rad.0[1]).zip(learnt_rad);
    rows.map(|((left, right), learnt)| {
        let mean = 0.5 * (left + right);
        let Some(gear) = gear.as_ref().filter(|_| mean.is_finite()) else {
            return mean - learnt;
        };
        let hand = gear.hand_wheel_rad(mean);
        let front = |hand: f64| {
            let [left, right, ..] = gear.road_wheels(hand, 0.0);
            0.5 * (left + right)
        };
        mean + front(hand - learnt * ratio) - front(hand)
    })
    .collect()
}

/// Log of a pendulum test.
pub struct Swing {
    /// Vehicle of the log.
    pub vehicle: Vehicle,
    /// Paths of the logs.
    pub logs: Vec<String>,
    /// Rate about the axis on a grid, rad/s.
    pub rate_rad_s: Vec<f64>,
    /// Interval of the grid, s.
    pub dt_s: f64,
}

impl Swing {
    /// Reads the rate about `axis` of the first inertial unit in the log.
    pub fn read(args: &IdentifyArgs, axis: &str) -> anyhow::Result<Self> {
        let reader = Reader::open(&args.logs)?;
        let vehicle = vehicle(&reader, args)?;
        let channels = reader.info().channels;
        let topic = channels
            .iter()
            .find(|(_, (schema, _))| schema == "atvrec.Imu")
            .map(|(topic, _)| topic.clone())
            .ok_or_else(|| Refusal::Missing {
                what: "moment of inertia".to_owned(),
                channel: "inertial unit".to_owned(),
                help: "attach an inertial unit to the pendulum and record it".to_owned(),
            })?;
        let grid = Grid::read(&reader, &topic, args)?;
        Ok(Self {
            vehicle,
            logs: args
                .logs
                .iter()
                .map(|path| path.display().to_string())
                .collect(),
            rate_rad_s: grid.column(&format!("angular_rate_rad_s.{axis}")),
            dt_s: DT_S,
        })
    }
}

/// Rows of a topic on the grid of the estimates.
struct Grid {
    table: Table,
    first_ns: i64,
    rows: usize,
}

impl Grid {
    fn read(reader: &Reader, topic: &str, args: &IdentifyArgs) -> anyhow::Result<Self> {
        let table = reader
            .table(topic, LogTime(0), LogTime(u64::MAX))
            .with_context(|| {
                format!(
                    "the log has no {topic}, which is needed; replay the log with an estimator \
                     (--vehicle)"
                )
            })?;
        let times = &table.publish_time_ns;
        let (Some(first), Some(last)) = (times.iter().min(), times.iter().max()) else {
            anyhow::bail!("{topic} has no message; replay the log with an estimator");
        };
        let nanos = |seconds: f64| (seconds * 1e9).round() as i64;
        let from = first + nanos(args.from_s.max(0.0));
        let to = args
            .to_s
            .map_or(*last, |to_s| (first + nanos(to_s)).min(*last));
        anyhow::ensure!(
            to > from,
            "there is no data between --from and --to: {topic} has {:.1} s; choose times in it",
            (last - first) as f64 * 1e-9
        );
        let rows = ((to - from) as f64 * 1e-9 / DT_S).round() as usize + 1;
        Ok(Self {
            table,
            first_ns: from,
            rows,
        })
    }

    /// A column on straight lines between its rows, at either end as it was last; 0 without rows.
    fn line(&self, name: &str) -> Vec<f64> {
        let column = self.table.columns.iter().find(|column| column.name == name);
        let Some(Values::F64(values)) = column.map(|column| &column.values) else {
            return vec![0.0; self.rows];
        };
        let at = |time: &i64| (time - self.first_ns) as f64 * 1e-9 / DT_S;
        let mut known = self.table.publish_time_ns.iter().map(at).zip(values);
        let Some(mut before) = known.next() else {
            return vec![0.0; self.rows];
        };
        let mut after = known.next();
        let mut line = Vec::with_capacity(self.rows);
        for row in 0..self.rows {
            let row = row as f64;
            while let Some(next) = after.filter(|next| next.0 <= row) {
                before = next;
                after = known.next();
            }
            let slope = after.map_or(0.0, |next| (next.1 - before.1) / (next.0 - before.0));
            line.push(before.1 + slope * (row - before.0).max(0.0));
        }
        line
    }

    /// Column with this name; NaN without a row or a column.
    fn column(&self, name: &str) -> Vec<f64> {
        let mut grid = vec![f64::NAN; self.rows];
        let column = self.table.columns.iter().find(|column| column.name == name);
        if let Some(Values::F64(values)) = column.map(|column| &column.values) {
            for (time, value) in self.table.publish_time_ns.iter().zip(values) {
                let row = ((time - self.first_ns) as f64 * 1e-9 / DT_S).round();
                if row >= 0.0 && (row as usize) < self.rows {
                    grid[row as usize] = *value;
                }
            }
        }
        grid
    }
}

/// Vehicle of the log, or of the argument `--vehicle`.
fn vehicle(reader: &Reader, args: &IdentifyArgs) -> anyhow::Result<Vehicle> {
    let config = Config::from_attachments(&reader.attachments()?)?;
    let own = config
        .estimator
        .context(
            "the configuration in the log has no vehicle, so that nothing was estimated; replay it \
             with --config",
        )?
        .vehicle;
    let Some(name) = &args.vehicle else {
        return Ok(own);
    };
    let given = vehicle_file(name)?;
    if given.name != own.name {
        return Err(Refusal::OtherVehicle {
            what: "identification".to_owned(),
            expected: given.name,
            found: own.name,
        }
        .into());
    }
    Ok(given)
}

/// Reads a vehicle file or a built-in vehicle.
pub fn vehicle_file(name: &str) -> anyhow::Result<Vehicle> {
    let text = Files::on_disk(std::path::PathBuf::new())
        .read_text(name, FileKind::Vehicle)
        .map_err(|problem| anyhow::anyhow!("{}; {}", problem.message, problem.help))?;
    Ok(Vehicle::from_toml(&text, name)?)
}

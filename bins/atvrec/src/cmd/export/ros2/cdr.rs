//! ROS 2 messages in CDR, little endian, and their definitions.

use super::super::cells::seconds;

/// Definitions, with those of the messages inside of them.
pub const IMU: (&str, &[&str]) = (
    "sensor_msgs/msg/Imu",
    &[
        "std_msgs/Header header\n\
         geometry_msgs/Quaternion orientation\n\
         float64[9] orientation_covariance\n\
         geometry_msgs/Vector3 angular_velocity\n\
         float64[9] angular_velocity_covariance\n\
         geometry_msgs/Vector3 linear_acceleration\n\
         float64[9] linear_acceleration_covariance\n",
        HEADER,
        TIME,
        "MSG: geometry_msgs/Quaternion\nfloat64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n",
        VECTOR3,
    ],
);
pub const NAV_SAT_FIX: (&str, &[&str]) = (
    "sensor_msgs/msg/NavSatFix",
    &[
        "std_msgs/Header header\n\
         sensor_msgs/NavSatStatus status\n\
         float64 latitude\n\
         float64 longitude\n\
         float64 altitude\n\
         float64[9] position_covariance\n\
         uint8 COVARIANCE_TYPE_UNKNOWN=0\n\
         uint8 COVARIANCE_TYPE_APPROXIMATED=1\n\
         uint8 COVARIANCE_TYPE_DIAGONAL_KNOWN=2\n\
         uint8 COVARIANCE_TYPE_KNOWN=3\n\
         uint8 position_covariance_type\n",
        HEADER,
        TIME,
        "MSG: sensor_msgs/NavSatStatus\n\
         int8 STATUS_NO_FIX=-1\n\
         int8 STATUS_FIX=0\n\
         int8 STATUS_SBAS_FIX=1\n\
         int8 STATUS_GBAS_FIX=2\n\
         int8 status\n\
         uint16 SERVICE_GPS=1\n\
         uint16 SERVICE_GLONASS=2\n\
         uint16 SERVICE_COMPASS=4\n\
         uint16 SERVICE_GALILEO=8\n\
         uint16 service\n",
    ],
);
pub const TWIST_STAMPED: (&str, &[&str]) = (
    "geometry_msgs/msg/TwistStamped",
    &[
        "std_msgs/Header header\ngeometry_msgs/Twist twist\n",
        HEADER,
        TIME,
        "MSG: geometry_msgs/Twist\ngeometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n",
        VECTOR3,
    ],
);
pub const WRENCH_STAMPED: (&str, &[&str]) = (
    "geometry_msgs/msg/WrenchStamped",
    &[
        "std_msgs/Header header\ngeometry_msgs/Wrench wrench\n",
        HEADER,
        TIME,
        "MSG: geometry_msgs/Wrench\ngeometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n",
        VECTOR3,
    ],
);
const HEADER: &str = "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n";
const TIME: &str = "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";
const VECTOR3: &str = "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n";

/// The text of a schema with the encoding `ros2msg`.
pub fn schema_text(parts: &[&str]) -> String {
    let line = "=".repeat(80) + "\n";
    parts.join(&line)
}

/// A message that is being encoded.
pub struct Message(Vec<u8>);

impl Message {
    /// A message that begins with a `std_msgs/Header`.
    pub fn new(stamp_ns: i64, frame_id: &str) -> Self {
        // Encapsulation: plain CDR, little endian.
        let mut message = Self(vec![0, 1, 0, 0]);
        let (second, ns) = seconds(stamp_ns);
        // The format ends in 2038.
        let second = i32::try_from(second).unwrap_or(i32::MAX);
        message.0.extend(second.to_le_bytes());
        message.0.extend(ns.to_le_bytes());
        let length = u32::try_from(frame_id.len() + 1).unwrap_or_default();
        message.0.extend(length.to_le_bytes());
        message.0.extend(frame_id.as_bytes());
        message.0.push(0);
        message
    }

    /// Appends floating-point numbers.
    pub fn f64s(mut self, values: &[f64]) -> Self {
        self.align(8);
        self.0
            .extend(values.iter().flat_map(|value| value.to_le_bytes()));
        self
    }

    /// Appends an 8-bit integer.
    pub fn i8(mut self, value: i8) -> Self {
        self.0.extend(value.to_le_bytes());
        self
    }

    /// Appends a 16-bit integer.
    pub fn u16(mut self, value: u16) -> Self {
        self.align(2);
        self.0.extend(value.to_le_bytes());
        self
    }

    /// The bytes.
    pub fn bytes(self) -> Vec<u8> {
        self.0
    }

    /// Fills up to a multiple of `size` bytes behind the encapsulation.
    fn align(&mut self, size: usize) {
        let length = (self.0.len() - 4).next_multiple_of(size) + 4;
        self.0.resize(length, 0);
    }
}

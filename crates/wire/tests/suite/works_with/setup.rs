//! Set-up commands of the devices, for `docs/works-with.md`: from the makers' manuals.

use std::fmt::Write as _;

use atvrec_wire::recognise::Format;

/// Set-up of the devices of a protocol: the messages that the estimator needs, and the commands.
const SETUP: [(Format, &str); 6] = [
    (
        Format::Ubx,
        "The estimator needs NAV-PVT (position and velocity), and NAV-RELPOSNED for the heading of two \
         antennas. With u-blox generation 9 and later, and `ubxtool` of gpsd (UART1; the port USB has the \
         ending `_USB`):\n\n\
         ```\n\
         ubxtool -f /dev/ttyACM0 -P 27.11 -z CFG-MSGOUT-UBX_NAV_PVT_UART1,1\n\
         ubxtool -f /dev/ttyACM0 -P 27.11 -z CFG-MSGOUT-UBX_NAV_RELPOSNED_UART1,1\n\
         ubxtool -f /dev/ttyACM0 -P 27.11 -z CFG-RATE-MEAS,100\n\
         ubxtool -f /dev/ttyACM0 -P 27.11 -z CFG-UART1-BAUDRATE,115200\n\
         ```\n\n\
         In u-center: UBX-CFG-MSG, 01-07 NAV-PVT, on the port of the cable; UBX-CFG-RATE, 100 ms; UBX-CFG-CFG \
         saves the settings. NAV-PVT at 10 Hz needs 10 kbit/s.\n",
    ),
    (
        Format::Novatel,
        "The estimator needs BESTPOS and BESTVEL, and HEADING2 or DUALANTENNAHEADING for the heading of two \
         antennas. A SPAN receiver also sends INSPVAX and CORRIMUDATA. The recorder can send the commands \
         each time it opens the port:\n\n\
         ```toml\n\
         [source.gnss]\n\
         kind = \"gnss\"\n\
         device = \"/dev/ttyUSB0\"\n\
         commands = [\n  \
         \"log bestposb ontime 0.05\",\n  \
         \"log bestvelb ontime 0.05\",\n  \
         \"log timeb ontime 1\",\n  \
         \"log heading2b onnew\",\n\
         ]\n\
         ```\n\n\
         For SPAN: `log inspvaxb ontime 0.1` and `log corrimudatab ontime 0.01`. `saveconfig` stores the logs \
         in the receiver; the commands are then not needed.\n",
    ),
    (
        Format::Sbf,
        "The estimator needs PVTGeodetic with VelCovGeodetic, and AttEuler with AttCovEuler for the attitude \
         of several antennas. A receiver with an inertial unit also sends INSNavGeod and ExtSensorMeas:\n\n\
         ```toml\n\
         [source.gnss]\n\
         kind = \"gnss\"\n\
         device = \"/dev/ttyUSB0\"\n\
         commands = [\n  \
         \"setSBFOutput, Stream1, COM1, PVTGeodetic+VelCovGeodetic+AttEuler+AttCovEuler, msec100\",\n\
         ]\n\
         ```\n\n\
         `COM1` is the port of the receiver; a USB cable is `USB1`. `setCOMSettings, COM1, baud115200` sets \
         the baud rate, and `exeCopyConfigFile, Current, Boot` stores the settings.\n",
    ),
    (
        Format::Nmea,
        "The estimator needs RMC or VTG for the velocity and GGA for the position; HDT or THS is the heading \
         of two antennas. Other sentences cost bandwidth: at 9600 baud, GGA and RMC fit five times a second.\n\n\
         | receiver | commands for `commands = [...]` |\n|---|---|\n\
         | u-blox | `\"$PUBX,40,GGA,0,1,0,0,0,0*5B\"`, `\"$PUBX,40,RMC,0,1,0,0,0,0*46\"` |\n\
         | Garmin | `\"$PGRMO,GPGGA,1\"`, `\"$PGRMO,GPRMC,1\"` |\n\
         | Hemisphere | `\"$JASC,GPGGA,10\"`, `\"$JASC,GPVTG,10\"`, `\"$JASC,GPHDT,10\"` |\n\
         | Septentrio | `\"setNMEAOutput, Stream1, COM1, GGA+RMC+HDT, msec100\"` |\n\
         | NovAtel | `\"log gpgga ontime 0.1\"`, `\"log gprmc ontime 0.1\"`, `\"log gphdt ontime 0.1\"` |\n",
    ),
    (
        Format::Vectornav,
        "The estimator needs specific force and angular rate: VNYMR or VNIMU as text, or a binary output. \
         Without VectorNav's program, the recorder can send the commands. The first line asks for binary \
         output 1 on serial port 1 with the time since the start, attitude, angular rate and acceleration, at \
         an eighth of the rate of the unit (800 Hz: 100 Hz). The second line switches the text off:\n\n\
         ```toml\n\
         [source.imu]\n\
         kind = \"vectornav\"\n\
         device = \"/dev/ttyUSB0\"\n\
         commands = [\"$VNWRG,75,1,8,01,0129*XX\", \"$VNWRG,06,0*XX\"]\n\
         ```\n\n\
         `$VNWNV*XX` stores the settings in the unit. For text instead: `$VNWRG,06,14*XX` (VNYMR) and \
         `$VNWRG,07,100*XX` (100 Hz), which needs 230400 baud.\n",
    ),
    (
        Format::Crossbow440,
        "Nothing is to be set: the recorder finds the baud rate and asks for S1 packets 100 times a second \
         each time it opens the port.\n",
    ),
];

/// Set-up of CAN buses, whose devices have DBC files.
const CAN: &str = "\
An interface needs its bit rate, from the system or from the recorder:

```
sudo ip link set can0 up type can bitrate 500000 restart-ms 100
candump can0
```

```toml
[source.can0]
kind = \"can\"
interface = \"can0\"
dbc = [\"my-vehicle.dbc\"]
link.bitrate = 500000
```

With `link.bitrate`, `sudo atvrec link` or the unit `atvrec-can@can0` brings the interface up. `atvrec init \
--dbc my-vehicle.dbc` proposes the roles of the signals. An SLCAN adapter needs no driver: `kind = \"slcan\"` \
with `bitrate`.
";

/// The section of the page.
pub fn section(used: &[Format]) -> String {
    let mut text = String::from(
        "\n## Set-up commands\n\n`atvrec init` finds out what a device sends, and `atvrec check` shows the \
         messages that it decodes. The commands are those of the makers' manuals.\n",
    );
    for (format, setup) in SETUP {
        let _ = write!(text, "\n### {format}\n\n{setup}");
    }
    let _ = write!(text, "\n### CAN\n\n{CAN}");
    text.push_str("\n### Recognised, not decoded\n\n| protocol | what to do |\n|---|---|\n");
    for format in Format::all().filter(|format| format.kind().is_none()) {
        let _ = writeln!(text, "| {format} | {} |", format.advice());
    }
    for format in used {
        let has = SETUP.iter().any(|(of, _)| of == format) || format.kind().is_none();
        assert!(has, "{format} has no set-up");
    }
    text
}

/// Names of messages in the commands are names of the list of decoded messages.
#[test]
fn commands_ask_for_messages_that_are_decoded() {
    let list = std::fs::read_to_string(testkit::project().join("docs/configuration.md"));
    let list = list.expect("the list of messages");
    let mut count = 0;
    for (format, setup) in SETUP {
        let names: Vec<String> = match format {
            Format::Novatel => setup
                .split("log ")
                .skip(1)
                .filter_map(|rest| Some(rest.split(' ').next()?.strip_suffix('b')?.to_uppercase()))
                .collect(),
            Format::Sbf => setup
                .split("COM1, ")
                .filter_map(|rest| rest.split(',').next())
                .filter(|names| names.contains('+'))
                .flat_map(|names| names.split('+'))
                .map(|name| {
                    name.replace("VelCovGeodetic", "covariances")
                        .replace("AttCovEuler", "covariances")
                })
                .collect(),
            Format::Ubx => vec!["NAV-PVT".to_owned(), "NAV-RELPOSNED".to_owned()],
            _ => Vec::new(),
        };
        for name in names {
            assert!(list.contains(&name), "{name}");
            count += 1;
        }
    }
    assert!(count > 10, "{count}");
}

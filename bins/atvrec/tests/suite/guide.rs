//! The commands of `docs/guide` run as they are written, and print what the pages show.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

/// Pages with commands, in the order in which a reader runs them.
const PAGES: [&str; 5] = ["index", "setup", "workshop", "first-drive", "mistakes"];
/// Directory of the pages' reader.
const HOME: &str = "/home/me/buggy";
/// How long a background command may take until it prints what the page shows.
const PATIENCE: Duration = Duration::from_secs(60);

fn page(name: &str) -> String {
    let path = testkit::project().join(format!("docs/guide/{name}.md"));
    fs::read_to_string(path).expect("a page")
}

/// Fenced blocks of a page: the words behind the fence, and the text.
fn blocks(page: &str) -> Vec<(&str, &str)> {
    let mut blocks = Vec::new();
    let mut parts = page.split("\n```");
    parts.next();
    while let (Some(block), rest) = (parts.next(), parts.next()) {
        assert!(rest.is_some(), "a block without an end: {block}");
        blocks.push(block.split_once('\n').unwrap_or((block, "")));
    }
    blocks
}

/// A line whose numbers, which differ from run to run, are 0.
fn without_numbers(line: &str) -> String {
    let mut text = String::new();
    for word in line.split_whitespace() {
        for c in word.trim_start_matches(['-', '+']).chars() {
            match c {
                '0'..='9' if !text.ends_with('0') => text.push('0'),
                '0'..='9' => {}
                '.' if text.ends_with('0') => {}
                c => text.push(c),
            }
        }
        text.push(' ');
    }
    text.replace("0e-0", "0").trim_end().to_owned()
}

/// A directory with the program on the path.
struct Shell {
    here: TempDir,
    background: Vec<Child>,
}

impl Shell {
    fn new() -> Self {
        let here = tempfile::tempdir().expect("a directory");
        Self {
            here,
            background: Vec::new(),
        }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.here.path().join(name)
    }

    fn command(&self, line: &str) -> Command {
        let program = Path::new(env!("CARGO_BIN_EXE_atvrec"));
        let folder = program.parent().expect("a folder").display().to_string();
        let mut command = Command::new("bash");
        command
            .args(["-c", line])
            .current_dir(self.here.path())
            .env("PATH", format!("{folder}:/usr/bin:/bin"))
            .env_remove("ATVREC_LOG");
        command
    }

    fn output(&self, line: &str) -> Output {
        self.command(line).output().expect("bash starts")
    }

    /// What a command prints on both outputs, with the directory of the pages.
    fn told(&self, line: &str) -> (bool, String) {
        let output = self.output(line);
        let text = [output.stdout, output.stderr].concat();
        let text = String::from_utf8_lossy(&text).into_owned();
        let here = self.here.path().display().to_string();
        (output.status.success(), text.replace(&here, HOME))
    }

    /// Starts a command that goes on, and waits for what it prints first.
    fn start(&mut self, line: &str) {
        let output = fs::File::create(self.path("background.txt")).expect("a file");
        let line = line.trim_end_matches('&');
        // Without exec, the end of the shell would leave the program.
        let mut command = self.command(&format!("exec {line}"));
        let child = command
            .stdout(output)
            .stderr(Stdio::null())
            .spawn()
            .expect("bash starts");
        self.background.push(child);
        let begin = Instant::now();
        while !self.path("ports/atvrec.toml").exists() {
            assert!(begin.elapsed() < PATIENCE, "{line} made no ports");
            std::thread::sleep(Duration::from_millis(50));
        }
    }
}

impl Drop for Shell {
    fn drop(&mut self) {
        for child in &mut self.background {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// Each line of a block, except `...`, is a line that the command prints: a whole one, or the beginning of
/// one if it ends with `...`.
fn compare(command: &str, shown: &[&str], told: &str) {
    let lines: Vec<String> = told.lines().map(without_numbers).collect();
    for line in shown.iter().filter(|line| **line != "...") {
        let found = match line.strip_suffix("...") {
            Some(begin) => {
                let begin = without_numbers(begin);
                lines.iter().any(|line| line.starts_with(&begin))
            }
            None => lines.contains(&without_numbers(line)),
        };
        assert!(found, "`{command}` does not print\n{line}\nbut\n{told}");
    }
}

fn run(shell: &mut Shell, text: &str) {
    let mut lines = text.lines().peekable();
    while let Some(line) = lines.next() {
        let command = line.strip_prefix("$ ").expect("a command");
        let mut shown = Vec::new();
        while let Some(line) = lines.next_if(|line| !line.starts_with("$ ")) {
            shown.push(line);
        }
        if command.ends_with('&') {
            shell.background.iter_mut().for_each(|child| {
                let _ = child.kill();
            });
            let _ = fs::remove_file(shell.path("ports/atvrec.toml"));
            shell.start(command);
            let told = fs::read_to_string(shell.path("background.txt")).expect("a file");
            compare(command, &shown, &told);
            continue;
        }
        let (succeeded, told) = shell.told(command);
        assert!(succeeded, "`{command}` fails: {told}");
        compare(command, &shown, &told);
    }
}

#[test]
fn the_commands_of_the_guide_print_what_it_shows() {
    let mut shell = Shell::new();
    for name in PAGES {
        for (words, text) in blocks(&page(name)) {
            match words.split_once(' ') {
                Some(("toml", file)) => fs::write(shell.path(file), text).expect("written"),
                _ if words == "console" => run(&mut shell, text),
                _ => {}
            }
        }
    }
}

/// Preparation, command, and what the command prints. `{DRIVE}` drives the virtual vehicle.
const MISTAKES: &[(&str, &str, &str)] = &[
    (
        "sed -i 's/^stiffness_n_m = 65000.0/stiffness_n_m = 65.0/' v.toml",
        "atvrec vehicle check v.toml",
        "the value is probably in N/mm; write 65000 N/m",
    ),
    (
        "sed -i 's/^mass_kg = 644.0/mass_kg = 6317.0/' v.toml",
        "atvrec vehicle check v.toml",
        "do not carry the sprung mass",
    ),
    (
        "sed -i 's/^ratio = 9.16/ratio = 0.109/' v.toml",
        "atvrec vehicle check v.toml",
        "1 to 40 is usual; check the value and its unit",
    ),
    (
        "sed -i 's/^upper_ball_m = .-0.012, 0.447/upper_ball_m = [-0.012, -0.447/' v.toml",
        "atvrec vehicle check v.toml",
        "lies on the right-hand side; give the left corner's points",
    ),
    (
        "sed -i 's/^upper_ball_m = .-0.012, 0.447, 0.395/upper_ball_m = [-12, 447, 395/' v.toml",
        "atvrec vehicle check v.toml",
        "give 3 numbers in the unit that the field's name ends with",
    ),
    (
        "sed -i 's/^cg_height_m/cg_heigth_m/' v.toml",
        "atvrec vehicle check v.toml",
        "no such field; did you mean cg_height_m?",
    ),
    (
        "sed -i 's/^tube_wall_m = 0.00165/tube_wall_m = 1.65/' s.toml",
        "atvrec sensors check s.toml",
        "give a number in the unit that the field's name ends with",
    ),
    (
        "printf 'vehicle = \"Another\"\\n' >c.toml; sed -i 's/^sensors = .*/&\\ncalibration = \"c.toml\"/' atvrec.toml",
        "atvrec check --no-devices",
        "use the calibration of this vehicle, or calibrate it",
    ),
    (
        "role 'wheel_speed.FL = \"Steering.hand_wheel_angle\"'",
        "atvrec check --no-devices",
        "name another signal, or correct the unit of the signal in the DBC file",
    ),
    (
        "sed -i '/^.strain/,/^.deflection/{/^.deflection/!d}' s.toml",
        "atvrec check --with m.mcap",
        "readings of strain arrive, but the sensors file has no table [strain]",
    ),
    (
        "sed -i 's/^adc_bits = 16/adc_bits = 12/' s.toml",
        "atvrec check --with m.mcap",
        "arrive, but strain.adc_bits = 12 of the sensors file allows 0 to 4095",
    ),
    (
        "sed -i 's/^adc_bits = 16/adc_bits = 12/' s.toml; atvrec -q replay m.mcap --sensors s.toml -o y.mcap",
        "atvrec events y.mcap",
        "channel FL lower_front has counts beyond its range",
    ),
    (
        "role 'steer = \"-Steering.hand_wheel_angle\"'",
        "atvrec check --with m.mcap",
        "likely cause: the sign is reversed; left turns are positive",
    ),
    (
        "role 'wheel_speed.FL = \"WheelSpeed.FR\"\\nwheel_speed.FR = \"WheelSpeed.FL\"'",
        "atvrec check --with m.mcap",
        "likely cause: the channels of FL and FR are exchanged",
    ),
    (
        "role 'deflection.FL = \"Corner_FR.deflection\"\\ndeflection.FR = \"Corner_FL.deflection\"'",
        "atvrec check --with m.mcap",
        "found: FL reacts as FR; FR reacts as FL",
    ),
    (
        "role 'strain.FL.upper_front = \"Strain_FR.upper_front\"\\nstrain.FR.upper_front = \"Strain_FL.upper_front\"'",
        "atvrec check --with m.mcap",
        "the bridge is wired with the opposite sign, or the channel is that of another member",
    ),
    (
        "role 'hitch_force.x = \"Hitch.force_x\"'",
        "atvrec check --with m.mcap",
        "it does not arrive, but its signals",
    ),
    (
        "true",
        "atvrec check --listen-s 0.2",
        "the device does not exist; connect it or correct the path",
    ),
    (
        "channel rear_left '\"dead\"' channel=upper_front; drive jackstand",
        "atvrec calibrate zero x.mcap",
        "RL upper_front is dead: the converter stands at 0, look for a torn wire",
    ),
    (
        "channel front_left '\"inverted\"' channel=lower_front; drive jackstand",
        "atvrec calibrate zero x.mcap",
        "FL lower_front is wired the other way round; its gain is written negative",
    ),
    (
        "channel front_right '\"inverted\"'; drive jackstand",
        "atvrec calibrate zero x.mcap",
        "FR deflection is wired the other way round; its gain is written negative",
    ),
    (
        "channel rear_right '\"bending_wired\"' channel=lower_front; drive jackstand",
        "atvrec calibrate zero x.mcap",
        "its gauges stand in adjacent arms of the bridge; it is called dead",
    ),
    (
        "channel front_right '{ swapped_with = { channel = \"lower_rear\" } }' channel=lower_front; drive load-rig",
        "atvrec calibrate load-rig x.mcap",
        "FR lower_front reads lower_rear: its plug is in the wrong place",
    ),
    (
        "imu 2 '\"inverted\"'; drive mixed-driving",
        "atvrec check --with x.mcap",
        "likely cause: the unit is mounted turned, or its roles are those of other axes",
    ),
    (
        "imu 0 '\"inverted\"'; drive mixed-driving",
        "atvrec check --with x.mcap",
        "the sign of x is reversed, or the unit is mounted turned by half a turn",
    ),
    (
        "sed 's/^misalignment_rad = .*/misalignment_rad = [0.0, 0.0, 0.5]/' s.toml >t.toml; drive mixed-driving t.toml",
        "atvrec check --with x.mcap",
        "the horizontal axes fit the motion if the unit is turned by",
    ),
    (
        "sed 's/^misalignment_rad = .*/misalignment_rad = [0.0, 0.0, 0.1]/' s.toml >t.toml; drive mixed-driving t.toml; atvrec -q replay x.mcap --sensors s.toml -o y.mcap",
        "atvrec events y.mcap",
        "inertial unit: direction: it is turned against the sensors file by",
    ),
    (
        "imu 3 '\"inverted\"'; drive mixed-driving",
        "atvrec check --with x.mcap",
        "the sign is reversed; a roll that lifts the left side is positive",
    ),
    (
        "imu 3 '\"inverted\"'; drive mixed-driving",
        "atvrec events x.mcap",
        "inertial unit roll rate bias has jumped and is learnt anew",
    ),
    (
        "imu 4 '\"inverted\"'; drive launch-brake",
        "atvrec check --with x.mcap",
        "the sign is reversed; a pitch that lowers the front is positive",
    ),
    (
        "printf '[[faults.hub]]\\nwheel = \"rear_right\"\\nturned_rad = [1.57, 0.0, 0.0]\\n' >>o.toml; drive launch-brake full-bridge-16bit-hub",
        "atvrec events x.mcap",
        "channel RR hub acceleration has wrong axes",
    ),
    (
        "printf '[hidden]\\nbridge_offset_counts = 2000.0\\n' >>o.toml; drive slow-sine",
        "atvrec events x.mcap",
        "the force filter diverged and was started anew",
    ),
    (
        "true",
        "atvrec calibrate zero m.mcap",
        "put the vehicle on stands and do not touch it for 10 s",
    ),
    (
        "true",
        "atvrec calibrate load-rig m.mcap",
        "mark each load while it is on",
    ),
    (
        "true",
        "atvrec calibrate steer m.mcap",
        "read the plates at seven or more steering-wheel angles",
    ),
    (
        "true",
        "atvrec calibrate imu m.mcap",
        "turn it by 180 degrees on the spot of floor",
    ),
    (
        "drive slow-sine",
        "atvrec calibrate gnss x.mcap",
        "drive a minute with quick turns to both sides",
    ),
];

/// Functions of the preparations.
const FUNCTIONS: &str = r#"
role() { sed -i "s/^bitrate = 500000/&\n\n[source.can0.roles]\n$1/; /^.source.can0.message_latency_s/,/^$/d" atvrec.toml; }
channel() { printf '[[faults.channel]]\nwheel = "%s"\nkind = %s\n' "$1" "$2" >>o.toml; [ -z "${3:-}" ] || echo "channel = \"${3#channel=}\"" >>o.toml; }
imu() { printf '[[faults.imu]]\naxis = %s\nkind = %s\n' "$1" "$2" >>o.toml; }
drive() { atvrec -q simulate -m "$1" --sensors "${2:-full-bridge-16bit}" --options o.toml -o x.mcap; }
"#;

#[test]
fn each_mistake_of_the_guide_gives_the_words_of_its_table() {
    let shell = Shell::new();
    let (succeeded, told) = shell.told(
        "mkdir base; cd base; touch o.toml; atvrec vehicle show prowler >v.toml
         atvrec sensors show full-bridge-16bit >s.toml
         atvrec -q simulate -m mixed-driving --sensors full-bridge-16bit -o m.mcap",
    );
    assert!(succeeded, "{told}");
    let reader = store::Reader::open([shell.path("base/m.mcap")]).expect("a log");
    let attachments = reader.attachments().expect("attachments");
    let config = attachments.iter().find(|file| file.name == "atvrec.toml");
    let text = String::from_utf8_lossy(&config.expect("a configuration").data).into_owned();
    let lines = text.lines().map(|line| match line.split_once(" = ") {
        Some(("file", _)) => "file = \"v.toml\"",
        Some(("sensors", _)) => "sensors = \"s.toml\"",
        _ => line,
    });
    let lines: Vec<&str> = lines.collect();
    fs::write(shell.path("base/atvrec.toml"), lines.join("\n") + "\n").expect("written");

    let page = page("mistakes");
    for (prepare, command, words) in MISTAKES {
        assert!(page.contains(words), "the page has no\n{words}");
        let line = format!(
            "{FUNCTIONS}\nrm -rf try; cp -r base try; cd try; {prepare} >/dev/null && {command}"
        );
        let (_, told) = shell.told(&line);
        assert!(
            told.contains(words),
            "{prepare}\n{command}\n{words}\n{told}"
        );
    }
}

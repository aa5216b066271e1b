//! Output files of an identification.

use std::path::{Path, PathBuf};

use estimator::identification::Identified;

use super::Found;
use crate::cli::{IdentifyArgs, IdentifyCommand, OutputArgs};
use crate::cmd::findings;
use engine::output::{Kind, Target};

/// Output files of a command.
pub struct Outputs {
    values: Option<Target>,
    page: Option<Target>,
}

impl Outputs {
    /// Checks the files before the computation.
    pub fn check(command: &IdentifyCommand) -> anyhow::Result<Self> {
        let (logs, vehicle, output) = match command {
            IdentifyCommand::Cornering(args)
            | IdentifyCommand::RollPitch(args)
            | IdentifyCommand::Understeer(args)
            | IdentifyCommand::Friction(args)
            | IdentifyCommand::Slip(args)
            | IdentifyCommand::Camber(args)
            | IdentifyCommand::Aligning(args)
            | IdentifyCommand::Toe(args) => inputs(args),
            IdentifyCommand::Tyre(args) => inputs(&args.shared),
            IdentifyCommand::Inertia(args) => inputs(&args.shared),
            IdentifyCommand::Response(args) => inputs(&args.shared),
            IdentifyCommand::RollCentre(args) => (&[][..], Some(&args.vehicle), &args.output),
            IdentifyCommand::Handling(_)
            | IdentifyCommand::Latency(_)
            | IdentifyCommand::Mistakes(_) => {
                return Ok(Self {
                    values: None,
                    page: None,
                });
            }
        };
        let target = |path: &Option<PathBuf>, kind| {
            let logs = logs.iter().map(|log| &**log);
            let inputs = logs.chain(vehicle.map(Path::new));
            let path = path.as_ref();
            path.map(|path| Target::new(path, kind, output.replace.force, inputs))
                .transpose()
        };
        Ok(Self {
            values: target(&output.output, Kind::Toml)?,
            page: target(&output.report, Kind::Page)?,
        })
    }

    /// Writes the results.
    pub fn write(&self, found: &Found) -> anyhow::Result<()> {
        if let Some(target) = &self.values {
            let Identified { results, overrides } = &found.identified;
            let text = overrides.file(found.title, &found.vehicle, &found.logs, results)?;
            target.write(&text)?;
        }
        if let Some(target) = &self.page {
            let facts = vec![
                ("vehicle".to_owned(), found.vehicle.clone()),
                ("logs".to_owned(), found.logs.join(", ")),
            ];
            let title = format!("Identification: {}", found.title);
            target.write(&findings::page(&title, facts, &found.identified.results))?;
        }
        Ok(())
    }
}

type Inputs<'a> = (&'a [PathBuf], Option<&'a String>, &'a OutputArgs);

fn inputs(args: &IdentifyArgs) -> Inputs<'_> {
    (&args.logs, args.vehicle.as_ref(), &args.output)
}

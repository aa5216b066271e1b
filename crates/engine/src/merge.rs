//! Several runs as one.

use std::collections::{BTreeMap, BTreeSet};
use std::iter::Peekable;

use sample::{Arrival, LogTime, Notice, Payload, SourceId};
use store::{ArrivalIter, Attachment, Options, Reader, Session, Source, SourceKind};

use crate::config::ATTACHED_NAME;
use crate::{Config, Engine, Entry, Error, Result, session};

/// Several runs as one: the sources of all of them, their arrivals by log time, and the estimates from all of
/// these data.
pub struct Merge {
    runs: Vec<Run>,
    config: Config,
    session: Session,
    options: Options,
}

/// What was merged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Merged {
    /// Arrivals.
    pub arrivals: u64,
    /// Records that were computed from them.
    pub records: u64,
}

struct Run {
    /// Numbers of its sources among those of all runs.
    sources: BTreeMap<SourceId, SourceId>,
    arrivals: Peekable<ArrivalIter>,
}

/// A run with its configuration.
struct Member<'r> {
    reader: &'r Reader,
    table: toml::Table,
    attachments: Vec<Attachment>,
    span: (LogTime, LogTime),
    /// Names of its sources, and those among all runs.
    names: BTreeMap<String, String>,
}

impl Merge {
    /// Merges runs. Sources of equal names are one source if the runs follow each other and both
    /// configurations describe the source alike. Otherwise, `rename` gives those of later runs a number.
    ///
    /// # Errors
    /// If the sources have equal names and are not to be renamed; if a run has no configuration that this
    /// version reads; if files with equal names or the vehicles differ.
    pub fn new(readers: &[Reader], rename: bool) -> Result<Self> {
        let mut members = Vec::new();
        for reader in readers {
            members.push(Member::of(reader)?);
        }
        name_sources(&mut members, rename)?;
        let config = Config::from_attachments(&attachments(&members)?)?;
        let session = session_of(&members, &config);
        let runs = members.iter().map(|member| member.run(&config)).collect();
        Ok(Self {
            runs,
            session,
            options: config.storage.options.clone(),
            config,
        })
    }

    /// Session of the merged log.
    pub const fn session(&self) -> &Session {
        &self.session
    }

    /// Options of the merged log.
    pub const fn log_options(&self) -> &Options {
        &self.options
    }

    /// Merges to the end, and passes the entries of the merged log to `sink`.
    ///
    /// # Errors
    /// If a log cannot be read, and the errors of `sink`.
    pub fn run<E: From<Error>>(
        mut self,
        mut sink: impl FnMut(Entry) -> std::result::Result<(), E>,
    ) -> std::result::Result<Merged, E> {
        let mut engine = Engine::new(&self.config)?;
        let mut merged = Merged::default();
        let mut records = Vec::new();
        while let Some(mut arrival) = next(&mut self.runs)? {
            // The engine of the merged log has skipped nothing.
            if matches!(
                arrival.payload,
                Payload::Notice(Notice::EstimatorSkipped { .. })
            ) {
                continue;
            }
            arrival.sequence = merged.arrivals;
            merged.arrivals += 1;
            records.clear();
            engine.push(&arrival, &mut records);
            merged.records += records.len() as u64;
            sink(Entry::Arrival(arrival))?;
            let mut computed = records.drain(..);
            computed.try_for_each(|record| sink(Entry::Record(record)))?;
        }
        engine.finish(&mut records);
        let mut computed = records.drain(..);
        computed.try_for_each(|record| sink(Entry::Record(record)))?;
        Ok(merged)
    }
}

/// The earliest arrival of all runs; of equally early ones that of the first run.
fn next(runs: &mut [Run]) -> Result<Option<Arrival>> {
    let mut first: Option<(LogTime, usize)> = None;
    for (number, run) in runs.iter_mut().enumerate() {
        // An error comes at once.
        let time = match run.arrivals.peek() {
            Some(Ok(arrival)) => arrival.log_time,
            Some(Err(_)) => LogTime(0),
            None => continue,
        };
        if first.is_none_or(|(earliest, _)| time < earliest) {
            first = Some((time, number));
        }
    }
    let Some(run) = first.and_then(|(_, number)| runs.get_mut(number)) else {
        return Ok(None);
    };
    let mut arrival = run.arrivals.next().transpose()?;
    if let Some(arrival) = &mut arrival {
        let known = run.sources.get(&arrival.source);
        arrival.source = known.copied().unwrap_or(arrival.source);
    }
    Ok(arrival)
}

impl<'r> Member<'r> {
    fn of(reader: &'r Reader) -> Result<Self> {
        let run = || reader.session().run_id.clone();
        let attachments = reader.attachments()?;
        // Whatever is wrong with it: this version cannot use it.
        Config::from_attachments(&attachments).map_err(|cause| Error::NotMergeable {
            run: run(),
            cause: Box::new(cause),
        })?;
        let attached = attachments.iter().find(|file| file.name == ATTACHED_NAME);
        let text = attached.map(|file| String::from_utf8_lossy(&file.data));
        let table = text.unwrap_or_default().parse::<toml::Table>();
        let info = reader.info();
        Ok(Self {
            reader,
            table: table.map_err(Error::AttachedConfiguration)?,
            attachments,
            span: info.span.unwrap_or_default(),
            names: BTreeMap::new(),
        })
    }

    fn sources(&self) -> impl Iterator<Item = &Source> {
        let sources = self.reader.session().sources.iter();
        sources.filter(|source| source.kind != SourceKind::Recorder)
    }

    fn source_table(&self, name: &str) -> Option<&toml::Value> {
        self.table.get("source")?.get(name)
    }

    fn vehicle(&self) -> Option<&toml::Value> {
        self.table.get("vehicle")?.get("file")
    }

    fn run(&self, config: &Config) -> Run {
        let number = |name: &str| {
            let mut sources = config.sources.iter();
            let found = sources.find(|source| source.spec.name == name)?;
            Some(found.spec.id)
        };
        let sources = self.sources().filter_map(|source| {
            let name = self.names.get(&source.name)?;
            Some((source.id, number(name)?))
        });
        Run {
            sources: sources.collect(),
            arrivals: self.reader.arrivals().peekable(),
        }
    }
}

/// Names the sources of all runs.
fn name_sources(members: &mut [Member], rename: bool) -> Result<()> {
    let mut taken: BTreeSet<String> = BTreeSet::new();
    let mut clashes = BTreeSet::new();
    for number in 0..members.len() {
        let (before, rest) = members.split_at_mut(number);
        let Some(member) = rest.first_mut() else {
            break;
        };
        let names: Vec<String> = member.sources().map(|source| source.name.clone()).collect();
        for name in names {
            let is_same = |earlier: &Member| earlier.has_same(member, &name);
            let same = before.iter().find(|earlier| is_same(earlier));
            let name_of_all = match same.and_then(|earlier| earlier.names.get(&name)) {
                Some(known) => known.clone(),
                None if !taken.contains(&name) => name.clone(),
                None => {
                    clashes.insert(name.clone());
                    free_name(&name, &taken)
                }
            };
            taken.insert(name_of_all.clone());
            member.names.insert(name, name_of_all);
        }
    }
    match clashes.is_empty() || rename {
        true => Ok(()),
        false => Err(Error::EqualSources(clashes.into_iter().collect())),
    }
}

impl Member<'_> {
    /// Whether both runs have this source, described alike, one after the other.
    fn has_same(&self, later: &Self, name: &str) -> bool {
        let follow = self.span.1 < later.span.0 || later.span.1 < self.span.0;
        let tables = [self, later].map(|member| member.source_table(name));
        follow && tables[0].is_some() && tables[0] == tables[1]
    }
}

/// The name with a number that no source has.
fn free_name(name: &str, taken: &BTreeSet<String>) -> String {
    let mut numbered = (2_u32..).map(|number| format!("{name}_{number}"));
    let free = numbered.find(|name| !taken.contains(name));
    free.unwrap_or_else(|| name.to_owned())
}

/// Configuration and files of all runs. What does not concern a source is from the first run with a vehicle,
/// or else from the first run.
fn attachments(members: &[Member]) -> Result<Vec<Attachment>> {
    let main = members.iter().position(|member| member.vehicle().is_some());
    let Some(main) = members.get(main.unwrap_or(0)) else {
        return Err(Error::NoConfiguration);
    };
    let mut table = main.table.clone();
    let mut sources = toml::Table::new();
    let mut files: Vec<Attachment> = Vec::new();
    for member in members {
        if let (Some(one), Some(other)) = (main.vehicle(), member.vehicle())
            && one != other
        {
            return Err(Error::OtherVehicles([one, other].map(ToString::to_string)));
        }
        for (name, name_of_all) in &member.names {
            if let (Some(source), false) =
                (member.source_table(name), sources.contains_key(name_of_all))
            {
                let source = with_own_device(source, &sources);
                sources.insert(name_of_all.clone(), source);
            }
        }
        for file in member
            .attachments
            .iter()
            .filter(|file| file.name != ATTACHED_NAME)
        {
            match files.iter().find(|known| known.name == file.name) {
                Some(known) if known.data != file.data => {
                    return Err(Error::OtherFiles(file.name.clone()));
                }
                Some(_) => {}
                None => files.push(file.clone()),
            }
        }
    }
    table.insert("source".to_owned(), toml::Value::Table(sources));
    let configuration = Attachment {
        name: ATTACHED_NAME.to_owned(),
        media_type: "application/toml".to_owned(),
        data: table.to_string().into_bytes(),
    };
    files.insert(0, configuration);
    Ok(files)
}

/// A source whose device has a name of its own: two computers can have the same names of devices.
fn with_own_device(source: &toml::Value, others: &toml::Table) -> toml::Value {
    let mut source = source.clone();
    for key in ["device", "interface"] {
        let taken = others.values().filter_map(|other| other.get(key)?.as_str());
        let taken: BTreeSet<String> = taken.map(str::to_owned).collect();
        if let Some(toml::Value::String(own)) = source.get_mut(key)
            && taken.contains(own)
        {
            *own = free_name(own, &taken);
        }
    }
    source
}

fn session_of(members: &[Member], config: &Config) -> Session {
    let sessions = || members.iter().map(|member| member.reader.session());
    let all = |text: fn(&Session) -> &str| {
        let texts: BTreeSet<&str> = sessions()
            .map(text)
            .filter(|text| !text.is_empty())
            .collect();
        texts.into_iter().collect::<Vec<_>>().join(" ")
    };
    let started = sessions().map(|session| session.started).min();
    let runs: Vec<&str> = sessions().map(|session| session.run_id.as_str()).collect();
    Session {
        run_id: format!("{}-merged", runs.join("+")),
        boot_id: all(|session| &session.boot_id),
        host: all(|session| &session.host),
        // The worst of all.
        clock: sessions()
            .map(|session| session.clock)
            .max_by_key(|clock| clock.is_implausible())
            .unwrap_or_default(),
        ..session::started_at(config, started.unwrap_or_default())
    }
}

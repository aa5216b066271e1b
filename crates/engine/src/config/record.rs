//! `[record]`: which decoded CAN messages are written into the log.

use std::collections::{BTreeMap, BTreeSet};

use sample::SourceId;
use wire::dbc::MessageDef;

use super::estimator::by_name;
use super::source::{CanMeaning, Meaning, Source};
use model::file::{ErrorCollector, Section};

/// Which decoded CAN messages are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Decoded {
    /// All.
    All,
    /// Those with a signal that has a role; of a bus without roles, all.
    #[default]
    Roles,
    /// None.
    None,
}

/// Names in the file.
const DECODED: [(&str, Decoded); 3] = [
    ("all", Decoded::All),
    ("roles", Decoded::Roles),
    ("none", Decoded::None),
];

/// Reads the table: the names of the messages of each bus that are not written.
pub fn left_out(
    mut section: Section<'_>,
    sources: &[Source],
    collector: &mut ErrorCollector<'_>,
) -> BTreeMap<SourceId, BTreeSet<String>> {
    let decoded = section.optional::<String>("decoded", collector);
    section.finish(collector);
    let decoded = decoded
        .and_then(|field| by_name(&field, &field.value, &DECODED, collector))
        .unwrap_or_default();
    let buses = sources.iter().filter_map(|source| match &source.meaning {
        Meaning::Can(can) => Some((source.spec.id, can)),
        _ => None,
    });
    let names = buses.map(|(id, can)| (id, names(can, decoded)));
    names.filter(|(_, names)| !names.is_empty()).collect()
}

fn names(can: &CanMeaning, decoded: Decoded) -> BTreeSet<String> {
    if decoded == Decoded::All || decoded == Decoded::Roles && can.roles.is_empty() {
        return BTreeSet::new();
    }
    let has_role = |place: (usize, usize)| {
        let mut roles = can.roles.iter();
        roles.any(|role| (role.database, role.message) == place)
    };
    can_messages(can)
        .filter(|(place, ..)| decoded == Decoded::None || !has_role(*place))
        .map(|(_, _, name)| name.to_owned())
        .collect()
}

/// All messages of the DBC files of a bus: index of the file and of the message in it, definition, and
/// name in the log.
pub(crate) fn can_messages(
    can: &CanMeaning,
) -> impl Iterator<Item = ((usize, usize), &MessageDef, &str)> {
    let files = can.databases.iter().zip(&can.names).enumerate();
    files.flat_map(|(file, (database, names))| {
        let messages = database.messages().iter().zip(names).enumerate();
        messages.map(move |(index, (message, name))| ((file, index), message, name.as_str()))
    })
}

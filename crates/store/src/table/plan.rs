//! Plan for decoding a schema: the column of each field number.

use std::collections::BTreeMap;

use prost::Message as _;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{
    DescriptorProto, EnumDescriptorProto, FieldDescriptorProto, FileDescriptorProto,
    FileDescriptorSet,
};

use super::keyed::{Key, Keyed};
use super::{Column, Values};
use crate::reader::ChannelInfo;

/// Plan for the messages of one channel. Node 0 is the message itself.
pub(super) struct Plan {
    pub nodes: Vec<Node>,
    /// Lists whose entries have names.
    pub keyed: Vec<Keyed>,
    schema: FileDescriptorSet,
    units: BTreeMap<String, String>,
    /// Counts rows and elements of repeated messages.
    pub stamp: u64,
}

/// A message type at one place of the tree.
#[derive(Default)]
pub(super) struct Node {
    pub fields: Fields,
    /// Columns that get an entry for each element, if the message is repeated.
    pub columns: Vec<usize>,
    /// Columns of this message that are zero, not absent, when the message does not mention them.
    pub implicit: Vec<usize>,
    /// Column for the presence of the message, if it has no fields.
    pub presence: Option<usize>,
    /// Row or element in which the message was last found.
    pub last_stamp: u64,
}

/// Fields of a message type by their numbers.
#[derive(Default)]
pub(super) struct Fields {
    /// Those with small numbers, which nearly all fields have.
    small: Vec<Option<Field>>,
    large: BTreeMap<u32, Field>,
}

impl Fields {
    /// Numbers from here on are kept in a map.
    const LARGE: u32 = 256;

    pub fn get(&self, number: u32) -> Option<Field> {
        match self.small.get(number as usize) {
            Some(field) => *field,
            None => self.large.get(&number).copied(),
        }
    }

    fn insert(&mut self, number: u32, field: Field) {
        if number >= Self::LARGE {
            self.large.insert(number, field);
            return;
        }
        let index = number as usize;
        self.small.resize(self.small.len().max(index + 1), None);
        self.small[index] = Some(field);
    }

    fn is_empty(&self) -> bool {
        self.small.is_empty() && self.large.is_empty()
    }
}

/// A field of a message type.
#[derive(Clone, Copy)]
pub(super) enum Field {
    Value {
        column: usize,
        kind: Type,
        repeated: bool,
    },
    Message {
        node: usize,
        repeated: bool,
    },
    /// Position in [`Plan::keyed`].
    Keyed(usize),
}

/// Position in the tree while a plan is made.
#[derive(Clone, Debug, Default)]
pub(super) struct Place {
    pub prefix: String,
    types: Vec<String>,
    in_list: bool,
    in_choice: bool,
    /// The message is an entry of a list whose entries are named.
    pub is_entry: bool,
}

struct Builder<'a> {
    messages: BTreeMap<String, (&'a DescriptorProto, bool)>,
    enums: BTreeMap<String, &'a EnumDescriptorProto>,
    units: &'a BTreeMap<String, String>,
    rows: usize,
    columns: &'a mut Vec<Column>,
    nodes: Vec<Node>,
    keyed: Vec<Keyed>,
}

impl Plan {
    /// A plan for a channel; columns that are not there yet are added, absent in `rows` rows.
    pub fn new(
        channel: &ChannelInfo,
        rows: usize,
        columns: &mut Vec<Column>,
    ) -> Result<Self, &'static str> {
        let schema = FileDescriptorSet::decode(channel.schema_data.as_ref())
            .map_err(|_| "it is no serialized FileDescriptorSet")?;
        let mut plan = Self {
            nodes: Vec::new(),
            keyed: Vec::new(),
            schema,
            units: channel.metadata.clone(),
            stamp: 0,
        };
        let name = format!(".{}", channel.schema);
        plan.make(rows, columns, |builder| {
            builder.node(&name, &Place::default(), None)
        })?;
        Ok(plan)
    }

    /// Adds nodes; columns that are not there yet are absent in `rows` rows.
    fn make<T>(
        &mut self,
        rows: usize,
        columns: &mut Vec<Column>,
        add: impl FnOnce(&mut Builder<'_>) -> T,
    ) -> T {
        let mut builder = Builder {
            messages: BTreeMap::new(),
            enums: BTreeMap::new(),
            units: &self.units,
            rows,
            columns,
            nodes: std::mem::take(&mut self.nodes),
            keyed: std::mem::take(&mut self.keyed),
        };
        for file in &self.schema.file {
            builder.register_file(file);
        }
        let added = add(&mut builder);
        (self.nodes, self.keyed) = (builder.nodes, builder.keyed);
        added
    }

    /// The node of the entry `name` of a keyed list; `None` for one name too many. An entry that comes
    /// for the first time, in the row that is being filled, gets columns.
    pub(super) fn entry(
        &mut self,
        list: usize,
        name: &str,
        columns: &mut Vec<Column>,
        rows: usize,
    ) -> Option<usize> {
        let keyed = &self.keyed[list];
        if let Some(node) = keyed.nodes.get(name) {
            return Some(*node);
        }
        if !keyed.allows(name) {
            return None;
        }
        let known = columns.len();
        let node = self.make(rows, columns, |builder| builder.entry(list, name));
        columns[known..].iter_mut().for_each(Column::begin_row);
        node.ok()
    }
}

impl<'a> Builder<'a> {
    fn register_file(&mut self, file: &'a FileDescriptorProto) {
        let prefix = match file.package() {
            "" => String::new(),
            package => format!(".{package}"),
        };
        let explicit = file.syntax() != "proto3";
        for message in &file.message_type {
            self.register(&prefix, message, explicit);
        }
        for named in &file.enum_type {
            self.enums
                .insert(format!("{prefix}.{}", named.name()), named);
        }
    }

    fn register(&mut self, prefix: &str, message: &'a DescriptorProto, explicit: bool) {
        let name = format!("{prefix}.{}", message.name());
        for nested in &message.nested_type {
            self.register(&name, nested, explicit);
        }
        for named in &message.enum_type {
            self.enums.insert(format!("{name}.{}", named.name()), named);
        }
        self.messages.insert(name, (message, explicit));
    }

    /// A node for the message `name`, without the fields of its key.
    fn node(&mut self, name: &str, place: &Place, key: Option<Key>) -> Result<usize, &'static str> {
        let (message, explicit) = *self
            .messages
            .get(name)
            .ok_or("it does not define the message that it is named after, or one that it uses")?;
        let index = self.nodes.len();
        self.nodes.push(Node::default());
        let mut node = Node::default();
        for field in &message.field {
            let number = u32::try_from(field.number()).map_err(|_| "a field number is negative")?;
            if key.is_some_and(|key| key.has(number)) {
                continue;
            }
            let planned = self.field(field, name, explicit, place, &mut node)?;
            node.fields.insert(number, planned);
        }
        self.nodes[index] = node;
        Ok(index)
    }

    /// The node of an entry of a keyed list.
    fn entry(&mut self, list: usize, name: &str) -> Result<usize, &'static str> {
        let keyed = &self.keyed[list];
        let (key, type_name) = (keyed.key, keyed.type_name.clone());
        let mut place = keyed.place.clone();
        place.prefix = format!("{}{name}.", place.prefix);
        let node = self.node(&type_name, &place, Some(key))?;
        self.keyed[list].nodes.insert(name.to_owned(), node);
        Ok(node)
    }

    /// How the entries of a field are named: of a list of the log's own messages that is in no list
    /// without names.
    fn key(&self, field: &FieldDescriptorProto, place: &Place) -> Option<Key> {
        let is_list = field.label() == Label::Repeated && !place.in_list;
        let name = field.type_name();
        let (entry, _) = self
            .messages
            .get(name)
            .filter(|_| is_list && name.starts_with(".atvrec."))?;
        Key::of(entry, place.is_entry)
    }

    fn field(
        &mut self,
        field: &FieldDescriptorProto,
        owner: &str,
        explicit: bool,
        place: &Place,
        node: &mut Node,
    ) -> Result<Field, &'static str> {
        let repeated = field.label() == Label::Repeated;
        let name = format!("{}{}", place.prefix, field.name());
        let in_choice = place.in_choice || field.oneof_index.is_some();
        let mut kind = field.r#type();
        if kind == Type::Message {
            let mut types = place.types.clone();
            types.push(owner.to_owned());
            if !types.iter().any(|above| above == field.type_name()) {
                if let Some(key) = self.key(field, place) {
                    let place = Place {
                        prefix: place.prefix.clone(),
                        types,
                        in_list: false,
                        // A message may have no entry of this name.
                        in_choice: true,
                        is_entry: true,
                    };
                    return self.keyed(field.type_name(), key, place);
                }
                let below = Place {
                    prefix: format!("{name}."),
                    types,
                    in_list: place.in_list || repeated,
                    in_choice,
                    is_entry: place.is_entry,
                };
                let inner = self.node(field.type_name(), &below, None)?;
                if self.nodes[inner].fields.is_empty() {
                    let presence = listed(Values::Bool(Vec::new()), below.in_list);
                    let presence = self.column(field, name, presence, None)?;
                    self.nodes[inner].columns.push(presence);
                    self.nodes[inner].presence = Some(presence);
                }
                if !repeated {
                    node.columns.extend(&self.nodes[inner].columns);
                }
                return Ok(Field::Message {
                    node: inner,
                    repeated,
                });
            }
            kind = Type::Bytes;
        }
        let values = empty(kind)?;
        let is_float = matches!(values, Values::F64(_));
        let has_presence = explicit || field.oneof_index.is_some();
        let in_list = place.in_list || repeated;
        let present = (!is_float && !in_list && (explicit || in_choice)).then(Vec::new);
        let shows_absence = is_float || present.is_some();
        let column = self.column(field, name, listed(values, in_list), present)?;
        if !repeated {
            node.columns.push(column);
            if shows_absence && !has_presence {
                node.implicit.push(column);
            }
        }
        Ok(Field::Value {
            column,
            kind,
            repeated,
        })
    }

    /// A list whose entries are named.
    fn keyed(&mut self, type_name: &str, key: Key, place: Place) -> Result<Field, &'static str> {
        let list = self.keyed.len();
        self.keyed.push(Keyed {
            key,
            type_name: type_name.to_owned(),
            place,
            nodes: BTreeMap::new(),
        });
        for name in key.presets() {
            self.entry(list, &name)?;
        }
        Ok(Field::Keyed(list))
    }

    /// The column of this name: as it is, or new with all rows so far absent.
    fn column(
        &mut self,
        field: &FieldDescriptorProto,
        name: String,
        values: Values,
        present: Option<Vec<bool>>,
    ) -> Result<usize, &'static str> {
        let named = self.enums.get(field.type_name());
        let names = named.iter().flat_map(|named| &named.value);
        let mut column = Column {
            unit: self
                .units
                .get(&format!("unit.{name}"))
                .cloned()
                .unwrap_or_default(),
            names: names.map(|v| (v.number(), v.name().to_owned())).collect(),
            name,
            values,
            present,
        };
        let known = self.columns.iter().position(|c| c.name == column.name);
        if let Some(known) = known {
            let old = &self.columns[known];
            let same = old.values.same_type(&column.values)
                && old.present.is_some() == column.present.is_some();
            return same
                .then_some(known)
                .ok_or("a field has another type than in the files or channels before");
        }
        for _ in 0..self.rows {
            column.begin_row();
            column.values.end_row();
        }
        self.columns.push(column);
        Ok(self.columns.len() - 1)
    }
}

fn listed(values: Values, in_list: bool) -> Values {
    if !in_list {
        return values;
    }
    Values::List {
        ends: Vec::new(),
        values: Box::new(values),
    }
}

fn empty(kind: Type) -> Result<Values, &'static str> {
    Ok(match kind {
        Type::Double | Type::Float => Values::F64(Vec::new()),
        Type::Int32 | Type::Sint32 | Type::Sfixed32 | Type::Enum => Values::I32(Vec::new()),
        Type::Int64 | Type::Sint64 | Type::Sfixed64 => Values::I64(Vec::new()),
        Type::Uint32 | Type::Fixed32 => Values::U32(Vec::new()),
        Type::Uint64 | Type::Fixed64 => Values::U64(Vec::new()),
        Type::Bool => Values::Bool(Vec::new()),
        Type::String => Values::Text(Vec::new()),
        Type::Bytes | Type::Message => Values::Bytes(Vec::new()),
        Type::Group => return Err("it holds a group, which protobuf itself has given up"),
    })
}

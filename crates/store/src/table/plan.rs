//! From a schema to what is to be done with each field number.

use std::collections::BTreeMap;

use prost::Message as _;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{
    DescriptorProto, EnumDescriptorProto, FieldDescriptorProto, FileDescriptorProto,
    FileDescriptorSet,
};

use super::{Column, Values};
use crate::reader::ChannelInfo;

/// What to do with the messages of one channel. Node 0 is the message itself.
pub(super) struct Plan {
    pub nodes: Vec<Node>,
    /// Counts rows and elements of repeated messages.
    pub stamp: u64,
}

/// A message type at one place of the tree.
#[derive(Default)]
pub(super) struct Node {
    pub fields: BTreeMap<u32, Field>,
    /// Columns that get an entry for each element, if the message is repeated.
    pub columns: Vec<usize>,
    /// Columns of this message that are zero, not absent, when the message does not mention them.
    pub implicit: Vec<usize>,
    /// Column that tells that the message is there, if it has no field that could.
    pub there: Option<usize>,
    /// Row or element in which the message was last met.
    pub met: u64,
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
}

/// Where in the tree the plan is being made.
#[derive(Clone, Default)]
struct Place {
    prefix: String,
    types: Vec<String>,
    in_list: bool,
    in_choice: bool,
}

struct Maker<'a> {
    messages: BTreeMap<String, (&'a DescriptorProto, bool)>,
    enums: BTreeMap<String, &'a EnumDescriptorProto>,
    units: &'a BTreeMap<String, String>,
    rows: usize,
    columns: &'a mut Vec<Column>,
    nodes: Vec<Node>,
}

impl Plan {
    /// A plan for a channel; columns that are not there yet are added, absent in `rows` rows.
    pub fn new(
        channel: &ChannelInfo,
        rows: usize,
        columns: &mut Vec<Column>,
    ) -> Result<Self, &'static str> {
        let set = FileDescriptorSet::decode(channel.schema_data.as_ref())
            .map_err(|_| "it is no serialized FileDescriptorSet")?;
        let mut maker = Maker {
            messages: BTreeMap::new(),
            enums: BTreeMap::new(),
            units: &channel.metadata,
            rows,
            columns,
            nodes: Vec::new(),
        };
        for file in &set.file {
            maker.register_file(file);
        }
        let name = format!(".{}", channel.schema);
        maker.node(&name, &Place::default())?;
        Ok(Self {
            nodes: maker.nodes,
            stamp: 0,
        })
    }
}

impl<'a> Maker<'a> {
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

    fn node(&mut self, name: &str, place: &Place) -> Result<usize, &'static str> {
        let (message, explicit) = *self
            .messages
            .get(name)
            .ok_or("it does not define the message that it is named after, or one that it uses")?;
        let index = self.nodes.len();
        self.nodes.push(Node::default());
        let mut node = Node::default();
        for field in &message.field {
            let number = u32::try_from(field.number()).map_err(|_| "a field number is negative")?;
            let planned = self.field(field, name, explicit, place, &mut node)?;
            node.fields.insert(number, planned);
        }
        self.nodes[index] = node;
        Ok(index)
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
                let below = Place {
                    prefix: format!("{name}."),
                    types,
                    in_list: place.in_list || repeated,
                    in_choice,
                };
                let inner = self.node(field.type_name(), &below)?;
                if self.nodes[inner].fields.is_empty() {
                    let there = listed(Values::Bool(Vec::new()), below.in_list);
                    let there = self.column(field, name, there, None)?;
                    self.nodes[inner].columns.push(there);
                    self.nodes[inner].there = Some(there);
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
        let tells_absence = explicit || field.oneof_index.is_some();
        let in_list = place.in_list || repeated;
        let present = (!is_float && !in_list && (explicit || in_choice)).then(Vec::new);
        let told = is_float || present.is_some();
        let column = self.column(field, name, listed(values, in_list), present)?;
        if !repeated {
            node.columns.push(column);
            if told && !tells_absence {
                node.implicit.push(column);
            }
        }
        Ok(Field::Value {
            column,
            kind,
            repeated,
        })
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

use std::collections::BTreeSet;
use std::sync::OnceLock;

use prost::Message as _;
use prost_types::{FileDescriptorProto, FileDescriptorSet};

static DESCRIPTORS: &[u8] = include_bytes!("generated/descriptors.binpb");

fn all_files() -> &'static [FileDescriptorProto] {
    static FILES: OnceLock<Vec<FileDescriptorProto>> = OnceLock::new();
    FILES.get_or_init(|| {
        FileDescriptorSet::decode(DESCRIPTORS)
            .map(|set| set.file)
            .expect("the test of the generated files holds")
    })
}

/// The serialized `FileDescriptorSet` of a compiled message: its own file and those that it needs,
/// needed ones first.
pub(crate) fn descriptor_set(full_name: &str) -> Vec<u8> {
    let mut needed = BTreeSet::new();
    if let Some(file) = all_files().iter().find(|file| declares(file, full_name)) {
        collect(file, &mut needed);
    }
    // The compiler lists a file after all that it imports.
    let file = all_files()
        .iter()
        .filter(|file| needed.contains(file.name()))
        .cloned()
        .collect();
    FileDescriptorSet { file }.encode_to_vec()
}

fn declares(file: &FileDescriptorProto, full_name: &str) -> bool {
    full_name
        .strip_prefix(file.package())
        .and_then(|rest| rest.strip_prefix('.'))
        .is_some_and(|name| file.message_type.iter().any(|m| m.name() == name))
}

fn collect<'a>(file: &'a FileDescriptorProto, needed: &mut BTreeSet<&'a str>) {
    if needed.insert(file.name()) {
        for name in &file.dependency {
            if let Some(file) = all_files().iter().find(|file| file.name() == name) {
                collect(file, needed);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_schema_holds_its_imports_and_nothing_else() {
        let set = FileDescriptorSet::decode(&*descriptor_set("foxglove.FrameTransforms"))
            .expect("a descriptor set");
        let names: Vec<_> = set.file.iter().map(FileDescriptorProto::name).collect();
        assert_eq!(names.len(), 5, "{names:?}");
        assert_eq!(names.last(), Some(&"foxglove/FrameTransforms.proto"));
        for (index, file) in set.file.iter().enumerate() {
            for dependency in &file.dependency {
                assert!(names[..index].contains(&dependency.as_str()));
            }
        }
    }
}

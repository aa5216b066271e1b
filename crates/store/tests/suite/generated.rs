//! The Rust types and the descriptors in `src/generated` are those of the schemas in `proto/`.

use std::path::Path;

use prost::Message as _;

/// Messages of an earlier layout, which no log carries any more.
const EARLIER: &str = "earlier/layout.proto";

const PROTOS: [&str; 10] = [
    EARLIER,
    "atvrec/raw.proto",
    "atvrec/sensor.proto",
    "atvrec/estimate.proto",
    "atvrec/health.proto",
    "atvrec/time.proto",
    "foxglove/LocationFix.proto",
    "foxglove/Log.proto",
    "foxglove/FrameTransforms.proto",
    "foxglove/SceneUpdate.proto",
];

const FILES: [&str; 4] = [
    "atvrec.rs",
    "atvrec.earlier.rs",
    "foxglove.rs",
    "descriptors.binpb",
];

/// Writes Rust types and descriptors of the schemas into `directory`.
fn generate(directory: &Path) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut set = protox::compile(PROTOS, [root.join("proto")]).expect("the schemas are valid");
    let mut config = prost_build::Config::new();
    config.enable_type_names();
    config.out_dir(directory);
    config
        .compile_fds(set.clone())
        .expect("the types can be written");
    set.file.retain(|file| file.name() != EARLIER);
    // The comments are in the Rust types. A log contains the descriptors without comments.
    for file in &mut set.file {
        file.source_code_info = None;
    }
    std::fs::write(directory.join("descriptors.binpb"), set.encode_to_vec())
        .expect("the descriptors can be written");
}

#[test]
fn generated_files_are_current() {
    let fresh = tempfile::tempdir().expect("a temporary directory");
    generate(fresh.path());
    for name in FILES {
        let bytes = std::fs::read(fresh.path().join(name)).expect("a generated file");
        testkit::assert_file(&format!("crates/store/src/generated/{name}"), &bytes);
    }
}

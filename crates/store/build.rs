//! Compiles the log's protobuf schemas to Rust and keeps their descriptors, which go into every log.

#![allow(
    clippy::disallowed_methods,
    reason = "Cargo names the folder of generated files in the environment"
)]

use std::path::Path;

use prost::Message as _;

/// Messages of an earlier layout, which no log carries any more.
const EARLIER: &str = "earlier/layout.proto";

const PROTOS: [&str; 9] = [
    EARLIER,
    "atvrec/raw.proto",
    "atvrec/sensor.proto",
    "atvrec/estimate.proto",
    "atvrec/health.proto",
    "atvrec/time.proto",
    "foxglove/LocationFix.proto",
    "foxglove/Log.proto",
    "foxglove/FrameTransforms.proto",
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo::rerun-if-changed=proto");
    let mut set = protox::compile(PROTOS, ["proto"])?;
    let mut config = prost_build::Config::new();
    config.enable_type_names();
    config.compile_fds(set.clone())?;
    set.file.retain(|file| file.name() != EARLIER);
    // Comments have served the Rust documentation; a log carries the bare descriptors.
    for file in &mut set.file {
        file.source_code_info = None;
    }
    let out = std::env::var("OUT_DIR")?;
    std::fs::write(
        Path::new(&out).join("descriptors.binpb"),
        set.encode_to_vec(),
    )?;
    Ok(())
}

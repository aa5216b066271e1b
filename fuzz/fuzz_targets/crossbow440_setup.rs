//! The dialogue that sets a Crossbow 440 up, with a unit that answers anything.
#![no_main]

use std::time::Duration;

use libfuzzer_sys::fuzz_target;
use wire::crossbow440::{Setup, SetupOptions, encode_packet};

fuzz_target!(|data: &[u8]| {
    let mut setup = Setup::new(SetupOptions::default());
    let mut now = Duration::ZERO;
    for answer in data.chunks(12) {
        while setup.poll(now).is_some() {}
        if answer.len() > 2 && answer[0] & 1 == 0 {
            setup.receive(&encode_packet([answer[0], answer[1]], &answer[2..]));
        } else {
            setup.receive(answer);
        }
        now += Duration::from_millis(u64::from(answer[0]));
    }
    let mut steps = 0;
    while let Some(deadline) = setup.deadline() {
        now = now.max(deadline);
        if setup.poll(now).is_none() {
            break;
        }
        steps += 1;
        assert!(steps < 10_000, "a silent unit ends the dialogue");
    }
});

//! `orchestrator::decoders::description` under libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| orchestrator::decoders::description(bytes));

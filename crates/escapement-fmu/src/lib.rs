//! Escapement as a shared library: everything that the program `escapement` contains, with the functions of FMI 2.0 and 3.0 and those of
//! `escapement-run.h` as its interface.

fmu_export::fmu!(orchestrator::stock::contents, orchestrator::VERSION);
run_c::run_functions!(orchestrator::stock::contents, orchestrator::VERSION);

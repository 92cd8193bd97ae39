//! Escapement as a library: everything that the program `escapement` contains, behind the functions of FMI 2.0 and 3.0 and those of
//! `escapement-run.h`.

fmu_export::fmu!(orchestrator::stock::contents, orchestrator::VERSION);
run_c::run_functions!(orchestrator::stock::contents, orchestrator::VERSION);

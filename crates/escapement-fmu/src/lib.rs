//! The library of Escapement's FMUs: everything that the program `escapement` contains, behind the functions of FMI 2.0 and 3.0.

fmu_export::fmu!(orchestrator::stock::contents, orchestrator::VERSION);

//! The C functions of an exported FMU's library, which [`fmu!`] defines.

/// Defines the FMU library of a program: `fmu export` packs this library into every FMU that it exports.
///
/// It belongs in a separate package with `crate-type = ["cdylib"]`, called `NAME_fmu` for the program `NAME`. The first argument fills the
/// catalogue, with the same contents as that of the program; the second one is the version of Escapement.
///
/// ```
/// use engine::Catalogue;
///
/// fn contents(catalogue: Catalogue) -> Catalogue {
///     catalogue
/// }
///
/// fmu_export::fmu!(contents, "0.1.0");
/// # fn main() {}
/// ```
#[macro_export]
macro_rules! fmu {
    ($contents:path, $version:expr) => {
        const _: () = {
            #[allow(clippy::wildcard_imports, reason = "these are the types of the functions below")]
            use $crate::__private::*;

            fn catalogue() -> Arc<Catalogue> {
                static ALL: OnceLock<Arc<Catalogue>> = OnceLock::new();
                let make = || Arc::new($contents(Catalogue::new($version)));
                ALL.get_or_init(make).clone()
            }

            $crate::functions! {
                fn fmi2GetTypesPlatform() -> *const c_char = c"default".as_ptr();
                fn fmi2GetVersion() -> *const c_char = c"2.0".as_ptr();
                fn fmi2SetDebugLogging(i: Pointer, on: c_int, count: usize, categories: *const *const c_char) -> c_int = call::set_debug_logging(i, on != 0, categories, count);
                fn fmi2Instantiate(name: *const c_char, kind: c_int, token: *const c_char, resources: *const c_char, callbacks: *const fmi2::Callbacks, _visible: c_int, _logging: c_int) -> Pointer = fmi2::instantiate(catalogue, name, kind, token, resources, callbacks);
                fn fmi2FreeInstance(i: Pointer) = call::free(i);
                fn fmi2SetupExperiment(i: Pointer, _defined: c_int, _tolerance: f64, start: f64, _stops: c_int, _stop: f64) -> c_int = fmi2::set_up(i, start);
                fn fmi2EnterInitializationMode(i: Pointer) -> c_int = fmi2::enter(i);
                fn fmi2ExitInitializationMode(i: Pointer) -> c_int = fmi2::exit(i);
                fn fmi2Terminate(i: Pointer) -> c_int = fmi2::terminate(i);
                fn fmi2Reset(i: Pointer) -> c_int = fmi2::reset(i);
                fn fmi2GetReal(i: Pointer, r: *const u32, n: usize, to: *mut c_void) -> c_int = fmi2::get(i, Native::Float64, r, n, to);
                fn fmi2SetReal(i: Pointer, r: *const u32, n: usize, from: *const c_void) -> c_int = fmi2::set(i, Native::Float64, r, n, from);
                fn fmi2GetInteger(i: Pointer, r: *const u32, n: usize, to: *mut c_void) -> c_int = fmi2::get(i, Native::Int32, r, n, to);
                fn fmi2SetInteger(i: Pointer, r: *const u32, n: usize, from: *const c_void) -> c_int = fmi2::set(i, Native::Int32, r, n, from);
                fn fmi2GetBoolean(i: Pointer, r: *const u32, n: usize, to: *mut c_void) -> c_int = fmi2::get(i, Native::Boolean32, r, n, to);
                fn fmi2SetBoolean(i: Pointer, r: *const u32, n: usize, from: *const c_void) -> c_int = fmi2::set(i, Native::Boolean32, r, n, from);
                fn fmi2GetString(i: Pointer, r: *const u32, n: usize, to: *mut *const c_char) -> c_int = call::get_texts(i, (r, n), to, n);
                fn fmi2SetString(i: Pointer, r: *const u32, n: usize, from: *const *const c_char) -> c_int = call::set_texts(i, (r, n), from, n);
                fn fmi2GetFMUstate(i: Pointer, state: *mut Pointer) -> c_int = call::save(i, state);
                fn fmi2SetFMUstate(i: Pointer, state: Pointer) -> c_int = call::restore(i, state);
                fn fmi2FreeFMUstate(_i: Pointer, state: *mut Pointer) -> c_int = { call::free_state(state); 0 };
                fn fmi2SerializedFMUstateSize(i: Pointer, state: Pointer, size: *mut usize) -> c_int = call::state_size(i, state, size);
                fn fmi2SerializeFMUstate(i: Pointer, state: Pointer, to: *mut u8, size: usize) -> c_int = call::serialise(i, state, to, size);
                fn fmi2DeSerializeFMUstate(i: Pointer, from: *const u8, size: usize, state: *mut Pointer) -> c_int = call::deserialise(i, from, size, state);
                fn fmi3GetFMUState(i: Pointer, state: *mut Pointer) -> c_int = call::save(i, state);
                fn fmi3SetFMUState(i: Pointer, state: Pointer) -> c_int = call::restore(i, state);
                fn fmi3FreeFMUState(_i: Pointer, state: *mut Pointer) -> c_int = { call::free_state(state); 0 };
                fn fmi3SerializedFMUStateSize(i: Pointer, state: Pointer, size: *mut usize) -> c_int = call::state_size(i, state, size);
                fn fmi3SerializeFMUState(i: Pointer, state: Pointer, to: *mut u8, size: usize) -> c_int = call::serialise(i, state, to, size);
                fn fmi3DeserializeFMUState(i: Pointer, from: *const u8, size: usize, state: *mut Pointer) -> c_int = call::deserialise(i, from, size, state);
                fn fmi2GetDirectionalDerivative(i: Pointer) -> c_int = call::unsupported(i, "fmi2GetDirectionalDerivative");
                fn fmi2SetRealInputDerivatives(i: Pointer) -> c_int = call::unsupported(i, "fmi2SetRealInputDerivatives");
                fn fmi2GetRealOutputDerivatives(i: Pointer) -> c_int = call::unsupported(i, "fmi2GetRealOutputDerivatives");
                fn fmi2DoStep(i: Pointer, from: f64, span: f64, _final: c_int) -> c_int = fmi2::step(i, from, span);
                fn fmi2CancelStep(i: Pointer) -> c_int = fmi2::no_status(i);
                fn fmi2GetStatus(i: Pointer, _which: c_int, _value: *mut c_int) -> c_int = fmi2::no_status(i);
                fn fmi2GetRealStatus(i: Pointer, which: c_int, value: *mut f64) -> c_int = fmi2::real_status(i, which, value);
                fn fmi2GetIntegerStatus(i: Pointer, _which: c_int, _value: *mut c_int) -> c_int = fmi2::no_status(i);
                fn fmi2GetBooleanStatus(i: Pointer, which: c_int, value: *mut c_int) -> c_int = fmi2::boolean_status(i, which, value);
                fn fmi2GetStringStatus(i: Pointer, _which: c_int, _value: *mut *const c_char) -> c_int = fmi2::no_status(i);
                fn fmi3GetVersion() -> *const c_char = c"3.0".as_ptr();
                fn fmi3SetDebugLogging(i: Pointer, on: bool, count: usize, categories: *const *const c_char) -> c_int = call::set_debug_logging(i, on, categories, count);
                fn fmi3InstantiateModelExchange(_name: *const c_char, _token: *const c_char, _resources: *const c_char, _visible: bool, _logging: bool, environment: *mut c_void, logger: Option<LoggerFmi3>) -> Pointer = fmi3::no_instance(environment, logger);
                fn fmi3InstantiateCoSimulation(_name: *const c_char, token: *const c_char, resources: *const c_char, _visible: bool, _logging: bool, _events: bool, _early: bool, _required: *const u32, _count: usize, environment: *mut c_void, logger: Option<LoggerFmi3>, _update: *const c_void) -> Pointer = fmi3::instantiate(catalogue, token, resources, environment, logger);
                fn fmi3InstantiateScheduledExecution(_name: *const c_char, _token: *const c_char, _resources: *const c_char, _visible: bool, _logging: bool, environment: *mut c_void, logger: Option<LoggerFmi3>, _clock: *const c_void, _lock: *const c_void, _unlock: *const c_void) -> Pointer = fmi3::no_instance(environment, logger);
                fn fmi3FreeInstance(i: Pointer) = call::free(i);
                fn fmi3EnterInitializationMode(i: Pointer, _defined: bool, _tolerance: f64, start: f64, _stops: bool, _stop: f64) -> c_int = fmi3::enter(i, start);
                fn fmi3ExitInitializationMode(i: Pointer) -> c_int = fmi2::exit(i);
                fn fmi3Terminate(i: Pointer) -> c_int = fmi2::terminate(i);
                fn fmi3Reset(i: Pointer) -> c_int = fmi2::reset(i);
                fn fmi3GetFloat32(i: Pointer, r: *const u32, n: usize, to: *mut c_void, room: usize) -> c_int = fmi3::get(i, Native::Float32, r, n, to, room);
                fn fmi3SetFloat32(i: Pointer, r: *const u32, n: usize, from: *const c_void, room: usize) -> c_int = fmi3::set(i, Native::Float32, r, n, from, room);
                fn fmi3GetFloat64(i: Pointer, r: *const u32, n: usize, to: *mut c_void, room: usize) -> c_int = fmi3::get(i, Native::Float64, r, n, to, room);
                fn fmi3SetFloat64(i: Pointer, r: *const u32, n: usize, from: *const c_void, room: usize) -> c_int = fmi3::set(i, Native::Float64, r, n, from, room);
                fn fmi3GetInt8(i: Pointer, r: *const u32, n: usize, to: *mut c_void, room: usize) -> c_int = fmi3::get(i, Native::Int8, r, n, to, room);
                fn fmi3SetInt8(i: Pointer, r: *const u32, n: usize, from: *const c_void, room: usize) -> c_int = fmi3::set(i, Native::Int8, r, n, from, room);
                fn fmi3GetUInt8(i: Pointer, r: *const u32, n: usize, to: *mut c_void, room: usize) -> c_int = fmi3::get(i, Native::UInt8, r, n, to, room);
                fn fmi3SetUInt8(i: Pointer, r: *const u32, n: usize, from: *const c_void, room: usize) -> c_int = fmi3::set(i, Native::UInt8, r, n, from, room);
                fn fmi3GetInt16(i: Pointer, r: *const u32, n: usize, to: *mut c_void, room: usize) -> c_int = fmi3::get(i, Native::Int16, r, n, to, room);
                fn fmi3SetInt16(i: Pointer, r: *const u32, n: usize, from: *const c_void, room: usize) -> c_int = fmi3::set(i, Native::Int16, r, n, from, room);
                fn fmi3GetUInt16(i: Pointer, r: *const u32, n: usize, to: *mut c_void, room: usize) -> c_int = fmi3::get(i, Native::UInt16, r, n, to, room);
                fn fmi3SetUInt16(i: Pointer, r: *const u32, n: usize, from: *const c_void, room: usize) -> c_int = fmi3::set(i, Native::UInt16, r, n, from, room);
                fn fmi3GetInt32(i: Pointer, r: *const u32, n: usize, to: *mut c_void, room: usize) -> c_int = fmi3::get(i, Native::Int32, r, n, to, room);
                fn fmi3SetInt32(i: Pointer, r: *const u32, n: usize, from: *const c_void, room: usize) -> c_int = fmi3::set(i, Native::Int32, r, n, from, room);
                fn fmi3GetUInt32(i: Pointer, r: *const u32, n: usize, to: *mut c_void, room: usize) -> c_int = fmi3::get(i, Native::UInt32, r, n, to, room);
                fn fmi3SetUInt32(i: Pointer, r: *const u32, n: usize, from: *const c_void, room: usize) -> c_int = fmi3::set(i, Native::UInt32, r, n, from, room);
                fn fmi3GetInt64(i: Pointer, r: *const u32, n: usize, to: *mut c_void, room: usize) -> c_int = fmi3::get(i, Native::Int64, r, n, to, room);
                fn fmi3SetInt64(i: Pointer, r: *const u32, n: usize, from: *const c_void, room: usize) -> c_int = fmi3::set(i, Native::Int64, r, n, from, room);
                fn fmi3GetUInt64(i: Pointer, r: *const u32, n: usize, to: *mut c_void, room: usize) -> c_int = fmi3::get(i, Native::UInt64, r, n, to, room);
                fn fmi3SetUInt64(i: Pointer, r: *const u32, n: usize, from: *const c_void, room: usize) -> c_int = fmi3::set(i, Native::UInt64, r, n, from, room);
                fn fmi3GetBoolean(i: Pointer, r: *const u32, n: usize, to: *mut c_void, room: usize) -> c_int = fmi3::get(i, Native::Boolean8, r, n, to, room);
                fn fmi3SetBoolean(i: Pointer, r: *const u32, n: usize, from: *const c_void, room: usize) -> c_int = fmi3::set(i, Native::Boolean8, r, n, from, room);
                fn fmi3GetString(i: Pointer, r: *const u32, n: usize, to: *mut *const c_char, room: usize) -> c_int = call::get_texts(i, (r, n), to, room);
                fn fmi3SetString(i: Pointer, r: *const u32, n: usize, from: *const *const c_char, room: usize) -> c_int = call::set_texts(i, (r, n), from, room);
                fn fmi3GetBinary(i: Pointer, r: *const u32, n: usize, sizes: *mut usize, to: *mut *const u8, room: usize) -> c_int = call::get_binaries(i, (r, n), sizes, to, room);
                fn fmi3SetBinary(i: Pointer, r: *const u32, n: usize, sizes: *const usize, from: *const *const u8, room: usize) -> c_int = call::set_binaries(i, (r, n), sizes, from, room);
                fn fmi3GetClock(i: Pointer, _r: *const u32, n: usize) -> c_int = fmi3::none_of(i, "Clock", n);
                fn fmi3SetClock(i: Pointer, _r: *const u32, n: usize) -> c_int = fmi3::none_of(i, "Clock", n);
                fn fmi3GetNumberOfVariableDependencies(i: Pointer, r: u32, count: *mut usize) -> c_int = fmi3::dependency_count(i, r, count);
                fn fmi3GetVariableDependencies(i: Pointer, r: u32, element: *mut usize, independents: *mut u32, other: *mut usize, kinds: *mut c_int, room: usize) -> c_int = fmi3::dependencies(i, r, [element, other], independents, kinds, room);
                fn fmi3EnterEventMode(i: Pointer) -> c_int = call::unsupported(i, "fmi3EnterEventMode");
                fn fmi3GetDirectionalDerivative(i: Pointer) -> c_int = call::unsupported(i, "fmi3GetDirectionalDerivative");
                fn fmi3GetAdjointDerivative(i: Pointer) -> c_int = call::unsupported(i, "fmi3GetAdjointDerivative");
                fn fmi3EnterConfigurationMode(i: Pointer) -> c_int = call::unsupported(i, "fmi3EnterConfigurationMode");
                fn fmi3ExitConfigurationMode(i: Pointer) -> c_int = call::unsupported(i, "fmi3ExitConfigurationMode");
                fn fmi3GetIntervalDecimal(i: Pointer) -> c_int = call::unsupported(i, "fmi3GetIntervalDecimal");
                fn fmi3GetIntervalFraction(i: Pointer) -> c_int = call::unsupported(i, "fmi3GetIntervalFraction");
                fn fmi3GetShiftDecimal(i: Pointer) -> c_int = call::unsupported(i, "fmi3GetShiftDecimal");
                fn fmi3GetShiftFraction(i: Pointer) -> c_int = call::unsupported(i, "fmi3GetShiftFraction");
                fn fmi3SetIntervalDecimal(i: Pointer) -> c_int = call::unsupported(i, "fmi3SetIntervalDecimal");
                fn fmi3SetIntervalFraction(i: Pointer) -> c_int = call::unsupported(i, "fmi3SetIntervalFraction");
                fn fmi3SetShiftDecimal(i: Pointer) -> c_int = call::unsupported(i, "fmi3SetShiftDecimal");
                fn fmi3SetShiftFraction(i: Pointer) -> c_int = call::unsupported(i, "fmi3SetShiftFraction");
                fn fmi3EvaluateDiscreteStates(i: Pointer) -> c_int = call::unsupported(i, "fmi3EvaluateDiscreteStates");
                fn fmi3UpdateDiscreteStates(i: Pointer) -> c_int = call::unsupported(i, "fmi3UpdateDiscreteStates");
                fn fmi3EnterContinuousTimeMode(i: Pointer) -> c_int = call::unsupported(i, "fmi3EnterContinuousTimeMode");
                fn fmi3CompletedIntegratorStep(i: Pointer) -> c_int = call::unsupported(i, "fmi3CompletedIntegratorStep");
                fn fmi3SetTime(i: Pointer) -> c_int = call::unsupported(i, "fmi3SetTime");
                fn fmi3SetContinuousStates(i: Pointer) -> c_int = call::unsupported(i, "fmi3SetContinuousStates");
                fn fmi3GetContinuousStateDerivatives(i: Pointer) -> c_int = call::unsupported(i, "fmi3GetContinuousStateDerivatives");
                fn fmi3GetEventIndicators(i: Pointer) -> c_int = call::unsupported(i, "fmi3GetEventIndicators");
                fn fmi3GetContinuousStates(i: Pointer) -> c_int = call::unsupported(i, "fmi3GetContinuousStates");
                fn fmi3GetNominalsOfContinuousStates(i: Pointer) -> c_int = call::unsupported(i, "fmi3GetNominalsOfContinuousStates");
                fn fmi3GetNumberOfEventIndicators(i: Pointer) -> c_int = call::unsupported(i, "fmi3GetNumberOfEventIndicators");
                fn fmi3GetNumberOfContinuousStates(i: Pointer) -> c_int = call::unsupported(i, "fmi3GetNumberOfContinuousStates");
                fn fmi3EnterStepMode(i: Pointer) -> c_int = call::unsupported(i, "fmi3EnterStepMode");
                fn fmi3GetOutputDerivatives(i: Pointer) -> c_int = call::unsupported(i, "fmi3GetOutputDerivatives");
                fn fmi3ActivateModelPartition(i: Pointer) -> c_int = call::unsupported(i, "fmi3ActivateModelPartition");
                fn fmi3DoStep(i: Pointer, from: f64, span: f64, _final: bool, event: *mut bool, terminate: *mut bool, early: *mut bool, last: *mut f64) -> c_int = fmi3::step(i, from, span, event, terminate, early, last);
                fn escapement_fmu_export(request: *const c_char, context: *mut c_void, say: Say) -> c_int = command::export_by(catalogue, request, context, say);
            }
        };
    };
}

/// Defines the functions: each calls the expression given for it, and nothing else.
#[doc(hidden)]
#[macro_export]
macro_rules! functions {
    ($(fn $name:ident($($argument:ident: $type:ty),*) $(-> $result:ty)? = $call:expr;)*) => {
        $(
            #[unsafe(no_mangle)]
            #[allow(non_snake_case, clippy::too_many_arguments, clippy::allow_attributes, reason = "the standard's")]
            unsafe extern "C" fn $name($($argument: $type),*) $(-> $result)? {
                // SAFETY: an importer passes the arguments that the standard prescribes, which are the conditions of what is called.
                #[allow(unused_unsafe, reason = "a few call nothing")]
                unsafe { $call }
            }
        )*
    };
}

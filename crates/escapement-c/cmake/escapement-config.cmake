# find_package(escapement CONFIG) gives
#   escapement::escapement  the shared library, for a participant that is a program of its own
#   escapement::static      the same as a static library
#   escapement::run         runs from C or C++: escapement-run.h
#   escapement::plugin      the headers alone, for a plug-in (add_library(NAME MODULE …))
get_filename_component(_escapement_prefix "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)

if(NOT TARGET escapement::plugin)
    add_library(escapement::plugin INTERFACE IMPORTED)
    set_target_properties(escapement::plugin PROPERTIES
        INTERFACE_INCLUDE_DIRECTORIES "${_escapement_prefix}/include"
        INTERFACE_COMPILE_DEFINITIONS ESCAPEMENT_NO_MAIN
        # Products and sums are rounded one by one, on every machine alike.
        INTERFACE_COMPILE_OPTIONS -ffp-contract=off
        INTERFACE_COMPILE_FEATURES "c_std_11;cxx_std_17")

    add_library(escapement::escapement SHARED IMPORTED)
    set_target_properties(escapement::escapement PROPERTIES
        IMPORTED_LOCATION "${_escapement_prefix}/lib/libescapement.so.1"
        IMPORTED_SONAME libescapement.so.1
        INTERFACE_INCLUDE_DIRECTORIES "${_escapement_prefix}/include"
        INTERFACE_COMPILE_OPTIONS -ffp-contract=off
        INTERFACE_COMPILE_FEATURES "c_std_11;cxx_std_17")

    add_library(escapement::static STATIC IMPORTED)
    set_target_properties(escapement::static PROPERTIES
        IMPORTED_LOCATION "${_escapement_prefix}/lib/libescapement.a"
        INTERFACE_INCLUDE_DIRECTORIES "${_escapement_prefix}/include"
        INTERFACE_COMPILE_OPTIONS -ffp-contract=off
        INTERFACE_COMPILE_FEATURES "c_std_11;cxx_std_17"
        INTERFACE_LINK_LIBRARIES "pthread;dl;m;gcc_s")

    add_library(escapement::run SHARED IMPORTED)
    set_target_properties(escapement::run PROPERTIES
        IMPORTED_LOCATION "${_escapement_prefix}/lib/libescapement_run.so"
        IMPORTED_NO_SONAME TRUE
        INTERFACE_INCLUDE_DIRECTORIES "${_escapement_prefix}/include")
endif()
unset(_escapement_prefix)

// A position loop: a mass on a spring with a damper, its PID controller, and a reference. One plug-in with three participants.
#include <escapement.hpp>

#include <algorithm>

struct Motion { double position, velocity; };
struct Push { double force; };
struct Target { double position; };
ESCAPEMENT_MESSAGE(Motion, ESCAPEMENT_FIELD(Motion, position, "m", "N"), ESCAPEMENT_FIELD(Motion, velocity, "m/s", "N"));
ESCAPEMENT_MESSAGE(Push, ESCAPEMENT_FIELD(Push, force, "N", "N"));
ESCAPEMENT_MESSAGE(Target, ESCAPEMENT_FIELD(Target, position, "m", "N"));

struct Plant {
    escapement::Input<Push> push;
    escapement::Output<Motion> motion;
    double mass, stiffness, damping;
    Motion now{};

    explicit Plant(escapement::Setup &setup)
        : push(setup, "push"), motion(setup, "motion"), mass(setup.number("mass", "kg")),
          stiffness(setup.number("stiffness", "N/m")), damping(setup.number("damping", "N s/m")) {
        setup.kind(escapement::continuous);
    }
    void step(const escapement::Step &step) {
        double force = push->force - stiffness * now.position - damping * now.velocity;
        now.velocity += step.period * (force / mass);
        now.position += step.period * now.velocity;
        *motion = now;
    }
    void state(escapement::State &state) { state(now); }
};

struct Pid {
    escapement::Input<Motion> measured;
    escapement::Input<Target> target;
    escapement::Output<Push> push;
    double gain, integral_time, damping, limit, integral = 0.0;

    explicit Pid(escapement::Setup &setup)
        : measured(setup, "measured"), target(setup, "target"), push(setup, "push"), gain(setup.number("gain", "N/m")),
          integral_time(setup.number("integral-time", "s")), damping(setup.number("damping", "N s/m")),
          limit(setup.number("limit", "N")) {
        setup.kind(escapement::sampled);
        if (limit < 0)
            setup.refuse("limit", "a limit is not negative");
    }
    void step(const escapement::Step &step) {
        double error = target->position - measured->position;
        double wanted = gain * (error + integral / integral_time) - damping * measured->velocity;
        push->force = std::clamp(wanted, -limit, limit);
        if (push->force == wanted)
            integral += step.period * error;
    }
    void state(escapement::State &state) { state(integral); }
};

struct Reference {
    escapement::Output<Target> target;
    double height, rise;

    explicit Reference(escapement::Setup &setup)
        : target(setup, "target"), height(setup.number("height", "m")), rise(setup.number("rise", "s")) {
        setup.kind(escapement::sampled);
    }
    void step(const escapement::Step &step) {
        double part = step.t < rise ? step.t / rise : 1.0;
        target->position = height * part * part * (3.0 - 2.0 * part);
    }
    void state(escapement::State &) {} // there is none
};

ESCAPEMENT_PARTICIPANT(plant, Plant, "1.0");
ESCAPEMENT_PARTICIPANT(pid, Pid, "1.0");
ESCAPEMENT_PARTICIPANT(reference, Reference, "1.0");
ESCAPEMENT_PLUGIN(&plant, &pid, &reference);

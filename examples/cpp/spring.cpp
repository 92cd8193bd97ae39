// A mass on a spring that its neighbour pulls along: examples/spring in C++. One source, a program and a plug-in.
#include <escapement.hpp>

struct Motion { double position, velocity; };
ESCAPEMENT_MESSAGE(Motion, ESCAPEMENT_FIELD(Motion, position, "m", "N"), ESCAPEMENT_FIELD(Motion, velocity, "m/s", "N"));

struct Spring {
    escapement::Input<Motion> neighbour;
    escapement::Output<Motion> motion;
    Motion mass{};

    explicit Spring(escapement::Setup &setup) : neighbour(setup, "neighbour"), motion(setup, "motion") {
        setup.kind(escapement::continuous);
        mass.position = setup.number("position"); // m
    }

    void initialise(double) { *motion = mass; }

    void step(const escapement::Step &step) {
        double acceleration = 5.0 * (neighbour->position - mass.position) - 40.0 * mass.position; // stiffness over mass, 1/s^2
        mass.velocity += step.period * acceleration;
        mass.position += step.period * mass.velocity;
        *motion = mass;
    }

    void state(escapement::State &state) { state(mass); }
};

ESCAPEMENT_PARTICIPANT(spring, Spring, "1.0");
ESCAPEMENT_PLUGIN(&spring);
ESCAPEMENT_MAIN(&spring);

// The operator of examples/tank in C++: drains a full tank and fills an empty one.
#include "escapement.hpp"

namespace {

enum class Valve : uint8_t { closed, filling, draining };

struct Gauge {
    double level;
    uint16_t pulses;
    int16_t change;
    bool full, empty;
    uint8_t padding[2];
};
ESCAPEMENT_MESSAGE(Gauge, ESCAPEMENT_FIELD(Gauge, level, "m", ""), ESCAPEMENT_FIELD(Gauge, pulses, "1", ""),
                   ESCAPEMENT_FIELD(Gauge, change, "um", ""), ESCAPEMENT_FIELD(Gauge, full, "1", ""),
                   ESCAPEMENT_FIELD(Gauge, empty, "1", ""), ESCAPEMENT_FIELD(Gauge, padding, "1", ""));

struct Order {
    Valve valve;
    bool seen_full;
};
ESCAPEMENT_MESSAGE(Order, ESCAPEMENT_ENUM_FIELD(Order, valve, "Closed = 0, Filling = 1, Draining = 2"),
                   ESCAPEMENT_FIELD(Order, seen_full, "1", ""));

struct Operator {
    escapement::Input<Gauge> gauge;
    escapement::Output<Order> output;
    Order order{};
    explicit Operator(escapement::Setup &setup) : gauge(setup, "gauge"), output(setup, "order") { setup.kind(escapement::sampled); }
    void step(const escapement::Step &) {
        if (gauge->full) {
            order = {Valve::draining, true};
        } else if (gauge->empty) {
            order.valve = Valve::filling;
        }
        *output = order;
    }
    void state(escapement::State &state) { state(order); }
};

} // namespace

ESCAPEMENT_PARTICIPANT(operator_, Operator, "1.0");
ESCAPEMENT_PLUGIN(&operator_);
ESCAPEMENT_MAIN(&operator_);

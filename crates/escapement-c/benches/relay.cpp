// The exchange of `escapement bench`, in C++: 27 doubles are read and forwarded. RELAY_KIND is the kind.
#include <escapement.hpp>

struct Parcel { double values[27]; };
ESCAPEMENT_MESSAGE(Parcel, ESCAPEMENT_FIELD(Parcel, values, "1", ""));

struct Relay {
    escapement::Input<Parcel> taken;
    escapement::Output<Parcel> given;

    explicit Relay(escapement::Setup &setup) : taken(setup, "from"), given(setup, "to") { setup.kind(RELAY_KIND); }

    void step(const escapement::Step &) {
        *given = *taken;
        given->values[0] += 1.0;
    }
};

ESCAPEMENT_PARTICIPANT(relay, Relay, "1.0");
ESCAPEMENT_MAIN(&relay);

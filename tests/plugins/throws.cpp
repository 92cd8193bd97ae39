// A participant whose step, or constructor, throws; and every kind of field and parameter.
#include <escapement.hpp>

#include <stdexcept>

struct Everything {
    double scalar;
    float singles[2];
    long long whole;
    int small[2];
    unsigned long large;
    unsigned int medium;
    unsigned char bytes[4];
    double matrix[2][3];
};
ESCAPEMENT_MESSAGE(Everything, ESCAPEMENT_FIELD(Everything, scalar, "m", "N"), ESCAPEMENT_FIELD(Everything, singles, "rad", ""),
                   ESCAPEMENT_FIELD(Everything, whole, "1", ""), ESCAPEMENT_FIELD(Everything, small, "1", ""),
                   ESCAPEMENT_FIELD(Everything, large, "1", ""), ESCAPEMENT_FIELD(Everything, medium, "1", ""),
                   ESCAPEMENT_FIELD(Everything, bytes, "1", ""), ESCAPEMENT_FIELD(Everything, matrix, "N m", "B"));

struct Throws {
    escapement::Input<Everything> input;
    escapement::Output<Everything> output;
    escapement::Host host;
    bool something;
    double at[2];

    explicit Throws(escapement::Setup &setup)
        : input(setup, "input", escapement::Connected::optional), output(setup, "output"), host(setup.host()),
          something(setup.flag_or("something", false)) {
        setup.kind(escapement::sampled);
        if (setup.flag_or("early", false))
            throw std::runtime_error("it cannot be made on a Tuesday");
        setup.numbers("pair", "m", at, 2);
        if (setup.integer_or("number", 3) != 3 || setup.text_or("word", "hello") != "hello")
            setup.refuse("number", "it is 3, and the word is hello");
    }
    void step(const escapement::Step &step) {
        output->scalar = host.uniform("noise", step.index);
        output->whole = input->whole;
        output->matrix[1][2] = at[1];
        if (step.index == 5 && something)
            throw 5;
        if (step.index == 5)
            throw std::runtime_error("the fifth step is one too many");
    }
};

ESCAPEMENT_PARTICIPANT(throws, Throws, "1.0");
ESCAPEMENT_PLUGIN(&throws);

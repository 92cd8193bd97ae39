// A struct that does not have the size of the message, and the reason.
#include <escapement-run.hpp>

#include <cstdio>

struct Position {
    double position;
};

struct Motion {
    double position, velocity;
};

int main(int argc, char **argv) {
    escapement::Run run(argc > 1 ? argv[1] : "");
    Position position{};
    Motion motion{};
    if (!run.to(0.5) || run.newest("mass.motion", position)) return 1;
    std::printf("%s\n", run.error());
    if (!run.newest("mass.motion", motion)) return 1;
    std::printf("then %s\n", *run.error() ? run.error() : "none");
    return 0;
}

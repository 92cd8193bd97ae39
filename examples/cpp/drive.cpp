// The same as examples/c/drive.c, in C++, with the same digest.
#include <escapement-run.hpp>

#include <cstdio>

struct Motion {
    double position, velocity;
};

static bool shake(escapement::Run &run, double end) {
    for (int step = static_cast<int>(run.now() * 100.0 + 0.5); step < static_cast<int>(end * 100.0 + 0.5); step++)
        if (!run.set("mass.neighbour", Motion{0.002 * (step % 50), 0.0}) || !run.to((step + 1) / 100.0)) return false;
    return true;
}

int main(int argc, char **argv) {
    escapement::Run run(argc > 1 ? argv[1] : "drive.toml");
    bool done = run && shake(run, 1.0);
    const escapement::RunCheckpoint half = done ? run.save() : escapement::RunCheckpoint{};
    done = done && half && shake(run, 1.7) && run.restore(half) && shake(run, 2.0);
    Motion motion{};
    double stamp = 0.0, farthest = 0.0;
    escapement_run_outcome outcome{};
    done = done && run.newest("mass.motion", motion, &stamp) && run.figure("farthest", farthest) && run.end(outcome);
    if (!done) {
        std::fprintf(stderr, "error: %s\n", run.error());
        return 1;
    }
    std::printf("t = %g s: position %.17g m\n", stamp, motion.position);
    std::printf("farthest %.17g m, complete %u, digest %s\n", farthest, static_cast<unsigned>(outcome.complete), outcome.digest);
    return 0;
}

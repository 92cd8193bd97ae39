// Runs from C++17, over escapement-run.h. Header only; works with and without exceptions: nothing here throws.
//
//     escapement::Run run("drive.toml");
//     run.set("mass.neighbour", Motion{0.1, 0.0});
//     if (!run.to(0.5)) std::puts(run.error());
//     Motion motion;
//     run.newest("mass.motion", motion);
//
// A call returns true, or false on failure; run.error() then returns the reason. A run that goes out of scope is discarded.
#ifndef ESCAPEMENT_RUN_HPP
#define ESCAPEMENT_RUN_HPP

#include <cstddef>
#include <cstring>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "escapement-run.h"

namespace escapement {

// What is recorded of a run, and changes of its scenario.
struct RunOptions {
    uint32_t record = ESCAPEMENT_RECORD_MEMORY;
    std::string folder; // for ESCAPEMENT_RECORD_FOLDER; if empty, a new one below runs/
    std::vector<std::string> changes;
};

// The state of a run at an instant.
class RunCheckpoint {
    struct Free {
        void operator()(escapement_run_checkpoint *own) const { escapement_run_checkpoint_free(own); }
    };
    std::unique_ptr<escapement_run_checkpoint, Free> own;
    friend class Run;

  public:
    explicit operator bool() const { return own != nullptr; }
};

class Run {
    struct Free {
        void operator()(escapement_run *own) const { escapement_run_free(own); }
    };
    std::unique_ptr<escapement_run, Free> own;
    bool started = false;
    // A reason of the wrapper itself, until the next call.
    mutable std::string own_error;

    bool copied(escapement_run_status status, const char *port, const escapement_run_sample &sample, void *message, size_t size) {
        if (!done(status)) return false;
        if (sample.byte_count == size) {
            std::memcpy(message, sample.bytes, size);
            return true;
        }
        own_error = std::string("`") + port + "` has " + std::to_string(sample.byte_count) + " bytes, and the struct has "
                    + std::to_string(size) + ": declare its fields as the message does";
        return false;
    }

    bool done(escapement_run_status status) const {
        own_error.clear();
        return status == ESCAPEMENT_RUN_OK;
    }

  public:
    explicit Run(const std::string &scenario, const RunOptions &options = {}) {
        std::vector<const char *> changes;
        for (const std::string &change : options.changes) changes.push_back(change.c_str());
        escapement_run_options given{};
        given.size = sizeof given;
        given.record = options.record;
        given.folder = options.folder.empty() ? nullptr : options.folder.c_str();
        given.changes = changes.data();
        given.change_count = static_cast<uint32_t>(changes.size());
        escapement_run *run = nullptr;
        started = done(escapement_run_start(scenario.c_str(), &given, &run));
        own.reset(run);
    }

    // Whether the run could be started.
    explicit operator bool() const { return started; }
    // Why the last failed call failed; owned by the run.
    const char *error() const { return own_error.empty() ? escapement_run_error(own.get()) : own_error.c_str(); }
    double now() const { return escapement_run_now(own.get()); }
    bool is_over() const { return escapement_run_is_over(own.get()) != 0; }
    bool to(double time) { return done(escapement_run_to(own.get(), time)); }
    bool step() { return done(escapement_run_step(own.get())); }

    // Advances the run until `participant` is about to step; false when the run fails, or has reached its end.
    bool to_step(const char *participant) {
        uint32_t reached = 0;
        return done(escapement_run_to_step(own.get(), participant, &reached)) && reached != 0;
    }

    // The sample that "PARTICIPANT.INPUT" has in that activation.
    template <class Message> bool read_input(const char *port, Message &message) {
        static_assert(std::is_trivially_copyable<Message>::value, "a message is a plain struct");
        escapement_run_sample sample{};
        sample.size = sizeof sample;
        return copied(escapement_run_read_input(own.get(), port, &sample), port, sample, &message, sizeof message);
    }

    // Sets "PARTICIPANT.OUTPUT" for that activation instead of a step of the participant.
    template <class Message> bool set_output(const char *port, const Message &message) {
        static_assert(std::is_trivially_copyable<Message>::value, "a message is a plain struct");
        return done(escapement_run_set_output(own.get(), port, &message, sizeof message));
    }

    // The newest sample of "PARTICIPANT.OUTPUT" as a plain struct of the same size.
    template <class Message> bool newest(const char *port, Message &message, double *stamp = nullptr) {
        static_assert(std::is_trivially_copyable<Message>::value, "a message is a plain struct");
        escapement_run_sample sample{};
        sample.size = sizeof sample;
        if (!copied(escapement_run_newest(own.get(), port, &sample), port, sample, &message, sizeof message)) return false;
        if (stamp) *stamp = sample.stamp;
        return true;
    }

    bool field(const char *port, const char *field, double *values, uint32_t count = 1) {
        return done(escapement_run_field(own.get(), port, field, values, count));
    }

    // Sets the unconnected input "PARTICIPANT.INPUT".
    template <class Message> bool set(const char *port, const Message &message) {
        static_assert(std::is_trivially_copyable<Message>::value, "a message is a plain struct");
        return done(escapement_run_set(own.get(), port, &message, sizeof message));
    }

    // The log of a participant so far; empty if there is no run, or no such participant.
    std::string log(const char *participant) {
        const char *lines = escapement_run_log(own.get(), participant);
        return lines ? lines : "";
    }

    bool figure(const char *name, double &value) { return done(escapement_run_figure(own.get(), name, &value)); }

    // The state; the checkpoint converts to false if the state cannot be saved.
    RunCheckpoint save() {
        escapement_run_checkpoint *checkpoint = nullptr;
        RunCheckpoint kept;
        if (done(escapement_run_save(own.get(), &checkpoint))) kept.own.reset(checkpoint);
        return kept;
    }

    bool restore(const RunCheckpoint &checkpoint) { return done(escapement_run_restore(own.get(), checkpoint.own.get())); }

    // Ends the run at its present time.
    bool end(escapement_run_outcome &outcome) {
        outcome.size = sizeof outcome;
        return done(escapement_run_end(own.get(), &outcome));
    }
};

} // namespace escapement

#endif

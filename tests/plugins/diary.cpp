// The participant of tests/src/diary.rs in C++.
#include <escapement.hpp>

struct Page { uint64_t number; };
ESCAPEMENT_MESSAGE(Page, ESCAPEMENT_FIELD(Page, number, "1", ""));

struct Diary {
    escapement::Host host;
    escapement::Output<Page> output;
    int64_t fails_at;
    Page page{};

    explicit Diary(escapement::Setup &setup) : host(setup.host()), output(setup, "page"), fails_at(setup.integer_or("fails-at", -1)) {
        setup.kind(escapement::sampled);
    }

    void initialise(double) { host.log("begins"); }

    escapement_status step(const escapement::Step &step) {
        page.number++;
        *output = page;
        if (step.index == 2) host.log("is at page " + std::to_string(page.number));
        return static_cast<int64_t>(step.index) == fails_at ? host.fail("has no more pages") : ESCAPEMENT_OK;
    }

    void terminate(escapement::Termination why) {
        const char *word = why == escapement::Termination::finished  ? "finished"
                           : why == escapement::Termination::stopped ? "stopped"
                                                                     : "replaced";
        host.log(std::string("ends, ") + word + ", at page " + std::to_string(page.number));
    }

    void state(escapement::State &state) { state(page); }
};

ESCAPEMENT_PARTICIPANT(diary, Diary, "1.0");
ESCAPEMENT_PLUGIN(&diary);
ESCAPEMENT_MAIN(&diary);

// A participant of a co-simulation in C++17, over the C ABI of escapement.h. Header only; works with and without exceptions.
//
//     struct Motion { double position, velocity; };
//     ESCAPEMENT_MESSAGE(Motion, ESCAPEMENT_FIELD(Motion, position, "m", "N"), ESCAPEMENT_FIELD(Motion, velocity, "m/s", "N"));
//
//     struct Spring {
//         escapement::Input<Motion> neighbour;
//         escapement::Output<Motion> motion;
//         Motion mass{};
//         explicit Spring(escapement::Setup &setup);           // declares the kind and the ports, reads the parameters
//         void initialise(double t);                           // optional
//         void step(const escapement::Step &step);             // or returns escapement_status
//         void terminate(escapement::Termination why);         // called once, when the participant ends; optional
//         void state(escapement::State &state) { state(mass); } // saved and restored; optional
//     };
//     ESCAPEMENT_PARTICIPANT(spring, Spring, "1.0");
//     ESCAPEMENT_PLUGIN(&spring);
//     ESCAPEMENT_MAIN(&spring);
//
// An exception that leaves the constructor or a function becomes the participant's failure, with what() as the reason. Without exceptions,
// a step returns host.fail("…").
#ifndef ESCAPEMENT_HPP
#define ESCAPEMENT_HPP

#include <cstring>
#include <new>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "escapement.h"

#if defined(__cpp_exceptions)
#include <exception>
#define ESCAPEMENT_TRY_ try
#define ESCAPEMENT_CATCH_(host)                                                                                                \
    catch (const std::exception &error) {                                                                                      \
        return (host)->fail((host), error.what());                                                                             \
    }                                                                                                                          \
    catch (...) {                                                                                                              \
        return (host)->fail((host), "it threw something that is no std::exception");                                           \
    }
#else
#define ESCAPEMENT_TRY_
#define ESCAPEMENT_CATCH_(host)
#endif

namespace escapement {

using Step = escapement_step;

// Why a participant ends: it has executed all of its activations; the run ends earlier; another participant replaces it.
enum class Termination : uint32_t { finished = ESCAPEMENT_FINISHED, stopped = ESCAPEMENT_STOPPED, replaced = ESCAPEMENT_REPLACED };

constexpr uint32_t sampled = ESCAPEMENT_SAMPLED;
constexpr uint32_t continuous = ESCAPEMENT_CONTINUOUS;

namespace detail {

template <class T> struct Element;
template <> struct Element<double> { static constexpr uint32_t value = ESCAPEMENT_F64; };
template <> struct Element<float> { static constexpr uint32_t value = ESCAPEMENT_F32; };
template <> struct Element<long> { static constexpr uint32_t value = ESCAPEMENT_I64; };
template <> struct Element<long long> { static constexpr uint32_t value = ESCAPEMENT_I64; };
template <> struct Element<int> { static constexpr uint32_t value = ESCAPEMENT_I32; };
template <> struct Element<unsigned long> { static constexpr uint32_t value = ESCAPEMENT_U64; };
template <> struct Element<unsigned long long> { static constexpr uint32_t value = ESCAPEMENT_U64; };
template <> struct Element<unsigned> { static constexpr uint32_t value = ESCAPEMENT_U32; };
template <> struct Element<unsigned char> { static constexpr uint32_t value = ESCAPEMENT_U8; };
template <> struct Element<signed char> { static constexpr uint32_t value = ESCAPEMENT_I8; };
template <> struct Element<short> { static constexpr uint32_t value = ESCAPEMENT_I16; };
template <> struct Element<unsigned short> { static constexpr uint32_t value = ESCAPEMENT_U16; };
template <> struct Element<bool> { static constexpr uint32_t value = ESCAPEMENT_BOOL; };

template <class T, std::size_t... I>
constexpr escapement_field field(const char *name, const char *unit, const char *frame, std::size_t offset, std::index_sequence<I...>) {
    static_assert(sizeof...(I) <= ESCAPEMENT_RANK_MAX, "a field has at most four extents");
    return {name, unit, frame, Element<std::remove_all_extents_t<T>>::value, static_cast<uint32_t>(offset),
            static_cast<uint32_t>(sizeof...(I)), {static_cast<uint32_t>(std::extent_v<T, I>)...}};
}

template <class T> constexpr escapement_field field(const char *name, const char *unit, const char *frame, std::size_t offset) {
    return field<T>(name, unit, frame, offset, std::make_index_sequence<std::rank_v<T>>{});
}

} // namespace detail

namespace detail {

// The `unit` of an enumeration holds its values.
template <class T> constexpr escapement_field named(const char *name, const char *values, std::size_t offset) {
    using One = std::remove_all_extents_t<T>;
    static_assert(sizeof(One) == 1 && (std::is_enum_v<One> || std::is_same_v<One, unsigned char>),
                  "an enumeration has one byte: enum class Mode : uint8_t");
    using Bytes = std::conditional_t<std::is_array_v<T>, unsigned char[std::extent_v<T> ? std::extent_v<T> : 1], unsigned char>;
    static_assert(std::rank_v<T> <= 1, "a list of values has one extent");
    escapement_field made = field<Bytes>(name, values, "", offset);
    made.element = ESCAPEMENT_ENUM;
    return made;
}

// The last extent of a text and of bytes is their capacity.
template <class T> constexpr escapement_field text(const char *name, std::size_t offset) {
    static_assert(std::is_array_v<T> && std::is_same_v<std::remove_all_extents_t<T>, char>, "a text is an array of char");
    escapement_field made = field<unsigned char[sizeof(T)]>(name, "1", "", offset);
    made.element = ESCAPEMENT_TEXT;
    return made;
}

template <class T> constexpr escapement_field bytes(const char *name, std::size_t offset) {
    static_assert(sizeof(T) > 4, "bytes are a struct of their number, a uint32_t, and an array");
    escapement_field made = field<unsigned char[sizeof(T) - 4]>(name, "1", "", offset);
    made.element = ESCAPEMENT_BYTES;
    return made;
}

} // namespace detail

// The services of the program that runs the participant which are available at any time.
class Host {
  public:
    explicit Host(const escapement_host *host) : host_(host) {}
    const char *name() const { return host_->name; }
    uint64_t seed() const { return host_->seed; }
    double period() const { return host_->period; } // s
    double offset() const { return host_->offset; } // s
    // Reports why the current call fails. The caller returns its result.
    escapement_status fail(const std::string &reason) const { return host_->fail(host_, reason.c_str()); }
    // In `initialise`, `step` and `terminate`: writes a line with the simulated time to the log.
    void log(const std::string &text) const { host_->log(host_, text.c_str()); }
    // Sample number `index` of the random stream `stream`: uniform in [0, 1), or standard normal.
    double uniform(const char *stream, uint64_t index) const { return host_->uniform(host_, stream, index); }
    double normal(const char *stream, uint64_t index) const { return host_->normal(host_, stream, index); }

  protected:
    const escapement_host *host_;
};

// The argument of a participant's constructor. The host remembers rejected parameters and rejects the participant when the constructor
// returns; so no status need be checked.
class Setup : public Host {
  public:
    using Host::Host;
    Host host() const { return *this; } // for the participant to keep
    void kind(uint32_t kind) { host_->kind(host_, kind); }
    // A number in `unit`: the scenario has a string with any unit of the same dimension; without a unit, a plain number.
    double number(const char *key, const char *unit = "1") { return numbers_of(key, unit, 1, 0.0); }
    double number_or(const char *key, const char *unit, double otherwise) { return numbers_of(key, unit, 0, otherwise); }
    void numbers(const char *key, const char *unit, double *values, uint32_t count) {
        host_->numbers(host_, key, unit, 1, values, count);
    }
    int64_t integer(const char *key) {
        int64_t value = 0;
        host_->integer(host_, key, 1, &value);
        return value;
    }
    int64_t integer_or(const char *key, int64_t otherwise) {
        host_->integer(host_, key, 0, &otherwise);
        return otherwise;
    }
    bool flag(const char *key) {
        uint8_t value = 0;
        host_->flag(host_, key, 1, &value);
        return value != 0;
    }
    bool flag_or(const char *key, bool otherwise) {
        uint8_t value = otherwise;
        host_->flag(host_, key, 0, &value);
        return value != 0;
    }
    std::string text(const char *key) {
        const char *value = "";
        host_->text(host_, key, 1, &value);
        return value;
    }
    std::string text_or(const char *key, const char *otherwise) {
        host_->text(host_, key, 0, &otherwise);
        return otherwise;
    }
    // All parameters as a TOML document.
    const char *parameters() { return host_->parameters(host_); }
    void refuse(const char *key, const std::string &reason) { host_->refuse(host_, key, reason.c_str()); }

  private:
    template <class T> friend class Input;
    template <class T> friend class Output;
    template <class T> friend struct Table;
    Setup(const escapement_host *host, std::vector<const void **> *inputs, std::vector<void **> *outputs)
        : Host(host), inputs_(inputs), outputs_(outputs) {}
    double numbers_of(const char *key, const char *unit, uint32_t required, double value) {
        host_->numbers(host_, key, unit, required, &value, 0);
        return value;
    }
    std::vector<const void **> *inputs_ = nullptr;
    std::vector<void **> *outputs_ = nullptr;
};

enum class Connected : uint32_t { optional = 0, required = 1 };

// An input, read in `step`. It can be neither copied nor moved.
template <class T> class Input {
  public:
    Input(Setup &setup, const char *name, Connected connected = Connected::required) {
        setup.host_->input(setup.host_, name, &escapement_describe(static_cast<const T *>(nullptr)), static_cast<uint32_t>(connected));
        setup.inputs_->push_back(&at_);
    }
    Input(const Input &) = delete;
    Input &operator=(const Input &) = delete;
    const T &operator*() const { return *static_cast<const T *>(at_); }
    const T *operator->() const { return static_cast<const T *>(at_); }

  private:
    const void *at_ = nullptr;
};

// An output, written in `initialise` and `step`. An output that is not written keeps its last value.
template <class T> class Output {
  public:
    Output(Setup &setup, const char *name) : host_(setup.host_), number_(static_cast<uint32_t>(setup.outputs_->size())) {
        setup.host_->output(setup.host_, name, &escapement_describe(static_cast<const T *>(nullptr)));
        setup.outputs_->push_back(&at_);
    }
    Output(const Output &) = delete;
    Output &operator=(const Output &) = delete;
    T &operator*() const { return *static_cast<T *>(at_); }
    T *operator->() const { return static_cast<T *>(at_); }
    // Whether the sample now being written is seen, and whether any sample of the output is seen in this run. An unseen sample need not be computed.
    bool is_seen() const { return escapement_is_seen(host_, number_) != 0; }
    bool is_ever_seen() const { return escapement_is_ever_seen(host_, number_) != 0; }

  private:
    const escapement_host *host_;
    uint32_t number_;
    void *at_ = nullptr;
};

// A serialiser of the state: `state(first, second)` saves or restores its arguments in this order. Plain values and vectors of them.
class State {
  public:
    // A copy would be filled and thrown away: `state` takes a reference.
    State(const State &) = delete;
    State &operator=(const State &) = delete;
    template <class... T> void operator()(T &...values) { (one(values), ...); }

  private:
    template <class T> friend struct Table;
    State() = default;
    State(const void *bytes, uint64_t size) : from_(static_cast<const char *>(bytes)), left_(size), saves_(false) {}

    template <class T> void one(T &value) {
        static_assert(std::is_trivially_copyable_v<T>, "a state is made of plain values and vectors of them");
        move(&value, sizeof value);
    }
    template <class T> void one(std::vector<T> &values) {
        static_assert(std::is_trivially_copyable_v<T>, "a state is made of plain values and vectors of them");
        uint64_t count = values.size();
        move(&count, sizeof count);
        if (!saves_ && (bad_ || count > left_ / sizeof(T))) {
            bad_ = true;
            return;
        }
        values.resize(count);
        move(values.data(), count * sizeof(T));
    }
    void move(void *at, std::size_t size) {
        if (size == 0)
            return;
        if (saves_) {
            const char *bytes = static_cast<const char *>(at);
            to_.insert(to_.end(), bytes, bytes + size);
        } else if (bad_ || left_ < size) {
            bad_ = true;
        } else {
            std::memcpy(at, from_, size);
            from_ += size;
            left_ -= size;
        }
    }
    std::vector<char> to_;
    const char *from_ = nullptr;
    uint64_t left_ = 0;
    bool saves_ = true;
    bool bad_ = false;
};

// The function table of the class T.
template <class T> struct Table {
    static constexpr escapement_participant of(const char *name, const char *version) {
        static_assert(has_state<T>(0) || !state_function<T>(0),
                      "`state` of the participant cannot be called as it must be: void state(escapement::State &state)");
        static_assert(has_start<T>(0) || !start_function<T>(0),
                      "`initialise` of the participant cannot be called as it must be: void initialise(double t)");
        static_assert(has_end<T>(0) || !end_function<T>(0),
                      "`terminate` of the participant cannot be called as it must be: void terminate(escapement::Termination why)");
        escapement_participant table{};
        table.size = sizeof table;
        table.abi = ESCAPEMENT_ABI;
        table.name = name;
        table.version = version;
        table.describe = describe;
        table.initialise = initialise;
        table.step = step;
        if constexpr (has_state<T>(0)) {
            table.save = save;
            table.restore = restore;
        }
        table.terminate = terminate;
        return table;
    }

  private:
    // The participant, and the pointers to its ports.
    struct Own {
        std::vector<const void **> inputs;
        std::vector<void **> outputs;
        Setup setup;
        T participant;
        explicit Own(const escapement_host *host) : setup(host, &inputs, &outputs), participant(setup) {}
        void point(const void *const *from, void *const *to) {
            for (std::size_t port = 0; from && port < inputs.size(); ++port)
                *inputs[port] = from[port];
            for (std::size_t port = 0; port < outputs.size(); ++port)
                *outputs[port] = to[port];
        }
    };

    template <class U> static constexpr auto has_state(int) -> decltype(std::declval<U &>().state(std::declval<State &>()), true) {
        return true;
    }
    template <class U> static constexpr bool has_state(...) { return false; }
    template <class U> static constexpr auto has_start(int) -> decltype(std::declval<U &>().initialise(0.0), true) { return true; }
    template <class U> static constexpr bool has_start(...) { return false; }

    template <class U> static constexpr auto has_end(int) -> decltype(std::declval<U &>().terminate(Termination::stopped), true) {
        return true;
    }
    template <class U> static constexpr bool has_end(...) { return false; }

    // Whether the class has a function with the name of an optional one, whatever its arguments. A member that is data has another meaning.
    template <class M> static constexpr bool function = std::is_member_function_pointer_v<M> || std::is_function_v<std::remove_pointer_t<M>>;
    template <class U> static constexpr auto state_function(int) -> decltype(&U::state, true) { return function<decltype(&U::state)>; }
    template <class U> static constexpr bool state_function(...) { return false; }
    template <class U> static constexpr auto start_function(int) -> decltype(&U::initialise, true) {
        return function<decltype(&U::initialise)>;
    }
    template <class U> static constexpr bool start_function(...) { return false; }
    template <class U> static constexpr auto end_function(int) -> decltype(&U::terminate, true) {
        return function<decltype(&U::terminate)>;
    }
    template <class U> static constexpr bool end_function(...) { return false; }

    static escapement_status describe(const escapement_host *host, void **own) {
        ESCAPEMENT_TRY_ {
            Own *made = new (std::nothrow) Own(host);
            *own = made;
            return made ? ESCAPEMENT_OK : host->fail(host, "there is no memory for the participant");
        }
        ESCAPEMENT_CATCH_(host)
    }

    static escapement_status initialise(const escapement_host *host, void *own, double t, void *const *outputs) {
        ESCAPEMENT_TRY_ {
            Own &self = *static_cast<Own *>(own);
            self.point(nullptr, outputs);
            if constexpr (has_start<T>(0)) {
                if constexpr (std::is_void_v<decltype(self.participant.initialise(t))>) {
                    self.participant.initialise(t);
                } else {
                    return self.participant.initialise(t);
                }
            }
            (void)host;
            (void)t;
            return ESCAPEMENT_OK;
        }
        ESCAPEMENT_CATCH_(host)
    }

    static escapement_status step(const escapement_host *host, void *own, const escapement_step *step, const void *const *inputs,
                                  void *const *outputs) {
        ESCAPEMENT_TRY_ {
            Own &self = *static_cast<Own *>(own);
            self.point(inputs, outputs);
            (void)host;
            if constexpr (std::is_void_v<decltype(self.participant.step(*step))>) {
                self.participant.step(*step);
                return ESCAPEMENT_OK;
            } else {
                return self.participant.step(*step);
            }
        }
        ESCAPEMENT_CATCH_(host)
    }

    static escapement_status save(const escapement_host *host, void *own) {
        ESCAPEMENT_TRY_ {
            State state;
            static_cast<Own *>(own)->participant.state(state);
            return host->state(host, state.to_.data(), state.to_.size());
        }
        ESCAPEMENT_CATCH_(host)
    }

    static escapement_status restore(const escapement_host *host, void *own, const void *bytes, uint64_t size) {
        ESCAPEMENT_TRY_ {
            State state(bytes, size);
            static_cast<Own *>(own)->participant.state(state);
            if (state.bad_ || state.left_ != 0) {
                const std::string reason = "the state has " + std::to_string(size) + " bytes, which is not what `state` reads";
                return host->fail(host, reason.c_str());
            }
            return ESCAPEMENT_OK;
        }
        ESCAPEMENT_CATCH_(host)
    }

    static escapement_status told(const escapement_host *host, Own &self) {
        ESCAPEMENT_TRY_ {
            (void)self;
            if constexpr (has_end<T>(0)) {
                // Not called for a participant that was loaded only to query its ports.
                if (const uint32_t why = escapement_termination(host))
                    self.participant.terminate(static_cast<Termination>(why));
            }
            (void)host;
            return ESCAPEMENT_OK;
        }
        ESCAPEMENT_CATCH_(host)
    }

    static void terminate(const escapement_host *host, void *own) {
        Own *self = static_cast<Own *>(own);
        // A failure here is only logged: nothing depends on it any more.
        (void)told(host, *self);
        delete self;
    }
};

} // namespace escapement

// The message type of a struct, defined in the namespace of the struct, with the name of the struct.
#define ESCAPEMENT_MESSAGE(type, ...)                                                                                          \
    inline const escapement_message &escapement_describe(const type *) {                                                       \
        static_assert(std::is_trivially_copyable_v<type> && std::is_standard_layout_v<type>, "a message is a plain struct");   \
        static constexpr escapement_field fields[] = {__VA_ARGS__};                                                            \
        static constexpr escapement_message message = {#type, fields, sizeof fields / sizeof fields[0], sizeof(type)};         \
        return message;                                                                                                        \
    }                                                                                                                          \
    static_assert(true, "")

// A field: a number, a bool, or an array of them with up to four extents.
#define ESCAPEMENT_FIELD(type, field_, unit, frame)                                                                            \
    ::escapement::detail::field<decltype(type::field_)>(#field_, unit, frame, offsetof(type, field_))
// An enumeration, or a list of values: enum class Valve : uint8_t { closed, open }; … ESCAPEMENT_ENUM_FIELD(Tank, valve, "closed = 0, open = 1")
#define ESCAPEMENT_ENUM_FIELD(type, field_, values)                                                                            \
    ::escapement::detail::named<decltype(type::field_)>(#field_, values, offsetof(type, field_))
// A text, char phase[16], and bytes, struct { uint32_t length; uint8_t data[64]; } frame
#define ESCAPEMENT_TEXT_FIELD(type, field_) ::escapement::detail::text<decltype(type::field_)>(#field_, offsetof(type, field_))
#define ESCAPEMENT_BYTES_FIELD(type, field_) ::escapement::detail::bytes<decltype(type::field_)>(#field_, offsetof(type, field_))
#define ESCAPEMENT_MATRIX(type, field_, unit, frame) ESCAPEMENT_FIELD(type, field_, unit, frame)

// The function table of a class, under the participant's name in scenarios.
#define ESCAPEMENT_PARTICIPANT(name, type, version)                                                                            \
    static const escapement_participant name = ::escapement::Table<type>::of(#name, version)

// Makes a plug-in of the participants whose tables are given: ESCAPEMENT_PLUGIN(&first, &second)
#define ESCAPEMENT_PLUGIN(...)                                                                                                 \
    extern "C" const escapement_participant *escapement_plugin(uint32_t index) {                                               \
        static const escapement_participant *const all[] = {__VA_ARGS__};                                                      \
        return index < sizeof all / sizeof all[0] ? all[index] : nullptr;                                                      \
    }                                                                                                                          \
    static_assert(true, "")

#endif

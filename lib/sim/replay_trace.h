/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* tests.csv and events.csv of a trace folder, and what the names in them mean. */
#ifndef SIM_REPLAY_TRACE_H
#define SIM_REPLAY_TRACE_H

#include "replay.h"
#include "replay_csv.h"

#define REPLAY_MAX_TESTS  10000u
#define REPLAY_MAX_EVENTS 4000000u
#define REPLAY_MAX_TIME   100000000 /* clocks or nanoseconds */
#define REPLAY_PARTS      100       /* hundredths of a clock may follow the point of a time */

struct replay_event {
    int64_t at; /* clock, or nanosecond when the trace has them */
    const char *name, *value;
    unsigned line;
    char kind;          /* I W R E N J # */
    unsigned char part; /* of a clock, in hundredths */
};

struct replay_test {
    const char *name, *description;
    size_t first, count; /* its events */
};

struct replay_trace {
    bool in_ns; /* the time column is "ns", not "clk" */
    struct replay_test *tests;
    size_t test_count;
    struct replay_event *events;
    size_t event_count;
};

/* Strings stay in the texts, which must outlive the trace. */
int HM2_MUST_CHECK replay_trace_parse(struct replay_trace *trace, char *tests, size_t tests_len, char *events,
                                      size_t events_len, struct hm2_diag *diag);
void replay_trace_free(struct replay_trace *trace);

/* Events made by the player itself. */
struct replay_event_list {
    struct replay_event *events;
    size_t count;
};

int HM2_MUST_CHECK replay_event_add(struct replay_event_list *list, const struct replay_event *event);
/* A trace of one test: its own events with those of the list between them, in order of time. */
int HM2_MUST_CHECK replay_trace_merge(struct replay_trace *merged, const struct replay_trace *trace,
                                      const struct replay_test *test, struct replay_event_list *list);

/* ---- meaning of names ------------------------------------------------------------------------------------------- */

/* A register name: exactly this name, or this name followed by an instance number. */
struct replay_register {
    const char *name;
    uint16_t address;
    uint16_t stride; /* bytes from instance to instance; 0 = no instances */
};

enum replay_signal_kind { REPLAY_PAD, REPLAY_INPUT, REPLAY_OUTPUT };

/* An input or output: a pad (number = pad), or a module's own pin (number = unit). first = number that a name
 * without one has. */
struct replay_signal {
    const char *name;
    enum replay_signal_kind kind;
    uint8_t gtag, secondary_pin;
    unsigned first;
};

/* A sampled vector: its elements left to right, either consecutive pads or a list of outputs. */
struct replay_vector {
    const char *name;
    const struct replay_signal *elements; /* NULL = pads from 0 on */
    unsigned count;
    bool before_edge; /* sampled before edge clk instead of after it */
};

struct replay_run;

struct replay_kind {
    const char *folder;         /* base name */
    const char *firmware;       /* pin package */
    const char *timer_firmware; /* of tests that begin with "timer_"; NULL = the same */
    const char *profile;        /* card */
    enum sim_sources sources;
    const struct replay_register *registers;
    const struct replay_signal *signals;
    const struct replay_vector *vectors;
    /* Everything outside before a test: pull-ups, inputs at rest. May be NULL. */
    int (*prepare)(struct replay_run *run);
    /* What registers of the firmware held at the start of a test, and no event tells: prepare() sets one of so many
     * possibilities, run->start, and one of them must match. 0 is power-up. */
    unsigned starts;
    /* Stimuli that the recording bench applied without an event of their own. May be NULL. Called with each event
     * before it is played. */
    int (*before_event)(struct replay_run *run, const struct replay_event *event);
    /* Input events that the recording does not have but its other events tell. May be NULL. */
    int (*make_inputs)(const struct replay_trace *trace, const struct replay_test *test, struct replay_event_list *out);
    /* What the bench did at the edges of outputs that prepare() watches. May be NULL. */
    void (*on_edge)(struct replay_run *run, int64_t clk, unsigned watch, enum sim_level level);
    /* Registers that are compared with a tolerance, and an output of the bench itself, which it compares. NULL = none.
     */
    bool (*near)(const struct replay_event *event, uint32_t expected, uint32_t got);
    const char *bench_output;
    uint8_t loop_gtag; /* module whose output the bench led back to its input */
    /* The recording of output edges ends somewhere: edges after the last recorded one are not compared. */
    bool edges_end_early;
    /* Whole folder in another way than tests.csv and events.csv; runs in addition when those exist. May be NULL. */
    int (*extra)(const struct replay_kind *kind, const struct replay_files *files, const struct replay_options *options,
                 struct replay_totals *totals, struct hm2_diag *diag);
    bool no_events; /* only extra */
};

extern const struct replay_kind replay_kinds[];
extern const unsigned replay_kind_count;

/* Address of a register by name; "0x3000" names an address itself. */
bool replay_find_register(const struct replay_kind *kind, const char *name, uint16_t *address);
/* Signal by name. *number gets pad or unit. */
const struct replay_signal *replay_find_signal(const struct replay_kind *kind, const char *name, bool driven_by_card,
                                               unsigned *number);

/* ---- one test being played --------------------------------------------------------------------------------------- */

#define REPLAY_MAX_WATCHES 64u
#define REPLAY_BENCH_PINS  3u
#define REPLAY_TEXT        256u

struct replay_watch {
    const char *name;
    int number; /* of the card's watch */
    bool settled;
    enum sim_level level;
    const size_t *edges; /* indices of the expected edges, those of the first moment left out */
    size_t edge_count, next;
    enum sim_level initial;
    bool has_initial;
};

/* Two low-pass filters, one behind the other, as they were at `clk`. */
struct replay_filter {
    int64_t clk;
    double in, first, second;
};

struct replay_run {
    const struct replay_kind *kind;
    const struct replay_trace *trace;
    const struct replay_test *test;
    unsigned start;
    struct sim_card *card;
    size_t edges_seen;
    int64_t first_edge; /* time from which edges are compared */
    struct replay_watch watches[REPLAY_MAX_WATCHES];
    unsigned watch_count;
    size_t *edge_indices;
    int vector_watches[REPLAY_MAX_WATCHES]; /* element by element, vectors in the order of the kind's table */
    uint64_t state[8];                      /* for before_event: zero at the start of a test */
    int bench_watch[REPLAY_BENCH_PINS];     /* for prepare and on_edge */
    enum sim_level bench_level[REPLAY_BENCH_PINS];
    struct replay_filter filter;
    char difference[REPLAY_TEXT];
};

/* Note the first difference of a test; later ones are dropped. */
void replay_differs(struct replay_run *run, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* Play one test on a fresh card: the difference, or "" in run->difference. An error means it could not be played. */
int HM2_MUST_CHECK replay_play(struct replay_run *run, struct hm2_diag *diag);
/* Edge of ClockLow that a time of the trace belongs to. */
int64_t replay_clk(const struct replay_run *run, int64_t at);
enum sim_level replay_level(char c, bool *valid);

int replay_idrom(const struct replay_kind *kind, const struct replay_files *files, const struct replay_options *options,
                 struct replay_totals *totals, struct hm2_diag *diag);
int replay_tram(const struct replay_kind *kind, const struct replay_files *files, const struct replay_options *options,
                struct replay_totals *totals, struct hm2_diag *diag);
int replay_lbp16(const struct replay_kind *kind, const struct replay_files *files, const struct replay_options *options,
                 struct replay_totals *totals, struct hm2_diag *diag);
int replay_pwm_measure(const struct replay_kind *kind, const struct replay_files *files,
                       const struct replay_options *options, struct replay_totals *totals, struct hm2_diag *diag);
int replay_pin_truth(const struct replay_kind *kind, const struct replay_files *files,
                     const struct replay_options *options, struct replay_totals *totals, struct hm2_diag *diag);

/* Absolute encoders of the benches, for tests whose recording leaves out what they did. */
int replay_absolute_prepare(struct replay_run *run);
int replay_absolute_event(struct replay_run *run, const struct replay_event *event);

int replay_muxed_inputs(const struct replay_trace *trace, const struct replay_test *test,
                        struct replay_event_list *out);

int replay_sslbp_prepare(struct replay_run *run);
int replay_sslbp_event(struct replay_run *run, const struct replay_event *event);
int replay_sslbp_polls(const struct replay_trace *trace, const struct replay_test *test, struct replay_event_list *out);
/* Benches of the SPI recordings. */
int replay_spi_prepare(struct replay_run *run);
void replay_spi_edge(struct replay_run *run, int64_t clk, unsigned watch, enum sim_level level);
int replay_spi_word(struct replay_run *run, const struct replay_event *event);

/* Waveform generators in the middle of their pulses. */
#define REPLAY_WAVEGEN_STARTS 128u
int replay_wavegen_prepare(struct replay_run *run);

/* Bench of the resolver recordings. */
int replay_resolver_prepare(struct replay_run *run);
int replay_resolver_event(struct replay_run *run, const struct replay_event *event);
void replay_resolver_edge(struct replay_run *run, int64_t clk, unsigned watch, enum sim_level level);
bool replay_resolver_near(const struct replay_event *event, uint32_t expected, uint32_t got);
int replay_resolver_excitation(const struct replay_kind *kind, const struct replay_files *files,
                               const struct replay_options *options, struct replay_totals *totals,
                               struct hm2_diag *diag);

/* Bench of the serial recordings. */
int replay_serial_inputs(const struct replay_trace *trace, const struct replay_test *test,
                         struct replay_event_list *out);
int replay_serial_prepare(struct replay_run *run);
void replay_serial_edge(struct replay_run *run, int64_t clk, unsigned watch, enum sim_level level);

/* Result of one test to the caller. */
void replay_report(const struct replay_options *options, struct replay_totals *totals, const char *test,
                   const char *difference);
bool replay_wanted(const struct replay_options *options, const char *test);

#endif

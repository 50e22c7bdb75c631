/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Simulated Pico Systems PPMC boards on an EPP bus, at the level of single bus cycles (ppmc.md section 11). In
 * libhm2sim.a.
 *
 * The bus accepts any sequence of cycles, not only those that our driver makes. Time is given, in nanoseconds; nothing
 * sleeps. Each cycle takes time of its own, so a list of cycles is spread over the time that a port would need for it.
 * An axis is known by the slot of its board (the address switches) and its number there, 0..3. Nothing here is realtime
 * safe or thread safe. Functions that take slot and axis do nothing when there is no such axis.
 */
#ifndef HM2_SIM_PPMC_H
#define HM2_SIM_PPMC_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/epp.h>
#include <hm2/err.h>

#define SIM_PPMC_AXES  4u
#define SIM_PPMC_SLOTS 16u

struct sim_ppmc; /* a bus with its boards */

/* What a cycle reads that nobody answers (rule 5). */
enum sim_ppmc_unanswered { SIM_PPMC_RESIDUE, SIM_PPMC_ONES, SIM_PPMC_ZEROS };

struct sim_ppmc_options {
    uint64_t seed;      /* of faults */
    int64_t cycle_ns;   /* of a bus cycle; 0 = 1000 */
    int64_t timeout_ns; /* of a cycle that nobody answers; 0 = 10000 */
    enum sim_ppmc_unanswered unanswered;
    /* What no document tells of the real boards (ppmc.md section 12), each way. */
    bool timestamps_live;  /* timestamps are those of the moment they are read, not of the latch pulse (rule 18) */
    bool timestamps_tear;  /* the high byte is not held when the low one is read (rule 18) */
    bool runs_on;          /* auto-increment leaves the board for the next address (rule 17) */
    bool strict;           /* load bits need 2 us (rule 8) */
    int64_t master_ns[16]; /* period of the master's latch pulse by tim3..tim0; 0 = no pulses (rule 11) */
};

/* NULL options = all zero. NULL when there is no memory. */
HM2_API struct sim_ppmc *sim_ppmc_new(const struct sim_ppmc_options *options);
HM2_API void sim_ppmc_free(struct sim_ppmc *bus);
/* Put a board into a slot: HM2_ERR_RANGE for slot > 15 or an odd slot for a board of two slots (0x14 and up), and
 * HM2_ERR_STATE when the slot is taken. Boards of other kinds than encoder boards (0x1n) have encoders and an ID. */
HM2_API int HM2_MUST_CHECK sim_ppmc_add(struct sim_ppmc *bus, unsigned slot, uint8_t id);

/* ---- time and cycles --------------------------------------------------------------------------------------------- */

/* Time passes to at least this; it never goes back. */
HM2_API void sim_ppmc_set_time(struct sim_ppmc *bus, int64_t now_ns);
HM2_API int64_t sim_ppmc_now_ns(const struct sim_ppmc *bus);

/* One bus cycle. False when nobody answered; a read then leaves what the port would (options.unanswered). */
HM2_API bool sim_ppmc_cycle(struct sim_ppmc *bus, enum epp_kind kind, uint8_t *byte);

/* The seam (hm2/epp.h) on the bus in the same process. Its close() leaves the bus alone. NULL when there is no memory.
 */
HM2_API struct epp *sim_ppmc_epp(struct sim_ppmc *bus);

/* A request of the socket protocol (hm2/epp.h), which may be anything. Length of the reply, which has room for
 * EPP_WIRE_MAX_BYTES; 0 = no request, the client is to be sent away. */
HM2_API size_t sim_ppmc_serve(struct sim_ppmc *bus, const uint8_t *request, size_t len, uint8_t *reply);

/* The bus on a socket of this path, for up to eight processes at a time (epp_open(): sim:PATH). A socket that a killed
 * program left there is replaced. HM2_ERR_INVALID for a path that is too long, HM2_ERR_IO with the system's reason.
 * Closing removes the socket. */
struct sim_ppmc_server;
HM2_API int HM2_MUST_CHECK sim_ppmc_server_open(struct sim_ppmc_server **server, const char *path,
                                                struct hm2_diag *diag);
HM2_API void sim_ppmc_server_close(struct sim_ppmc_server *server);
/* A descriptor that is readable (poll(2), epoll(7)) when somebody connects or asks something. */
HM2_API int sim_ppmc_server_fd(const struct sim_ppmc_server *server);
/* Take what has come and answer it, at the bus's present time: call sim_ppmc_set_time() before. Does not wait. */
HM2_API void sim_ppmc_server_run(struct sim_ppmc_server *server, struct sim_ppmc *bus);

/* A parallel port in front of the bus, as an x86 sees it: registers B+0..B+7 and the ECR at B+0x402 (ppmc.md section
 * 3.3). Other offsets read as 0xFF. */
HM2_API uint8_t sim_ppmc_port_in(struct sim_ppmc *bus, unsigned offset);
HM2_API void sim_ppmc_port_out(struct sim_ppmc *bus, unsigned offset, uint8_t value);

/* ---- what turns the encoders ------------------------------------------------------------------------------------- */

/* Edges of A and B a second from now on, evenly spaced; negative = backwards. At most 1e8. */
HM2_API void sim_ppmc_set_rate(struct sim_ppmc *bus, unsigned slot, unsigned axis, int32_t edges_per_s);
/* The shaft is where this function says, in edges; between two moments at which the bus looks it moves evenly. */
typedef int64_t (*sim_ppmc_position_fn)(void *context, int64_t now_ns);
HM2_API void sim_ppmc_follow(struct sim_ppmc *bus, unsigned slot, unsigned axis, sim_ppmc_position_fn position,
                             void *context);
/* Move by so many edges now, in no time. One is an ordinary edge, two are an illegal transition. */
HM2_API void sim_ppmc_jump(struct sim_ppmc *bus, unsigned slot, unsigned axis, int edges);
/* Z is high while (position - offset) modulo counts is below width; 0 < width < counts, or counts 0 for no Z. */
HM2_API void sim_ppmc_set_index(struct sim_ppmc *bus, unsigned slot, unsigned axis, uint32_t counts, uint32_t offset,
                                uint32_t width);
/* B keeps its level, whatever the shaft does. */
HM2_API void sim_ppmc_break_wire(struct sim_ppmc *bus, unsigned slot, unsigned axis, bool broken);
/* Live counter, before any of it was read. */
HM2_API void sim_ppmc_set_counter(struct sim_ppmc *bus, unsigned slot, unsigned axis, uint32_t value);

/* What is true of an axis at the present time. */
struct sim_ppmc_truth {
    int64_t shaft;        /* edges of A and B since the start */
    int64_t counted;      /* those that passed the filter */
    uint32_t counter;     /* live, 24 bits */
    uint32_t holding;     /* 24 bits */
    int64_t held_counted; /* `counted` at the last latch pulse */
    uint64_t indices;     /* rising edges of Z */
    uint64_t presets;     /* of these, those that preset the counter */
    int64_t preset_at;    /* `counted` at the last preset */
    uint64_t illegal;     /* transitions of both inputs at once */
};
HM2_API struct sim_ppmc_truth sim_ppmc_truth(struct sim_ppmc *bus, unsigned slot, unsigned axis);

/* What was written to a board's registers, as it is now. */
struct sim_ppmc_registers {
    uint32_t assembly;
    uint8_t control, timer, filter, preset;
};
HM2_API struct sim_ppmc_registers sim_ppmc_registers(struct sim_ppmc *bus, unsigned slot);

/* ---- faults ------------------------------------------------------------------------------------------------------ */

enum sim_ppmc_fault {
    SIM_PPMC_FAULT_TIMEOUT, /* the board does not see the cycle */
    SIM_PPMC_FAULT_ZEROS,   /* a data read brings 0x00 */
    SIM_PPMC_FAULT_ONES,    /* ... 0xFF */
    SIM_PPMC_FAULT_RESIDUE, /* ... the byte of the cycle before */
    SIM_PPMC_FAULT_SKIP,    /* the address goes on by two */
    SIM_PPMC_FAULT_REPEAT,  /* the address does not go on */
    SIM_PPMC_FAULTS,
};

/* One of `every` cycles, by chance, has one of the faults in the mask (bit = enum). 0 = none. */
HM2_API void sim_ppmc_set_faults(struct sim_ppmc *bus, uint32_t every, unsigned mask);
/* The n-th cycle from now (0 = the next) has this fault, and `count` - 1 behind it. */
HM2_API void sim_ppmc_fault_at(struct sim_ppmc *bus, uint64_t n, uint64_t count, enum sim_ppmc_fault fault);
/* The cable is pulled: no cycle is answered. */
HM2_API void sim_ppmc_unplug(struct sim_ppmc *bus, bool unplugged);
/* A board without power does not answer; all its registers are as after power-on when it comes back. */
HM2_API void sim_ppmc_power(struct sim_ppmc *bus, unsigned slot, bool on);
/* nInit: all boards at once take their reset values (rule 13). */
HM2_API void sim_ppmc_reset(struct sim_ppmc *bus);
/* From now on register 15 has this byte. */
HM2_API void sim_ppmc_set_id(struct sim_ppmc *bus, unsigned slot, uint8_t id);

struct sim_ppmc_stats {
    uint64_t cycles;
    uint64_t unanswered;
    uint64_t faults[SIM_PPMC_FAULTS]; /* injected */
    uint64_t undocumented;            /* accesses that no document describes */
    uint64_t latches;                 /* pulses that a board acted on */
};
HM2_API struct sim_ppmc_stats sim_ppmc_stats(const struct sim_ppmc *bus);

#endif

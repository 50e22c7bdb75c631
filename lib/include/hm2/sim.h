/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Simulated cards: the register bus of a HostMot2 FPGA at clock resolution, the LBP16 engine in front of it, and a
 * network between it and a client that can lose, repeat, reorder, delay, cut and forge datagrams.
 *
 * The simulation knows LBP16 and HostMot2 *definitions* (lbp16.h, idrom.h) and nothing of the driver (lib/module,
 * lib/board): it is written from the firmware's behaviour and must be able to disagree with the driver.
 *
 * Time is injected. A card's own time is the index of the next rising edge of ClockLow. Models advance in closed form
 * from one access to the next; output edges are produced only where something watches. Nothing here is realtime safe
 * in the strict sense, but packet handling allocates nothing. One thread at a time per card.
 */
#ifndef HM2_SIM_H
#define HM2_SIM_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/err.h>
#include <hm2/idrom.h>
#include <hm2/link.h>

struct sim_card;

/* What undriven reads give: Xilinx cards ones, Efinix cards zeros (register map 1.1). */
enum sim_bus { SIM_BUS_OF_PROFILE, SIM_BUS_ONES, SIM_BUS_ZEROS };

/* Which firmware sources the modules follow where two generations of them differ (traces biss, fabs, ssi_new): the
 * public ones of 2021 or later ones. By default images with the newer address map follow the later ones. */
enum sim_sources { SIM_SOURCES_OF_MAP, SIM_SOURCES_2021, SIM_SOURCES_LATER };

struct sim_card_options {
    const char *profile;           /* "7i96s", "7i93", ...: card name, EEPROM, bus and default firmware */
    const char *card_name;         /* that the card reports in place of the profile's, 1 to 16 characters; or NULL */
    const struct hm2_image *image; /* other firmware instead of the profile's, or NULL; faulty ones are carried too */
    uint64_t seed;                 /* MAC address and start of the time stamps */
    uint8_t ip[4];                 /* address of the card, also in the EEPROM; zeros = those of the profile */
    uint8_t mac[6];                /* zeros = Mesa's prefix and three bytes from the seed */
    enum sim_bus bus;
    uint8_t flash_id; /* of another flash chip than the profile's, 0x11 to 0x16; see hm2/sim_flash.h */
    enum sim_sources sources;
};

HM2_API int HM2_MUST_CHECK sim_card_new(struct sim_card **card, const struct sim_card_options *options,
                                        struct hm2_diag *diag);
HM2_API void sim_card_free(struct sim_card *card);
/* Names of the profiles, NULL-terminated. */
HM2_API const char *const *sim_profiles(void);
HM2_API const struct hm2_idrom *sim_card_idrom(const struct sim_card *card);
/* Off and on: every register as after power-up, LBP16 engine reset, EEPROM and flash kept. A card whose flash holds no
 * image that starts stays deaf (hm2/sim_flash.h); a new one has a fallback image. */
HM2_API void sim_card_power_cycle(struct sim_card *card);

/* ---- register bus at clock resolution ---------------------------------------------------------------------------
 * sim_card_advance(card, clk): all edges before clk have happened. A read at clk gives what those edges made. A write
 * at clk happens at edge clk itself (logic sees the old value at that edge). An input that changes at clk does so
 * just after edge clk and is first sampled at clk + 1. Time never goes back (earlier times are taken as now). */
HM2_API int64_t sim_card_clock(const struct sim_card *card);
HM2_API void sim_card_advance(struct sim_card *card, int64_t clk);
/* undriven (may be NULL) gets the bits that no module drives; they read as the card's bus rests. */
HM2_API uint32_t sim_card_read(struct sim_card *card, int64_t clk, uint16_t address, uint32_t *undriven);
HM2_API void sim_card_write(struct sim_card *card, int64_t clk, uint16_t address, uint32_t value);

/* ---- pins -------------------------------------------------------------------------------------------------------*/

enum sim_level { SIM_LOW = 0, SIM_HIGH = 1, SIM_FLOAT = 2, SIM_PULLUP = 3 };

/* What the world outside does to a pad, just after edge clk. Power-up: SIM_PULLUP. */
HM2_API int HM2_MUST_CHECK sim_card_drive(struct sim_card *card, int64_t clk, unsigned io, enum sim_level level);
/* What the FPGA drives on a pad: SIM_LOW, SIM_HIGH or SIM_FLOAT. */
HM2_API enum sim_level sim_card_pad(struct sim_card *card, unsigned io);
/* Connect pad to pad by a wire outside: `to` sees what `from` shows. HM2_ERR_STATE when `to` has a wire already or the
 * wires would make a ring. */
HM2_API int HM2_MUST_CHECK sim_card_wire(struct sim_card *card, unsigned from_io, unsigned to_io);

/* Called for every change of a watched output: clk is the edge after which it shows, ps the time after that edge
 * (0 but for outputs clocked by ClockHigh). */
typedef void (*sim_edge_fn)(void *context, int64_t clk, unsigned ps, unsigned watch, enum sim_level level);
/* Watch what the FPGA drives on a pad. Returns the watch number or an error. */
HM2_API int HM2_MUST_CHECK sim_card_watch_pad(struct sim_card *card, unsigned io);
/* Watch a module's output itself, whether or not a pin carries it. */
HM2_API int HM2_MUST_CHECK sim_card_watch_output(struct sim_card *card, uint8_t gtag, unsigned unit,
                                                 uint8_t secondary_pin);
/* Level of a watched output as last reported (at first: as it was when the watch was set). */
HM2_API enum sim_level sim_card_watched(struct sim_card *card, unsigned watch);
HM2_API void sim_card_on_edge(struct sim_card *card, sim_edge_fn fn, void *context);

/* Drive a module's input directly, whether or not a pin carries it. */
HM2_API int HM2_MUST_CHECK sim_card_drive_input(struct sim_card *card, int64_t clk, uint8_t gtag, unsigned unit,
                                                uint8_t secondary_pin, enum sim_level level);

/* An absolute encoder on a channel of SSI (tag 08), BISS (18) or FanucAbs (19), instead of what pads do to its data
 * line. It answers the card's clock or request as the encoders of the recorded traces did. */
struct sim_absolute {
    unsigned bits;       /* 1..128; 0 takes the encoder away */
    uint32_t value[4];   /* word 0 = least significant bits */
    int64_t delay_ps;    /* from the clock edge (SSI, BISS) or the end of the request's first edge to the answer */
    int64_t idle_ps;     /* SSI, BISS: time without clock after which the line goes back to idle; 0 = 20 us, 2 us */
    int64_t bit_ps;      /* Fanuc: time of a bit; 0 = 976562 */
    unsigned processing; /* BISS: clocks between acknowledge and start bit */
};
/* HM2_ERR_NOTFOUND without such a module or channel, HM2_ERR_RANGE for impossible numbers. */
HM2_API int HM2_MUST_CHECK sim_card_absolute(struct sim_card *card, uint8_t gtag, unsigned unit,
                                             const struct sim_absolute *encoder);

/* An encoder that turns with a step generator, in closed form: count = floor(steps * num / den) since the call,
 * with the time stamp that the last count would have. No edges, no cost per count. It rests while the generator's first
 * output does not reach a pad that it has: steps of that time are left out. */
HM2_API int HM2_MUST_CHECK sim_card_follow(struct sim_card *card, unsigned encoder, unsigned stepgen, int32_t num,
                                           int32_t den);
/* The same with a motor whose drive takes a PWM generator for the commanded speed, and obeys at once: counts_per_s at
 * full duty, backwards when the direction is high; negative turns both round. It rests while the generator is not
 * enabled and while the FPGA does not drive its pin. */
HM2_API int HM2_MUST_CHECK sim_card_motor(struct sim_card *card, unsigned encoder, unsigned pwmgen,
                                          int32_t counts_per_s);
/* An encoder that follows or has a motor shows its index at every multiple of so many counts. */
HM2_API int HM2_MUST_CHECK sim_card_index(struct sim_card *card, unsigned encoder, uint32_t counts);
/* Where an axis is, since the card was made: counts of such an encoder (tag 04), whole steps of a motor at
 * a step generator (05), which rests as such an encoder does. */
HM2_API int HM2_MUST_CHECK sim_card_turned(struct sim_card *card, uint8_t gtag, unsigned unit, int64_t *position);

#define SIM_RESOLVER_TURNS 1e6

/* A resolver on a channel of the resolver modules (tag C0), with a motor on its shaft that obeys a PWM generator as
 * those of sim_card_motor() do. */
struct sim_resolver {
    double amplitude;   /* of its signals, in the converter's range: 0..1; 0 takes the resolver away */
    double turns;       /* electrical turns: where it stands now */
    double turns_per_s; /* at full duty; 0 = without a motor */
    unsigned pwmgen;
};
/* HM2_ERR_NOTFOUND without such a channel or PWM generator; HM2_ERR_RANGE for impossible numbers, turns and turns a
 * second beyond SIM_RESOLVER_TURNS among them. */
HM2_API int HM2_MUST_CHECK sim_card_resolver(struct sim_card *card, unsigned channel,
                                             const struct sim_resolver *resolver);
/* Where it has been turned to. */
HM2_API int HM2_MUST_CHECK sim_card_resolver_turns(struct sim_card *card, unsigned channel, double *turns);

/* ---- serial ports ------------------------------------------------------------------------------------------------ */

/* A byte has left a transmitter, up to the middle of its stop bit. */
typedef void (*sim_serial_fn)(void *context, uint8_t byte);
/* Attach a serial port of the card (gtag of its transmitter, UART or PktUART) to the world outside as bytes: sent is
 * called for each byte that goes out, and the receiver hears, instead of its pin, what sim_card_serial_put() gives it:
 * a peer that sends at the port's own rate. HM2_ERR_NOTFOUND when there is no such port. */
HM2_API int HM2_MUST_CHECK sim_card_serial(struct sim_card *card, uint8_t gtag, unsigned unit, sim_serial_fn sent,
                                           void *context);
/* Bytes for the receiver from now on, as many as there is room for (4096): returns how many. */
HM2_API size_t sim_card_serial_put(struct sim_card *card, uint8_t gtag, unsigned unit, const uint8_t *bytes,
                                   size_t len);

/* ---- 7I65 ---------------------------------------------------------------------------------------------------------
 */

#define SIM_7I65_CHANNELS 8u

/* An octal analog servo card behind a buffered SPI port of the card. It takes the card's edge callback
 * (sim_card_on_edge()), so there is one for a card. */
struct sim_7i65;
HM2_API int HM2_MUST_CHECK sim_7i65_new(struct sim_7i65 **made, struct sim_card *card, unsigned unit);
HM2_API void sim_7i65_free(struct sim_7i65 *daughter); /* before the card */
HM2_API double sim_7i65_output_volts(const struct sim_7i65 *daughter, unsigned channel);
HM2_API void sim_7i65_set_input_volts(struct sim_7i65 *daughter, unsigned channel, double volts);
HM2_API void sim_7i65_set_inputs(struct sim_7i65 *daughter, uint8_t inputs); /* bits 0..3 */
/* A motor whose drive takes output `channel` for its speed while the channel is enabled, with an encoder of the card on
 * its shaft: counts_per_s at 10 V (negative: the other way round), reached with a time constant of 0 to 1000 s.
 * HM2_ERR_NOTFOUND when there is no such encoder or channel, or the channel has a motor, HM2_ERR_RANGE for the time.
 * The daughter card must then live as long as the card is used. */
HM2_API int HM2_MUST_CHECK sim_7i65_motor(struct sim_7i65 *daughter, unsigned channel, unsigned encoder,
                                          int32_t counts_per_s, double time_constant_s);
HM2_API uint8_t sim_7i65_enables(const struct sim_7i65 *daughter);

/* ---- packets ---------------------------------------------------------------------------------------------------- */

/* Card time that belongs to a time of the outside world; the first packet sets it when nobody did. */
HM2_API void sim_card_set_time(struct sim_card *card, int64_t now_ns);
/* Card time at a time of the outside world. */
HM2_API int64_t sim_card_clock_at(const struct sim_card *card, int64_t now_ns);
/* The card's processor takes no time: all registers of a packet are read in one clock, and written one clock after the
 * other. For comparing clients whose packets are arranged differently. Waits that a packet asks for stay. */
HM2_API void sim_card_set_instant(struct sim_card *card, bool instant);
/* One datagram to the card's LBP16 port arrives at now_ns. Returns the length of the reply (0 = none) and when it
 * leaves in *reply_ns (may be NULL). A card that is busy with an earlier packet takes this one afterwards. */
HM2_API size_t sim_card_packet(struct sim_card *card, int64_t now_ns, const uint8_t *request, size_t request_len,
                               uint8_t *reply, size_t capacity, int64_t *reply_ns);
/* How long the last packet has asked the card to wait: space 4's waits. */
HM2_API int64_t sim_card_asked_ns(const struct sim_card *card);
/* The same with whole Ethernet frames, without checksums as the firmware sees and makes them: ARP for the card's
 * address, ICMP echo, UDP. Frames are taken as they are (Ethernet pads to 60 bytes: the caller's affair). */
HM2_API size_t sim_card_frame(struct sim_card *card, int64_t now_ns, const uint8_t *frame, size_t frame_len,
                              uint8_t *reply, size_t capacity, int64_t *reply_ns);
HM2_API void sim_card_mac(const struct sim_card *card, uint8_t mac[6]);
HM2_API void sim_card_ip(const struct sim_card *card, uint8_t ip[4]);
/* The bytes of the configuration flash and of the settings EEPROM, kept over power cycles; the caller may change
 * them between packets. *size (may be NULL) in bytes and in 16-bit words. */
HM2_API uint8_t *sim_card_flash(struct sim_card *card, size_t *size);
HM2_API uint16_t *sim_card_eeprom(struct sim_card *card, size_t *words);

/* ---- the network between, with faults from a seed --------------------------------------------------------------- */

struct sim_faults {
    uint64_t seed;
    double loss, duplicate, reorder, truncate, foreign; /* probability per datagram, each direction, 0..1 */
    int64_t delay_min_ns, delay_max_ns;                 /* uniform, on top of the card's own time; 0..1 s */
    double tail;                                        /* probability that a datagram takes tail_ns longer; 0..1 */
    int64_t tail_ns;                                    /* 0..1 s */
    int64_t coalesce_ns; /* the client's port tells of a datagram so long after it came, and of all that came meanwhile
                          * with it; 0 = at once, ..1 s */
    int64_t sleep_ns;    /* a line at rest for longer falls asleep (Energy-Efficient Ethernet), 0..1 s, */
    int64_t wake_ns;     /* and the next datagram is so late; 0 = it never sleeps, ..1 s */
    int64_t busy_every_ns, busy_ns; /* once in each so long, at a time from the seed, others have the line for busy_ns;
                                     * datagrams wait for them. 0 = never, ..1 s */
};

/* 0, or HM2_ERR_RANGE for a probability outside 0..1, or times outside 0..1 s, with min > max or busy_ns longer than
 * busy_every_ns. */
HM2_API int HM2_MUST_CHECK sim_faults_check(const struct sim_faults *faults);

struct sim_net;

/* A client's view of a card through such a network, in virtual time: a struct link whose now_ns is the network's
 * clock, which starts at 0. recv() with a deadline lets virtual time pass up to the reply or the deadline. A stranger
 * sends requests of its own to the card (its replies go elsewhere) and datagrams to the client (the link counts and
 * drops them). The same seed and the same calls give the same faults. send() and recv() allocate nothing.
 * Errors as sim_faults_check(). faults may be NULL. */
HM2_API int HM2_MUST_CHECK sim_net_new(struct sim_net **net, struct sim_card *card, const struct sim_faults *faults);
HM2_API void sim_net_free(struct sim_net *net);         /* not the card */
HM2_API struct link *sim_net_link(struct sim_net *net); /* owned by the net; its close() does nothing */
HM2_API int sim_net_set_faults(struct sim_net *net, const struct sim_faults *faults);
HM2_API void sim_net_sleep_until(struct sim_net *net, int64_t now_ns);
HM2_API void sim_net_freeze(struct sim_net *net, bool frozen); /* the card hears and says nothing */
/* What really happened, by cause. Datagrams to the card (0) and from it (1). A datagram counts as reordered when it is
 * delivered after one that was sent later, whatever made it late. */
struct sim_net_truth {
    uint64_t sent[2], lost[2], duplicated[2], reordered[2], truncated[2], foreign[2];
    uint64_t delivered[2]; /* handed to the card, or queued for the client; without the stranger's */
    uint64_t unheard;      /* came to a frozen card */
    uint64_t overflow[2];  /* more on their way, or waiting for the client, than there is room for */
};
HM2_API struct sim_net_truth sim_net_truth(const struct sim_net *net);

/* Called just before (done = false) and just after the card takes a datagram of a client; not for a stranger's. For
 * tests that note what the card has at that moment. fn = NULL ends it. */
typedef void (*sim_net_taken_fn)(void *context, const uint8_t *data, size_t len, bool done);
HM2_API void sim_net_on_taken(struct sim_net *net, sim_net_taken_fn fn, void *context);

/* The same network for clients outside, by number: what is delivered goes to a function instead of the link. A
 * program calls sim_net_arrive() when a client's datagram came, sim_net_sleep_until() when its own time has come to
 * sim_net_next_ns(), and sends what it is handed. */
typedef void (*sim_net_deliver_fn)(void *context, uint64_t client, const uint8_t *data, size_t len, bool foreign);
HM2_API void sim_net_on_deliver(struct sim_net *net, sim_net_deliver_fn fn, void *context);
HM2_API void sim_net_arrive(struct sim_net *net, int64_t now_ns, uint64_t client, const uint8_t *data, size_t len);
/* When the next datagram on its way is due; INT64_MAX when there is none. */
HM2_API int64_t sim_net_next_ns(const struct sim_net *net);
/* Replies leave as soon as they are made, without the tens of microseconds that the card takes (but not before the card
 * has waited as long as the packet asked it to). For programs, whose host adds times of its own. */
HM2_API void sim_net_set_instant(struct sim_net *net, bool instant);

#endif

/* SPDX-License-Identifier: GPL-2.0-or-later */
/* What hm2sim was asked to do. */
#ifndef HM2SIM_OPTIONS_H
#define HM2SIM_OPTIONS_H

#include <netinet/in.h>
#include <stdbool.h>
#include <stdint.h>

#include <hm2/sim.h>

#include "absolutes.h"
#include "flash.h"

#define MAX_CARDS    32u
#define MAX_WIRES    32u
#define MAX_PATTERNS 32u
#define MAX_SERIALS  8u
#define MAX_REMOTES  32u
#define FIELD_SIZE   24u /* of a remote's field name */
#define PATTERN_BITS 64u
#define MAX_UARTS    16u
#define UART_PATH    256u

struct wire {
    unsigned from, to;
};

struct follower {
    unsigned encoder, stepgen;
    int32_t num, den;
};

/* A motor at a PWM generator, with an encoder on its shaft. */
struct motor {
    unsigned encoder, pwmgen;
    int32_t counts_per_s; /* at full duty */
};

/* A resolver, and a motor on its shaft when turns_per_s is not 0. */
struct resolver_option {
    unsigned channel, pwmgen;
    double turns, turns_per_s;
};

/* A card at a smart-serial port. */
struct remote_option {
    unsigned port, channel;
    const char *card; /* one of sim_sserial_cards() or remote_names() */
};

/* A drive and motor at an analog output of such a card, with an encoder on its shaft. */
struct servo {
    unsigned encoder, port, channel;
    char output[FIELD_SIZE];
    int32_t counts_per_s;
    double time_constant_s;
};

/* The same at an output of a 7I65. */
struct servo_card_motor {
    unsigned encoder, channel;
    int32_t counts_per_s;
    double time_constant_s;
};

struct encoder_index {
    unsigned encoder;
    uint32_t counts; /* from one to the next */
};

/* What an axis does to a pad: one level below a position, another from there on. */
struct position_switch {
    unsigned io;
    uint8_t gtag; /* stepgen or encoder */
    unsigned unit;
    int64_t position;
    enum sim_level below, above;
};

/* Levels that the world puts on a pad, one after the other and round again; a single one is for good. */
struct pattern {
    unsigned io;
    unsigned count;
    enum sim_level levels[PATTERN_BITS];
    int64_t step_ns;
};

/* A serial port and what hangs at it: "loop", or the path of a terminal to make. */
struct uart_option {
    uint8_t gtag;
    unsigned unit;
    const char *target;
};

struct card_options {
    const char *type;
    struct in_addr address;
    uint16_t port;
    const char *firmware; /* file */
    enum sim_sources sources;
    const char *name; /* that the card reports, or NULL */
    uint8_t mac[6];
    struct flash_options flash;
    unsigned wire_count, follower_count, motor_count, index_count, switch_count, pattern_count, remote_count,
        servo_count, resolver_count;
    struct wire wires[MAX_WIRES];
    struct follower followers[MAX_WIRES];
    struct motor motors[MAX_WIRES];
    struct resolver_option resolvers[MAX_WIRES];
    struct encoder_index indices[MAX_WIRES];
    struct position_switch switches[MAX_WIRES];
    struct pattern patterns[MAX_PATTERNS];
    struct remote_option remotes[MAX_REMOTES];
    struct servo servos[MAX_WIRES];
    unsigned absolute_count;
    struct absolute_encoder absolutes[MAX_ABSOLUTES];
    unsigned uart_count;
    struct uart_option uarts[MAX_UARTS];
    bool has_servo_card; /* a 7I65 at a buffered SPI port */
    unsigned servo_port, servo_card_motor_count;
    struct servo_card_motor servo_card_motors[MAX_WIRES];
    const char *ppmc; /* path of the socket of its EPP bus */
};

/* A remote of one processor on a pseudo-terminal. */
struct serial_option {
    const char *remote; /* one of remote_names() */
    const char *path;   /* of a link to the terminal */
};

struct options {
    unsigned card_count;
    struct card_options cards[MAX_CARDS];
    unsigned serial_count;
    struct serial_option serials[MAX_SERIALS];
    uint64_t seed;
    struct sim_faults faults;
    bool latency, quiet, realtime;
    int realtime_priority;
    int64_t run_ns;      /* 0 = until a signal */
    int64_t stats_ns;    /* 0 = at the end only */
    const char *control; /* path of the socket */
};

enum options_result { OPTIONS_RUN, OPTIONS_EXIT_OK, OPTIONS_EXIT_USAGE };

/* Reads the command line. Help, version and complaints have been printed when the result is not OPTIONS_RUN. */
enum options_result options_read(struct options *options, int argc, char **argv);

/* "0", "1", "z" (floating), "h" (pulled up). */
bool options_level(char letter, enum sim_level *level);

#endif

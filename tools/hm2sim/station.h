/* SPDX-License-Identifier: GPL-2.0-or-later */
/* A simulated card behind its socket. */
#ifndef HM2SIM_STATION_H
#define HM2SIM_STATION_H

#include "axes.h"
#include "peers.h"
#include "ppmc.h"

struct station {
    const struct card_options *options;
    struct sim_card *card;
    struct axes axes;
    struct flash_file flash;
    struct absolutes absolutes;
    struct peers peers;
    struct ppmc_bus ppmc;
    struct sim_net *net;
    int socket, foreign_socket; /* -1 = not open */
    struct sockaddr_in address;
    uint64_t requests, replies, send_errors;
    int64_t pattern_due_ns[MAX_PATTERNS];
    unsigned pattern_step[MAX_PATTERNS];
};

/* Make card, network and sockets; time starts at now_ns = 0. On an error diag says why; the caller closes. */
int HM2_MUST_CHECK station_open(struct station *station, const struct options *options, const struct card_options *card,
                                uint64_t seed, struct hm2_diag *diag);
void station_close(struct station *station);

/* Take one datagram from the socket. */
void station_receive(struct station *station, int64_t now_ns);
/* Answer who asks its EPP bus. */
void station_receive_ppmc(struct station *station, int64_t now_ns);
/* Do what is due. */
void station_run(struct station *station, int64_t now_ns);
/* When something will be; INT64_MAX = nothing. */
int64_t station_next_ns(const struct station *station);

/* "7i96s@127.0.0.1:27181" */
#define STATION_NAME_SIZE 64u
void station_name(const struct station *station, char name[STATION_NAME_SIZE]);
void station_print_stats(struct station *station);

#endif

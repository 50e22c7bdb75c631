/* SPDX-License-Identifier: GPL-2.0-or-later */
/* What hangs at a card's serial and SPI ports. */
#ifndef HM2SIM_PEERS_H
#define HM2SIM_PEERS_H

#include "options.h"

struct serial_peer {
    struct sim_card *card;
    uint8_t gtag;
    unsigned unit;
    int fd, slave; /* of a pseudo-terminal; -1 = the port's own bytes come back */
    char link[UART_PATH];
    uint64_t sent, heard, refused; /* bytes of the card; to it; for which there was no room */
};

struct peers {
    struct sim_card *card;
    unsigned serial_count;
    struct serial_peer serial[MAX_UARTS];
    struct sim_7i65 *servo;
    double position[SIM_7I65_CHANNELS]; /* of the axes at it */
    int64_t position_ns;
};

int peers_connect(struct peers *peers, const struct card_options *options, struct sim_card *card,
                  struct hm2_diag *diag);
void peers_close(struct peers *peers);
/* Time has come to now_ns; the card is as far. */
void peers_run(struct peers *peers, int64_t now_ns);
bool peers_exist(const struct peers *peers);
void peers_print(const struct peers *peers, const char *name);

#endif

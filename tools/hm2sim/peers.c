/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "peers.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#define TURNS_PER_VOLT_S 10.0 /* an axis at an output of the servo card: volts of its sensor a second, for one volt */
#define SENSOR_VOLTS     9.9

/* ---- serial
 * ----------------------------------------------------------------------------------------------------------- */

static void on_byte(void *const context, const uint8_t byte)
{
    struct serial_peer *const p = context;
    p->sent++;
    const bool loop = p->fd < 0;
    const size_t taken =
        loop ? sim_card_serial_put(p->card, p->gtag, p->unit, &byte, 1) : (size_t)(write(p->fd, &byte, 1) == 1);
    p->heard += loop ? taken : 0;
    p->refused += 1u - taken;
}

static void from_terminal(struct serial_peer *const p)
{
    uint8_t bytes[64]; /* few at a time: what the card has no room for yet stays in the terminal */
    const ssize_t len = p->fd >= 0 ? read(p->fd, bytes, sizeof bytes) : 0;
    const size_t taken = sim_card_serial_put(p->card, p->gtag, p->unit, bytes, len > 0 ? (size_t)len : 0);
    p->heard += taken;
    p->refused += len > 0 ? (size_t)len - taken : 0;
}

static int open_terminal(struct serial_peer *const p)
{
    char name[UART_PATH];
    struct termios raw;
    p->fd = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (p->fd < 0 || grantpt(p->fd) || unlockpt(p->fd) || ptsname_r(p->fd, name, sizeof name))
        return -1;
    p->slave = open(name, O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (p->slave < 0 || tcgetattr(p->slave, &raw))
        return -1;
    cfmakeraw(&raw);
    return tcsetattr(p->slave, TCSANOW, &raw) || symlink(name, p->link) ? -1 : 0;
}

static int connect_serial(struct serial_peer *const p, const struct uart_option *const o, struct sim_card *const card,
                          struct hm2_diag *const diag)
{
    *p = (struct serial_peer){.card = card, .gtag = o->gtag, .unit = o->unit, .fd = -1, .slave = -1};
    const int err = sim_card_serial(card, o->gtag, o->unit, on_byte, p);
    if (err)
        return hm2_diag_add(diag, err, "--uart: the card has no such port (%s %u)",
                            o->gtag == HM2_GTAG_UART_TX ? "uart" : "pktuart", o->unit);
    if (strcmp(o->target, "loop") == 0)
        return 0;
    snprintf(p->link, sizeof p->link, "%s", o->target);
    if (open_terminal(p))
        return hm2_diag_add(diag, HM2_ERR_IO, "--uart: no terminal at %s: %s", o->target, strerror(errno));
    return 0;
}

/* ---- servo card
 * -------------------------------------------------------------------------------------------------------- */

static int connect_servo_card(struct peers *const peers, const struct card_options *const o,
                              struct hm2_diag *const diag)
{
    const int missing = o->has_servo_card ? sim_7i65_new(&peers->servo, peers->card, o->servo_port) : 0;
    if (missing)
        return hm2_diag_add(diag, missing, "--7i65 %u: the card has no such buffered SPI port", o->servo_port);
    for (unsigned i = 0; i < o->servo_card_motor_count; i++) {
        const struct servo_card_motor *const m = &o->servo_card_motors[i];
        const int err = peers->servo
                            ? sim_7i65_motor(peers->servo, m->channel, m->encoder, m->counts_per_s, m->time_constant_s)
                            : HM2_ERR_NOTFOUND;
        if (err)
            return hm2_diag_add(
                diag, err,
                "--7i65-motor %u:%u: there is no such encoder, no --7i65 with such an output, or a motor "
                "at it already",
                m->encoder, m->channel);
    }
    return 0;
}

/* An axis at each output: its speed is the voltage, its sensor is at the input of the same number. */
static void move_axes(struct peers *const peers, const int64_t now_ns)
{
    const double dt = (double)(now_ns - peers->position_ns) * 1e-9;
    peers->position_ns = now_ns;
    for (unsigned i = 0; peers->servo && i < SIM_7I65_CHANNELS; i++) {
        const bool enabled = ((unsigned)sim_7i65_enables(peers->servo) >> i & 1u) != 0;
        double *const at = &peers->position[i];
        *at += enabled ? sim_7i65_output_volts(peers->servo, i) * TURNS_PER_VOLT_S * dt : 0.0;
        *at = *at > SENSOR_VOLTS ? SENSOR_VOLTS : *at < -SENSOR_VOLTS ? -SENSOR_VOLTS : *at;
        sim_7i65_set_input_volts(peers->servo, i, *at);
    }
}

/* ---- all
 * ----------------------------------------------------------------------------------------------------------------- */

int peers_connect(struct peers *const peers, const struct card_options *const options, struct sim_card *const card,
                  struct hm2_diag *const diag)
{
    int err = 0;
    peers->card = card;
    for (unsigned i = 0; i < options->uart_count && !err; i++) {
        peers->serial_count = i + 1u;
        err = connect_serial(&peers->serial[i], &options->uarts[i], card, diag);
    }
    return err ? err : connect_servo_card(peers, options, diag);
}

void peers_close(struct peers *const peers)
{
    for (unsigned i = 0; i < peers->serial_count; i++) {
        if (peers->serial[i].fd >= 0)
            (void)unlink(peers->serial[i].link);
        if (peers->serial[i].slave >= 0)
            close(peers->serial[i].slave);
        if (peers->serial[i].fd >= 0)
            close(peers->serial[i].fd);
    }
    sim_7i65_free(peers->servo);
}

void peers_run(struct peers *const peers, const int64_t now_ns)
{
    if (!peers_exist(peers))
        return;
    sim_card_advance(peers->card, sim_card_clock_at(peers->card, now_ns));
    for (unsigned i = 0; i < peers->serial_count; i++)
        from_terminal(&peers->serial[i]);
    move_axes(peers, now_ns);
}

bool peers_exist(const struct peers *const peers)
{
    return peers->serial_count > 0 || peers->servo;
}

void peers_print(const struct peers *const peers, const char *const name)
{
    for (unsigned i = 0; i < peers->serial_count; i++) {
        const struct serial_peer *const p = &peers->serial[i];
        printf("%s: %s.%u sent %" PRIu64 " heard %" PRIu64 " refused %" PRIu64 "\n", name,
               p->gtag == HM2_GTAG_UART_TX ? "uart" : "pktuart", p->unit, p->sent, p->heard, p->refused);
    }
}

/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * hm2_pty: serial ports of a card as ordinary terminals.
 *
 *     loadrt hm2_pty ports=hm2_7i80.0.pktuart.0 links=/tmp/spindle baud=9600 parity=even
 *
 * One thread without realtime moves bytes between pseudo-terminals and the ports' rings; the cycle of the card does
 * the rest. A terminal takes no more than its port does, and a port gives no more than its terminal takes.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#include <hal.h>
#include <rtapi.h>
#include <rtapi_app.h>

#include <hm2/points.h>
#include <hm2/serial.h>

#include "common/component.h"
#include "common/hal_binder.h"
#include "common/messenger.h"
#include "speed.h"

MODULE_AUTHOR("libhm2 developers");
MODULE_DESCRIPTION("serial ports of Mesa cards as terminals");
MODULE_LICENSE("GPL");

#define MAX_PORTS    16
#define CHUNK        1024u
#define TX_LIMIT     4096u /* bytes that may wait for the card */
#define CARRY_NS     1000000L
#define DEFAULT_BAUD 115200

static char *ports[MAX_PORTS];
RTAPI_MP_ARRAY_STRING(ports, MAX_PORTS, "serial port of each terminal, such as hm2_7i80.0.pktuart.0");
static char *links[MAX_PORTS];
RTAPI_MP_ARRAY_STRING(links, MAX_PORTS, "symbolic link to each terminal");
static int baud[MAX_PORTS];
RTAPI_MP_ARRAY_INT(baud, MAX_PORTS, "bits a second (115200)");
static char *parity[MAX_PORTS];
RTAPI_MP_ARRAY_STRING(parity, MAX_PORTS, "none, even or odd");
static char *drive[MAX_PORTS];
RTAPI_MP_ARRAY_STRING(drive, MAX_PORTS, "transmitter enable: auto, on or off");
static int mask[MAX_PORTS];
RTAPI_MP_ARRAY_INT(mask, MAX_PORTS, "1 = do not hear what is sent");
static int delay[MAX_PORTS];
RTAPI_MP_ARRAY_INT(delay, MAX_PORTS, "clocks from transmitter enable to the start bit, 0 to 15");
static int tx_gap[MAX_PORTS];
RTAPI_MP_ARRAY_INT(tx_gap, MAX_PORTS, "PktUART: bits between frames that are sent (40)");
static int rx_gap[MAX_PORTS];
RTAPI_MP_ARRAY_INT(rx_gap, MAX_PORTS, "PktUART: bits after which a received frame ends (20)");

static int follow[MAX_PORTS];
RTAPI_MP_ARRAY_INT(follow, MAX_PORTS, "1 = take the speed that a program sets on the terminal");

/* Of the component that drives the card. */
int hm2_serial_use(const char *name, const struct hm2_serial_settings *settings, struct hm2_serial **port);

struct terminal {
    hm2_u32_t *rx_bytes, *tx_bytes, *rx_errors, *rx_overruns, *rx_uncertain, *tx_uncertain, *baud;
    const char *name;
    struct hm2_serial *port;
    struct hm2_serial_settings settings;
    uint32_t speed; /* of the terminal, as seen last */
    bool follows;
    int master, slave;
    uint8_t pending[CHUNK]; /* from the card, for the terminal */
    size_t pending_len;
    char link[256];
};

static const struct hm2_point points[] = {
    HM2_POINT(struct terminal, rx_bytes, "rx-bytes", HM2_U32, HM2_PIN_OUT, 0, "", "bytes received"),
    HM2_POINT(struct terminal, tx_bytes, "tx-bytes", HM2_U32, HM2_PIN_OUT, 0, "", "bytes handed to the card"),
    HM2_POINT(struct terminal, rx_errors, "rx-errors", HM2_U32, HM2_PIN_OUT, 0, "",
              "false starts, missing stop bits, wrong parity"),
    HM2_POINT(struct terminal, rx_overruns, "rx-overruns", HM2_U32, HM2_PIN_OUT, 0, "",
              "times that the card's buffers ran over and were cleared"),
    HM2_POINT(struct terminal, rx_uncertain, "rx-uncertain", HM2_U32, HM2_PIN_OUT, 0, "",
              "bytes that may have been lost with a reply, at most"),
    HM2_POINT(struct terminal, tx_uncertain, "tx-uncertain", HM2_U32, HM2_PIN_OUT, 0, "",
              "bytes that may not have been sent, for the same reason"),
    HM2_POINT(struct terminal, baud, "baud", HM2_U32, HM2_PIN_OUT, 0, "bits/s", "speed of the port"),
};

static int component_id;
static struct hal_binder hal;
static struct terminal *terminals[MAX_PORTS];
static unsigned count;

/* ---- the thread
 * ------------------------------------------------------------------------------------------------------ */

/* The port takes the terminal's new speed when it has sent what was written before. False while it has not. A speed
 * that it cannot have is refused once, with a message. */
static bool follow_speed(struct terminal *const t)
{
    const uint32_t speed = t->follows ? terminal_speed(t->slave) : 0;
    if (speed == 0 || speed == t->speed)
        return true;
    if (hm2_serial_waiting(t->port) > 0)
        return false;
    struct hm2_serial_settings settings = t->settings;
    t->speed = settings.baud = speed;
    if (hm2_serial_use(t->name, &settings, &t->port) == 0)
        t->settings = settings;
    return true;
}

static void to_card(struct terminal *const t)
{
    uint8_t bytes[CHUNK];
    while (hm2_serial_waiting(t->port) < TX_LIMIT) {
        const ssize_t len = read(t->master, bytes, sizeof bytes);
        if (len <= 0)
            return;
        /* The ring is twice as long as what may wait, and nobody else fills it. */
        (void)hm2_serial_put(t->port, bytes, (size_t)len);
    }
}

static void to_terminal(struct terminal *const t)
{
    for (;;) {
        t->pending_len += hm2_serial_get(t->port, t->pending + t->pending_len, sizeof t->pending - t->pending_len);
        if (t->pending_len == 0)
            return;
        const ssize_t len = write(t->master, t->pending, t->pending_len);
        if (len <= 0)
            return;
        t->pending_len -= (size_t)len;
        memmove(t->pending, t->pending + len, t->pending_len);
    }
}

static void show_counts(const struct terminal *const t)
{
    const struct hm2_serial_counts counts = hm2_serial_counts(t->port);
    *t->rx_bytes = counts.rx_bytes;
    *t->tx_bytes = counts.tx_bytes;
    *t->rx_errors = counts.rx_errors;
    *t->rx_overruns = counts.rx_overruns;
    *t->rx_uncertain = counts.rx_uncertain;
    *t->tx_uncertain = counts.tx_uncertain;
    *t->baud = t->settings.baud;
}

static void carry(void)
{
    for (unsigned i = 0; i < count; i++) {
        if (follow_speed(terminals[i]))
            to_card(terminals[i]);
        to_terminal(terminals[i]);
        show_counts(terminals[i]);
    }
}

/* ---- load
 * ------------------------------------------------------------------------------------------------------------- */

static int word_of(const char *const what, const char *const word, const char *const words[3])
{
    for (int i = 0; i < 3; i++)
        if (!word || strcmp(word, words[i]) == 0)
            return i;
    rtapi_print_msg(RTAPI_MSG_ERR, "hm2_pty: %s=%s: expected %s, %s or %s\n", what, word, words[0], words[1], words[2]);
    return -1;
}

static int read_settings(const unsigned i, struct hm2_serial_settings *const settings)
{
    static const char *const parities[3] = {"none", "even", "odd"};
    static const char *const drives[3] = {"auto", "on", "off"};
    const int parity_word = word_of("parity", parity[i], parities), drive_word = word_of("drive", drive[i], drives);
    if (parity_word < 0 || drive_word < 0)
        return -EINVAL;
    *settings = (struct hm2_serial_settings){.baud = baud[i] ? (uint32_t)baud[i] : DEFAULT_BAUD,
                                             .parity = (enum hm2_parity)parity_word,
                                             .drive = (enum hm2_serial_drive)drive_word,
                                             .mask = mask[i] != 0,
                                             .speed_varies = follow[i] != 0,
                                             .drive_delay_clk = (unsigned)delay[i],
                                             .tx_gap_bits = tx_gap[i] ? (unsigned)tx_gap[i] : 40u,
                                             .rx_gap_bits = rx_gap[i] ? (unsigned)rx_gap[i] : 20u};
    return 0;
}

/* The slave stays open here too: without a reader the master would report an error instead of waiting. */
static int open_terminal(struct terminal *const t, const unsigned i)
{
    struct termios raw;
    char name[128];
    t->master = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (t->master < 0 || grantpt(t->master) || unlockpt(t->master) || ptsname_r(t->master, name, sizeof name))
        return -errno;
    t->slave = open(name, O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (t->slave < 0 || tcgetattr(t->slave, &raw))
        return -errno;
    cfmakeraw(&raw);
    if (tcsetattr(t->slave, TCSANOW, &raw) || terminal_set_speed(t->slave, t->settings.baud))
        return -errno;
    t->speed = terminal_speed(t->slave);
    if (links[i] && links[i][0]) {
        rtapi_snprintf(t->link, sizeof t->link, "%s", links[i]);
        char target[128];
        if (readlink(t->link, target, sizeof target) >= 0)
            (void)unlink(t->link); /* of an earlier run; anything but a link is left alone */
        if (symlink(name, t->link)) {
            t->link[0] = '\0';
            return -errno;
        }
    }
    rtapi_print("hm2_pty: %s is %s\n", ports[i], name);
    return 0;
}

static int load_terminal(const unsigned i)
{
    char prefix[HAL_NAME_LEN + 1];
    struct hm2_diag diag;
    struct terminal *const t = terminals[i] = hal.binder.alloc(&hal.binder, sizeof *t);
    if (!t)
        return -ENOMEM;
    t->master = t->slave = -1;
    t->name = ports[i];
    t->follows = follow[i] != 0;
    count = i + 1;
    hm2_diag_clear(&diag);
    rtapi_snprintf(prefix, sizeof prefix, "hm2-pty.%u", i);
    if (hm2_bind_points(&hal.binder, points, sizeof points / sizeof points[0], t, prefix, 0, &diag)) {
        rtapi_print_msg(RTAPI_MSG_ERR, "hm2_pty: %s\n", diag.text);
        return -EINVAL;
    }
    int result = read_settings(i, &t->settings);
    if (!result)
        result = hm2_serial_use(ports[i], &t->settings, &t->port);
    if (result)
        return result;
    result = open_terminal(t, i);
    if (result)
        rtapi_print_msg(RTAPI_MSG_ERR, "hm2_pty: %s: no terminal: %s\n", ports[i], strerror(-result));
    return result;
}

void rtapi_app_exit(void)
{
    messenger_stop();
    for (unsigned i = 0; i < count; i++) {
        if (terminals[i]->link[0])
            (void)unlink(terminals[i]->link);
        if (terminals[i]->slave >= 0)
            close(terminals[i]->slave);
        if (terminals[i]->master >= 0)
            close(terminals[i]->master);
    }
    hal_exit(component_id);
    count = 0;
}

static int load(void)
{
    hal_binder_init(&hal, component_id);
    int result = ports[0] && ports[0][0] ? 0 : -EINVAL;
    if (result)
        rtapi_print_msg(RTAPI_MSG_ERR, "hm2_pty: no port given: loadrt hm2_pty ports=hm2_7i80.0.pktuart.0\n");
    for (unsigned i = 0; !result && i < MAX_PORTS && ports[i] && ports[i][0]; i++)
        result = load_terminal(i);
    return result ? result : messenger_start("hm2_pty", carry, CARRY_NS);
}

int rtapi_app_main(void)
{
    return component_load("hm2_pty", &component_id, load, rtapi_app_exit);
}

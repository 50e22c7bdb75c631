/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Serial ports for other components: LinuxCNC's UART and PktUART functions (hal-interface 2.20), and the ports
 * themselves. */
#include <errno.h>
#include <string.h>

#include <rtapi.h>

#include "cards.h"
#include "exports.h"

#define UART_DELAY     0xF
#define UART_AUTO      (1 << 5)
#define UART_DRIVE     (1 << 6)
#define UART_MASK      (1 << 2)
#define UART_READ_SIZE 16u /* as many as the port's FIFO holds; the caller's array has that many */

/* Of the modes of a PktUART (register map 3.13). */
#define PKT_DELAY     0xF
#define PKT_AUTO      (1 << 5)
#define PKT_DRIVE     (1 << 6)
#define PKT_PARITY    (1 << 17)
#define PKT_ODD       (1 << 18)
#define PKT_MASK      (1 << 2)
#define PKT_ENABLE    (1 << 3)
#define PKT_GAP(mode) ((mode) >> 8 & 0xFF)
#define PKT_GAP_OF_0  256u
#define PKT_SEND_MOST 16u /* frames in a call, as with LinuxCNC's driver */

static struct hm2_serial *port_of(const char *const name, struct card **const card)
{
    unsigned unit = 0;
    const bool pkt = name && strstr(name, ".pktuart.");
    *card = card_of_port(name, pkt ? "pktuart" : "uart", &unit);
    struct hm2_serial *const port =
        *card ? hm2_serial_port(card_board(*card), pkt ? HM2_SERIAL_PKTUART : HM2_SERIAL_UART, unit) : NULL;
    if (*card && !port)
        rtapi_print_msg(RTAPI_MSG_ERR, "hm2_lbp16: %s: the firmware or the configuration has no such port\n", name);
    return port;
}

static int told(const char *const name, const int err, const struct hm2_diag *const diag)
{
    if (err < 0)
        rtapi_print_msg(RTAPI_MSG_ERR, "hm2_lbp16: %s: %s\n", name, diag->text);
    return err < 0 ? -EINVAL : 0;
}

static int open_paused(struct card *const card, struct hm2_serial *const port, struct hm2_diag *const diag)
{
    hm2_board_change_begin(card_board(card));
    const int err = hm2_serial_open(port, diag);
    const int end = hm2_board_change_end(card_board(card), diag);
    return err ? err : end;
}

int hm2_serial_use(const char *const name, const struct hm2_serial_settings *const settings,
                   struct hm2_serial **const opened)
{
    struct card *card;
    struct hm2_diag diag;
    struct hm2_serial *const port = port_of(name, &card);
    if (!port)
        return -EINVAL;
    hm2_diag_clear(&diag);
    const struct hm2_serial_settings now = hm2_serial_current(port);
    if (!*opened && now.baud > 0 && now.frames != settings->frames)
        return told(name,
                    hm2_diag_add(&diag, HM2_ERR_STATE, "another component has this port, for %s",
                                 now.frames ? "frames" : "a stream of bytes"),
                    &diag);
    card_pause(card);
    int err = *opened ? 0 : open_paused(card, port, &diag);
    if (!err)
        err = hm2_serial_set(port, settings, &diag);
    card_resume(card);
    if (!err)
        *opened = port;
    return told(name, err, &diag);
}

int hm2_uart_setup(char *const name, const int bitrate, const int32_t tx_mode, const int32_t rx_mode)
{
    const struct hm2_serial_settings settings = {.baud = (uint32_t)bitrate,
                                                 .drive = tx_mode & UART_AUTO    ? HM2_DRIVE_AUTO
                                                          : tx_mode & UART_DRIVE ? HM2_DRIVE_ON
                                                                                 : HM2_DRIVE_OFF,
                                                 .drive_delay_clk = (unsigned)tx_mode & UART_DELAY,
                                                 .mask = (rx_mode & UART_MASK) != 0};
    struct hm2_serial *port = NULL;
    return hm2_serial_use(name, &settings, &port);
}

int hm2_uart_send(char *const name, unsigned char data[], const int count)
{
    struct card *card;
    struct hm2_serial *const port = port_of(name, &card);
    return port && count >= 0 ? (int)hm2_serial_put(port, data, (size_t)count) : -EINVAL;
}

int hm2_uart_read(char *const name, unsigned char data[])
{
    struct card *card;
    struct hm2_serial *const port = port_of(name, &card);
    return port ? (int)hm2_serial_get(port, data, UART_READ_SIZE) : -EINVAL;
}

/* ---- frames --------------------------------------------------------------------------------------------------------
 */

static unsigned gap_of(const int32_t mode)
{
    const unsigned gap = (unsigned)PKT_GAP(mode);
    return gap > 0 ? gap : PKT_GAP_OF_0;
}

static enum hm2_parity parity_of(const int32_t mode)
{
    return !(mode & PKT_PARITY) ? HM2_PARITY_NONE : mode & PKT_ODD ? HM2_PARITY_ODD : HM2_PARITY_EVEN;
}

static void take_tx_mode(struct hm2_serial_settings *const settings, const int32_t mode)
{
    settings->drive = mode & PKT_AUTO ? HM2_DRIVE_AUTO : mode & PKT_DRIVE ? HM2_DRIVE_ON : HM2_DRIVE_OFF;
    settings->drive_delay_clk = (unsigned)mode & PKT_DELAY;
    settings->tx_gap_bits = gap_of(mode);
    settings->parity = parity_of(mode);
}

static void take_rx_mode(struct hm2_serial_settings *const settings, const int32_t mode)
{
    settings->deaf = !(mode & PKT_ENABLE);
    settings->mask = (mode & PKT_MASK) != 0;
    settings->rx_gap_bits = gap_of(mode);
    settings->parity = parity_of(mode);
}

/* The clears that are asked for are done whenever something is set. */
int hm2_pktuart_setup(char *const name, const int bitrate, const int32_t tx_mode, const int32_t rx_mode,
                      const int txclear, const int rxclear)
{
    struct card *card;
    struct hm2_serial *port = port_of(name, &card);
    (void)txclear;
    (void)rxclear;
    if (!port)
        return -EINVAL;
    if (tx_mode >= 0 && rx_mode >= 0 && parity_of(tx_mode) != parity_of(rx_mode)) {
        rtapi_print_msg(RTAPI_MSG_ERR, "hm2_lbp16: %s: one parity expected for both directions\n", name);
        return -EINVAL;
    }
    struct hm2_serial_settings settings = hm2_serial_current(port);
    if (settings.baud == 0)
        settings = (struct hm2_serial_settings){
            .drive = HM2_DRIVE_OFF, .deaf = true, .tx_gap_bits = PKT_GAP_OF_0, .rx_gap_bits = PKT_GAP_OF_0};
    settings.frames = true;
    if (bitrate > 0)
        settings.baud = (uint32_t)bitrate;
    if (tx_mode >= 0)
        take_tx_mode(&settings, tx_mode);
    if (rx_mode >= 0)
        take_rx_mode(&settings, rx_mode);
    port = NULL;
    return hm2_serial_use(name, &settings, &port);
}

static struct hm2_serial *frames_of(const char *const name)
{
    struct card *card;
    struct hm2_serial *const port = port_of(name, &card);
    return port && hm2_serial_current(port).frames ? port : NULL;
}

int hm2_pktuart_send(char *const name, unsigned char data[], uint8_t *const num_frames, uint16_t frame_sizes[])
{
    struct hm2_serial *const port = frames_of(name);
    const unsigned most = *num_frames < PKT_SEND_MOST ? *num_frames : PKT_SEND_MOST;
    int sent = 0, err = port ? 0 : HM2_ERR_NOTFOUND;
    *num_frames = 0;
    while (!err && *num_frames < most) {
        const unsigned size = frame_sizes[*num_frames];
        err = hm2_serial_put_frame(port, data + sent, size);
        if (err)
            break;
        sent += (int)size;
        (*num_frames)++;
    }
    return sent > 0 || !err ? sent : err == HM2_ERR_NOSPACE ? -EAGAIN : -EINVAL;
}

int hm2_pktuart_read(char *const name, unsigned char data[], uint8_t *const num_frames,
                     uint16_t *const max_frame_length, uint16_t frame_sizes[])
{
    struct hm2_serial *const port = frames_of(name);
    const unsigned most = *num_frames;
    const size_t room = (size_t)most * *max_frame_length;
    size_t got = 0, next;
    *num_frames = 0;
    if (!port || hm2_serial_lost(port))
        return port ? -EIO : -EINVAL;
    while (*num_frames < most && (next = hm2_serial_next_frame(port)) > 0) {
        if (next > room - got && *num_frames > 0)
            break;
        if (next > room) {
            (void)hm2_serial_get_frame(port, data, 0);
            return -EMSGSIZE;
        }
        frame_sizes[(*num_frames)++] = (uint16_t)hm2_serial_get_frame(port, data + got, next);
        got += next;
    }
    return (int)got;
}

/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Serial ports for other components: LinuxCNC's UART functions (hal-interface 2.20), and the ports themselves. */
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

/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Buffered SPI for other components: LinuxCNC's functions (hal-interface 2.20). 0, or a negative number. */
#include <errno.h>

#include <rtapi.h>

#include <hm2/bspi.h>

#include "cards.h"
#include "exports.h"

static struct hm2_bspi *port_of(const char *const name, struct card **const card)
{
    unsigned unit = 0;
    *card = card_of_port(name, "bspi", &unit);
    struct hm2_bspi *const port = *card ? hm2_bspi_port(card_board(*card), unit) : NULL;
    if (*card && !port)
        rtapi_print_msg(RTAPI_MSG_ERR, "hm2_lbp16: %s: the firmware or num_bspis has no such port\n", name);
    return port;
}

static int told(const char *const name, const int err, const struct hm2_diag *const diag)
{
    if (err == 0)
        return 0;
    rtapi_print_msg(RTAPI_MSG_ERR, "hm2_lbp16: %s: %s\n", name, diag->text);
    return -EINVAL;
}

int hm2_bspi_setup_chan(char *const name, const int chan, const int cs, const int bits, const double mhz,
                        const int delay, const int cpol, const int cpha, const int noclear, const int noecho,
                        const int samplelate)
{
    const struct hm2_bspi_channel settings = {.chip_select = (unsigned)cs,
                                              .bits = (unsigned)bits,
                                              .mhz = mhz,
                                              .delay_ns = delay > 0 ? (unsigned)delay : 0,
                                              .cpol = cpol != 0,
                                              .cpha = cpha != 0,
                                              .keep_frame = noclear != 0,
                                              .no_echo = noecho != 0,
                                              .sample_late = samplelate != 0};
    struct card *card;
    struct hm2_diag diag;
    struct hm2_bspi *const port = port_of(name, &card);
    if (!port)
        return -EINVAL;
    hm2_diag_clear(&diag);
    card_pause(card);
    const int err = hm2_bspi_set_channel(port, (unsigned)chan, &settings, &diag);
    card_resume(card);
    return told(name, err, &diag);
}

int hm2_tram_add_bspi_frame(char *const name, const int chan, uint32_t **const wbuff, uint32_t **const rbuff)
{
    struct card *card;
    struct hm2_diag diag;
    struct hm2_bspi *const port = port_of(name, &card);
    if (!port || !wbuff)
        return -EINVAL;
    hm2_diag_clear(&diag);
    card_pause(card);
    hm2_board_change_begin(card_board(card));
    int err = hm2_bspi_add_frame(port, (unsigned)chan, wbuff, rbuff, &diag);
    const int end = hm2_board_change_end(card_board(card), &diag);
    card_resume(card);
    return told(name, err ? err : end, &diag);
}

/* The frames are in the packets already. */
int hm2_allocate_bspi_tram(char *const name)
{
    struct card *card;
    return port_of(name, &card) ? 0 : -EINVAL;
}

/* The FIFOs are cleared ahead of the frames in every cycle. */
int hm2_bspi_clear_fifo(char *const name)
{
    struct card *card;
    return port_of(name, &card) ? 0 : -EINVAL;
}

int hm2_bspi_write_chan(char *const name, const int chan, const uint32_t val)
{
    struct card *card;
    struct hm2_bspi *const port = port_of(name, &card);
    if (!port || !hm2_bspi_channel_known(port, (unsigned)chan))
        return -EINVAL;
    return hm2_bspi_send(port, (unsigned)chan, val) ? 0 : -EAGAIN;
}

static int set_function(const char *const name, int (*const func)(void *subdata), void *const subdata,
                        void (*const set)(struct hm2_bspi *port, hm2_bspi_fn function, void *context))
{
    struct card *card;
    struct hm2_bspi *const port = port_of(name, &card);
    if (!port)
        return -EINVAL;
    card_pause(card);
    set(port, func, subdata);
    card_resume(card);
    return 0;
}

int hm2_bspi_set_read_function(char *const name, int (*const func)(void *subdata), void *const subdata)
{
    return set_function(name, func, subdata, hm2_bspi_on_read);
}

int hm2_bspi_set_write_function(char *const name, int (*const func)(void *subdata), void *const subdata)
{
    return set_function(name, func, subdata, hm2_bspi_on_write);
}

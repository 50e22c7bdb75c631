/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The CS register: what it says, and which of it may be believed. */
#include <stdio.h>

#include <hm2/sslbp.h>

#define MINOR_FAULTS_AT_START 29u /* from here on a START brings the remote's faults (seed 003, "AFTER START") */
#define LOCAL_LIVE            0x3Fu

struct sslbp_status sslbp_status(const uint32_t cs, const unsigned minor, const bool after_doit)
{
    struct sslbp_status status = {
        .local = (uint8_t)cs,
        .status = (uint8_t)(cs >> 8),
        .state = (uint8_t)(cs >> 16),
    };
    if (status.status & SSLBP_COM_ERROR)
        status.live = status.local & LOCAL_LIVE;
    if ((status.status & SSLBP_HAS_FAULT) && (after_doit || minor >= MINOR_FAULTS_AT_START))
        status.remote = (uint8_t)(cs >> 24);
    return status;
}

struct list {
    char *text;
    size_t size, used;
    const char *separator; /* before the next word */
};

static void add(struct list *const list, const char *const word)
{
    if (list->used >= list->size)
        return;
    const int len = snprintf(list->text + list->used, list->size - list->used, "%s%s", list->separator, word);
    list->used += len > 0 ? (size_t)len : 0;
    list->separator = ", ";
}

static void add_bits(struct list *const list, const char *const before, const unsigned bits, const char *const names[8])
{
    if (!bits)
        return;
    if (before[0]) {
        add(list, before);
        list->separator = "";
    }
    for (unsigned i = 0; i < 8; i++)
        if (bits >> i & 1u)
            add(list, names[i]);
    list->separator = "; ";
}

const char *sslbp_status_text(const struct sslbp_status *const status, char *const text, const size_t size)
{
    static const char *const locals[8] = {"CRC error",       "invalid cookie", "overrun",      "time-out",
                                          "extra character", "serial break",   "remote fault", "too many errors"};
    static const char *const states[8] = {"remote fault", "status bit 1",        "status bit 2",      "status bit 3",
                                          "status bit 4", "communication error", "no remote answers", "not ready"};
    static const char *const remotes[8] = {"watchdog has bitten", "not enabled", "over-temperature", "over-current",
                                           "over-voltage",        "low voltage", "illegal mode",     "LBP error"};
    struct list list = {text, size, 0, ""};
    if (size)
        text[0] = '\0';
    add_bits(&list, "", status->local, locals);
    add_bits(&list, "", status->status, states);
    add_bits(&list, "remote: ", status->remote, remotes);
    if (list.used == 0)
        add(&list, "no fault");
    return text;
}

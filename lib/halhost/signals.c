/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Signals and the links between them and pins. */
#include "state.h"

#include <stdlib.h>
#include <string.h>

int hh_signal_new(struct hh *const host, const char *const name, const hal_type_t type, struct hm2_diag *const diag)
{
    if (host->lock & HAL_LOCK_CONFIG)
        return hm2_diag_add(diag, HM2_ERR_STATE, "HAL is locked: no new signals now");
    const int err = hh_check_name("signal", name, diag);
    if (err)
        return err;
    if (type != HAL_BIT && type != HAL_FLOAT && type != HAL_S32 && type != HAL_U32)
        return hm2_diag_add(diag, HM2_ERR_INVALID, "signal '%s': type %d is not bit, float, s32 or u32", name,
                            (int)type);
    if (hh_table_find(&host->signals, name))
        return hm2_diag_add(diag, HM2_ERR_INVALID, "there is already a signal '%s'", name);
    struct hh_signal *const signal = calloc(1, sizeof *signal);
    void *const value = signal ? hh_cell_new(host) : NULL;
    if (!value) {
        free(signal);
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no HAL memory left for signal '%s'", name);
    }
    memcpy(signal->names.name, name, strlen(name) + 1);
    signal->type = type;
    signal->value = value;
    if (hh_table_add(&host->signals, signal)) {
        hh_cell_free(host, value);
        free(signal);
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for signal '%s'", name);
    }
    return 0;
}

/* Which of a signal's counters a pin of this direction counts in. */
static unsigned *counter(struct hh_signal *const signal, const hal_pin_dir_t dir)
{
    return dir == HAL_IN ? &signal->readers : dir == HAL_OUT ? &signal->writers : &signal->bidirs;
}

void hh_pin_unlink(struct hh_pin *const pin)
{
    if (!pin->signal)
        return;
    /* The pin keeps the last value of the signal. */
    hh_store(pin->own, hh_load(pin->type, pin->signal->value));
    hh_point(pin->slot, pin->own);
    (*counter(pin->signal, pin->dir))--;
    pin->signal = NULL;
}

int hh_signal_delete(struct hh *const host, const char *const name, struct hm2_diag *const diag)
{
    if (host->lock & HAL_LOCK_CONFIG)
        return hm2_diag_add(diag, HM2_ERR_STATE, "HAL is locked: no signals are deleted now");
    struct hh_signal *const signal = hh_table_find(&host->signals, name);
    if (!signal)
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "there is no signal '%s'", name);
    for (size_t i = 0; i < host->pins.shown.count; i++) {
        struct hh_pin *const pin = host->pins.shown.items[i];
        if (pin->signal == signal)
            hh_pin_unlink(pin);
    }
    hh_table_remove(&host->signals, signal);
    hh_cell_free(host, signal->value);
    free(signal);
    return 0;
}

/* Name of the pin that is linked to the signal in this direction; there is one when its counter is not 0. */
static const char *linked_pin(const struct hh_signal *const signal, const hal_pin_dir_t dir)
{
    const struct hh *const host = hh_host();
    for (size_t i = 0; i < host->pins.shown.count; i++) {
        const struct hh_pin *const pin = host->pins.shown.items[i];
        if (pin->signal == signal && pin->dir == dir)
            return hh_shown_name(pin);
    }
    return "?";
}

int hh_can_link(const struct hh_pin *const pin, const struct hh_signal *const signal, struct hm2_diag *const diag)
{
    const char *const pin_name = hh_shown_name(pin), *const name = signal->names.name;
    if (pin->signal == signal)
        return 0;
    if (pin->signal)
        return hm2_diag_add(diag, HM2_ERR_INVALID, "pin '%s' is linked to signal '%s', it cannot be linked to '%s' too",
                            pin_name, pin->signal->names.name, name);
    if (pin->type != signal->type)
        return hm2_diag_add(diag, HM2_ERR_INVALID, "pin '%s' is of type %s, signal '%s' of type %s", pin_name,
                            hh_type_name(pin->type), name, hh_type_name(signal->type));
    if (pin->dir != HAL_IN && signal->writers > 0)
        return hm2_diag_add(diag, HM2_ERR_INVALID,
                            "signal '%s' is already driven by output pin '%s': %s pin '%s' "
                            "cannot be linked to it",
                            name, linked_pin(signal, HAL_OUT), pin->dir == HAL_OUT ? "output" : "I/O", pin_name);
    if (pin->dir == HAL_OUT && signal->bidirs > 0)
        return hm2_diag_add(diag, HM2_ERR_INVALID,
                            "signal '%s' is already driven by I/O pin '%s': output pin '%s' cannot be linked to it",
                            name, linked_pin(signal, HAL_IO), pin_name);
    return 0;
}

int hh_link(struct hh *const host, const char *const pin_name, const char *const name, struct hm2_diag *const diag)
{
    if (host->lock & HAL_LOCK_CONFIG)
        return hm2_diag_add(diag, HM2_ERR_STATE, "HAL is locked: no links now");
    struct hh_pin *const pin = hh_table_find(&host->pins, pin_name);
    struct hh_signal *const signal = hh_table_find(&host->signals, name);
    if (!pin)
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "there is no pin '%s'", pin_name);
    if (!signal)
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "there is no signal '%s'", name);
    const int err = hh_can_link(pin, signal, diag);
    if (err || pin->signal == signal)
        return err;
    /* The first pin gives the signal its value. */
    if (signal->readers + signal->writers + signal->bidirs == 0)
        hh_store(signal->value, hh_load(pin->type, pin->own));
    pin->signal = signal;
    (*counter(signal, pin->dir))++;
    hh_point(pin->slot, signal->value);
    return 0;
}

int hh_unlink(struct hh *const host, const char *const name, struct hm2_diag *const diag)
{
    if (host->lock & HAL_LOCK_CONFIG)
        return hm2_diag_add(diag, HM2_ERR_STATE, "HAL is locked: no links are removed now");
    struct hh_pin *const pin = hh_table_find(&host->pins, name);
    if (!pin)
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "there is no pin '%s'", name);
    hh_pin_unlink(pin);
    return 0;
}

/* ---- the calls of components ------------------------------------------------------------------------------------ */

int hal_signal_new(const char *const name, const hal_type_t type)
{
    int status;
    struct hm2_diag diag = {0};
    struct hh *const host = hh_enter("hal_signal_new", &status);
    return host ? hh_report(hh_signal_new(host, name, type, &diag), &diag) : status;
}

int hal_signal_delete(const char *const name)
{
    int status;
    struct hm2_diag diag = {0};
    struct hh *const host = hh_enter("hal_signal_delete", &status);
    return host ? hh_report(hh_signal_delete(host, name, &diag), &diag) : status;
}

int hal_link(const char *const pin, const char *const signal)
{
    int status;
    struct hm2_diag diag = {0};
    struct hh *const host = hh_enter("hal_link", &status);
    return host ? hh_report(hh_link(host, pin, signal, &diag), &diag) : status;
}

int hal_unlink(const char *const pin)
{
    int status;
    struct hm2_diag diag = {0};
    struct hh *const host = hh_enter("hal_unlink", &status);
    return host ? hh_report(hh_unlink(host, pin, &diag), &diag) : status;
}

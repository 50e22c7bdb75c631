/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Signals, links, aliases. */
#include "commands.h"

#include <stdio.h>
#include <string.h>

static int run_newsig(struct hal_session *const session, char *const *const args, const size_t count,
                      struct hm2_diag *const diag)
{
    (void)session;
    (void)count;
    const hal_type_t type = hh_type_from_name(args[1]);
    if (type == HAL_TYPE_UNSPECIFIED)
        return hm2_diag_add(diag, HM2_ERR_INVALID, "unknown signal type '%s' (bit, float, s32 or u32)", args[1]);
    return hh_signal_new(hh_host(), args[0], type, diag);
}

static int run_delsig(struct hal_session *const session, char *const *const args, const size_t count,
                      struct hm2_diag *const diag)
{
    (void)session;
    (void)count;
    struct hh *const host = hh_host();
    if (strcmp(args[0], "all") != 0)
        return hh_signal_delete(host, args[0], diag);
    int err = 0;
    while (host->signals.shown.count > 0 && !err)
        err = hh_signal_delete(host, hh_shown_name(host->signals.shown.items[0]), diag);
    return err;
}

/* Leave arrows out. */
static size_t without_arrows(char *const *const args, const size_t count, const char *names[const HAL_TOKENS_MAX])
{
    size_t kept = 0;
    for (size_t i = 0; i < count; i++) {
        if (!hal_is_arrow(args[i]))
            names[kept++] = args[i];
    }
    return kept;
}

/* Two names, with or without an arrow between them. */
static int two_names(const char *const what, char *const *const args, const size_t count, const char **const first,
                     const char **const second, struct hm2_diag *const diag)
{
    const char *names[HAL_TOKENS_MAX];
    if (without_arrows(args, count, names) != 2)
        return hm2_diag_add(diag, HM2_ERR_INVALID, "%s takes two names", what);
    *first = names[0];
    *second = names[1];
    return 0;
}

static int run_linkps(struct hal_session *const session, char *const *const args, const size_t count,
                      struct hm2_diag *const diag)
{
    (void)session;
    const char *pin = NULL, *signal = NULL;
    const int err = two_names("linkps", args, count, &pin, &signal, diag);
    return err ? err : hh_link(hh_host(), pin, signal, diag);
}

static int run_linksp(struct hal_session *const session, char *const *const args, const size_t count,
                      struct hm2_diag *const diag)
{
    (void)session;
    const char *pin = NULL, *signal = NULL;
    const int err = two_names("linksp", args, count, &signal, &pin, diag);
    return err ? err : hh_link(hh_host(), pin, signal, diag);
}

static int run_unlinkp(struct hal_session *const session, char *const *const args, const size_t count,
                       struct hm2_diag *const diag)
{
    (void)session;
    (void)count;
    return hh_unlink(hh_host(), args[0], diag);
}

/* ---- net -------------------------------------------------------------------------------------------------------- */

/* What the signal will have when the pins before this one are linked: checked without linking anything. */
struct planned {
    struct hh_signal signal; /* a copy that counts */
    const char *writer, *bidir;
};

static int plan_pin(const struct hh *const host, struct planned *const planned, const struct hh_signal *const existing,
                    const char *const name, struct hm2_diag *const diag)
{
    const struct hh_pin *const pin = hh_table_find(&host->pins, name);
    if (!pin)
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "there is no pin '%s'", name);
    if (existing && pin->signal == existing)
        return 0;
    if (planned->signal.type == HAL_TYPE_UNSPECIFIED)
        planned->signal.type = pin->type;
    if (pin->dir == HAL_OUT && (planned->writer || planned->bidir))
        return hm2_diag_add(diag, HM2_ERR_INVALID, "signal '%s' cannot have output pin '%s': it has pin '%s' already",
                            planned->signal.names.name, name, planned->writer ? planned->writer : planned->bidir);
    if (pin->dir == HAL_IO && planned->writer)
        return hm2_diag_add(diag, HM2_ERR_INVALID,
                            "signal '%s' cannot have I/O pin '%s': it has output pin '%s' already",
                            planned->signal.names.name, name, planned->writer);
    const int err = hh_can_link(pin, existing ? existing : &planned->signal, diag);
    if (!err && pin->dir == HAL_OUT)
        planned->writer = name;
    if (!err && pin->dir == HAL_IO)
        planned->bidir = name;
    return err;
}

/* All pins are checked before the signal is created and before any pin is linked. */
static int run_net(struct hal_session *const session, char *const *const args, const size_t count,
                   struct hm2_diag *const diag)
{
    (void)session;
    struct hh *const host = hh_host();
    const char *pins[HAL_TOKENS_MAX];
    const size_t pin_count = without_arrows(args + 1, count - 1, pins);
    if (pin_count == 0)
        return hm2_diag_add(diag, HM2_ERR_INVALID, "net takes at least one pin, none given");
    const struct hh_signal *const existing = hh_table_find(&host->signals, args[0]);
    struct planned planned = {.signal.type = existing ? existing->type : HAL_TYPE_UNSPECIFIED};
    (void)snprintf(planned.signal.names.name, sizeof planned.signal.names.name, "%s", args[0]);
    int err = 0;
    for (size_t i = 0; i < pin_count && !err; i++)
        err = plan_pin(host, &planned, existing, pins[i], diag);
    if (!err && !existing)
        err = hh_signal_new(host, args[0], planned.signal.type, diag);
    for (size_t i = 0; i < pin_count && !err; i++)
        err = hh_link(host, pins[i], args[0], diag);
    return err;
}

static int run_linkpp(struct hal_session *const session, char *const *const args, const size_t count,
                      struct hm2_diag *const diag)
{
    const char *first = NULL, *second = NULL;
    const int err = two_names("linkpp", args, count, &first, &second, diag);
    if (err)
        return err;
    if (hh_table_find(&hh_host()->signals, first))
        return hm2_diag_add(diag, HM2_ERR_INVALID, "there is already a signal '%s'", first);
    char *const words[] = {args[0], args[0], args[count - 1]};
    return run_net(session, words, 3, diag);
}

/* ---- aliases ---------------------------------------------------------------------------------------------------- */

static struct hh_table *alias_table(const char *const type, const char **const what, struct hm2_diag *const diag)
{
    struct hh *const host = hh_host();
    *what = strcmp(type, "pin") == 0 ? "pin" : "parameter";
    if (strcmp(type, "pin") == 0)
        return &host->pins;
    if (strcmp(type, "param") == 0 || strcmp(type, "parameter") == 0)
        return &host->params;
    hm2_diag_add(diag, HM2_ERR_INVALID, "'%s' is neither pin nor param", type);
    return NULL;
}

static int run_alias(struct hal_session *const session, char *const *const args, const size_t count,
                     struct hm2_diag *const diag)
{
    (void)session;
    (void)count;
    const char *what;
    struct hh_table *const table = alias_table(args[0], &what, diag);
    return table ? hh_alias(hh_host(), table, what, args[1], args[2], diag) : HM2_ERR_INVALID;
}

static int run_unalias(struct hal_session *const session, char *const *const args, const size_t count,
                       struct hm2_diag *const diag)
{
    (void)session;
    (void)count;
    const char *what;
    struct hh_table *const table = alias_table(args[0], &what, diag);
    return table ? hh_alias(hh_host(), table, what, args[1], NULL, diag) : HM2_ERR_INVALID;
}

const struct hal_command hal_link_commands[] = {
    {"net", 1, HAL_ANY, run_net, "SIGNAL PIN...", "link pins to a signal, which is created when needed", "sp", false},
    {"newsig", 2, 2, run_newsig, "SIGNAL bit|float|s32|u32", "create a signal", "-w", false},
    {"delsig", 1, 1, run_delsig, "SIGNAL|all", "delete a signal; its pins are unlinked", "s", false},
    {"linkps", 2, 3, run_linkps, "PIN SIGNAL", "link a pin to a signal", "ps", false},
    {"linksp", 2, 3, run_linksp, "SIGNAL PIN", "link a signal to a pin", "sp", false},
    {"linkpp", 2, 3, run_linkpp, "PIN PIN", "link two pins through a signal named after the first", "p", false},
    {"unlinkp", 1, 1, run_unlinkp, "PIN", "unlink a pin; it keeps its value", "p", false},
    {"alias", 3, 3, run_alias, "pin|param NAME ALIAS", "give a pin or parameter a second name", "wP-", false},
    {"unalias", 2, 2, run_unalias, "pin|param NAME", "remove a second name", "wP", false},
    {NULL, 0, 0, NULL, NULL, NULL, NULL, false},
};

/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* show, list, status, timing: tables in halcmd's layout. */
#include "commands.h"

#include <stdio.h>
#include <string.h>

bool hal_filter_name(const struct hal_filter *const filter, const char *const name, const hal_type_t type)
{
    return (filter->type == HAL_TYPE_UNSPECIFIED || type == HAL_TYPE_UNSPECIFIED || filter->type == type) &&
           hal_match(filter->patterns, filter->count, name);
}

/* "-t TYPE" or "-tTYPE" in front of the patterns. */
static int parse_filter(char *const *const args, const size_t count, struct hal_filter *const filter,
                        struct hm2_diag *const diag)
{
    *filter = (struct hal_filter){args, count, HAL_TYPE_UNSPECIFIED};
    if (count == 0 || strncmp(args[0], "-t", 2) != 0)
        return 0;
    const size_t used = args[0][2] ? 1 : 2;
    if (count < used)
        return hm2_diag_add(diag, HM2_ERR_INVALID, "-t needs a type (bit, float, s32 or u32)");
    const char *const name = args[0][2] ? args[0] + 2 : args[1];
    *filter = (struct hal_filter){args + used, count - used, hh_type_from_name(name)};
    return filter->type == HAL_TYPE_UNSPECIFIED
               ? hm2_diag_add(diag, HM2_ERR_INVALID, "unknown type '%s' (bit, float, s32 or u32)", name)
               : 0;
}

/* ---- the tables ------------------------------------------------------------------------------------------------- */

static void show_comps(struct hal_session *const session, const struct hal_filter *const filter)
{
    const struct hh *const host = hh_host();
    hal_print(session, "Loaded HAL Components:\nID      Type  %-*s PID   State\n", (int)HH_NAME_LEN, "Name");
    for (size_t i = host->comps.count; i-- > 0;) {
        const struct hh_comp *const comp = host->comps.items[i];
        if (hal_filter_name(filter, comp->name, HAL_TYPE_UNSPECIFIED))
            hal_print(session, "    %2d  %-4s  %-*s %5s %s\n", comp->id, "RT", (int)HH_NAME_LEN, comp->name, "",
                      comp->ready ? "ready" : "initializing");
    }
    hal_print(session, "\n");
}

static const char *pin_dir(const hal_pin_dir_t dir)
{
    return dir == HAL_IN ? "IN" : dir == HAL_OUT ? "OUT" : "I/O";
}

static void show_pins(struct hal_session *const session, const struct hal_filter *const filter)
{
    const struct hh_list *const pins = &hh_host()->pins.shown;
    char value[HH_VALUE_TEXT];
    hal_print(session, "Component Pins:\nOwner   Type  Dir         Value  Name\n");
    for (size_t i = 0; i < pins->count; i++) {
        const struct hh_pin *const pin = pins->items[i];
        if (!hal_filter_name(filter, hh_shown_name(pin), pin->type))
            continue;
        hh_format_column(hh_load(pin->type, hh_pin_value(pin)), value);
        hal_print(session, "%6d  %-5s %-3s  %12s  %s", pin->comp->id, hh_type_name(pin->type), pin_dir(pin->dir), value,
                  hh_shown_name(pin));
        if (pin->signal)
            hal_print(session, " %s %s", hal_pin_arrow(pin), pin->signal->names.name);
        hal_print(session, "\n");
    }
    hal_print(session, "\n");
}

static void show_aliases(struct hal_session *const session, const struct hal_filter *const filter,
                         const char *const title, const struct hh_table *const table)
{
    hal_print(session, "%s:\n %-*s  %s\n", title, (int)HH_NAME_LEN, "Alias", "Original Name");
    for (size_t i = 0; i < table->shown.count; i++) {
        const struct hh_named *const named = table->shown.items[i];
        if (named->alias[0] && (hal_filter_name(filter, named->alias, HAL_TYPE_UNSPECIFIED) ||
                                hal_filter_name(filter, named->name, HAL_TYPE_UNSPECIFIED)))
            hal_print(session, " %-*s  %s\n", (int)HH_NAME_LEN, named->alias, named->name);
    }
    hal_print(session, "\n");
}

static void show_pin_aliases(struct hal_session *const session, const struct hal_filter *const filter)
{
    show_aliases(session, filter, "Pin Aliases", &hh_host()->pins);
}

static void show_param_aliases(struct hal_session *const session, const struct hal_filter *const filter)
{
    show_aliases(session, filter, "Parameter Aliases", &hh_host()->params);
}

/* Arrow as seen from the signal. */
static const char *signal_arrow(const struct hh_pin *const pin)
{
    return pin->dir == HAL_IN ? "==>" : pin->dir == HAL_OUT ? "<==" : "<=>";
}

static void show_signals(struct hal_session *const session, const struct hal_filter *const filter)
{
    const struct hh *const host = hh_host();
    char value[HH_VALUE_TEXT];
    hal_print(session, "Signals:\nType          Value  Name     (linked to)\n");
    for (size_t i = 0; i < host->signals.shown.count; i++) {
        const struct hh_signal *const signal = host->signals.shown.items[i];
        if (!hal_filter_name(filter, signal->names.name, signal->type))
            continue;
        hh_format_column(hh_load(signal->type, signal->value), value);
        hal_print(session, "%-5s  %12s  %s\n", hh_type_name(signal->type), value, signal->names.name);
        for (size_t p = 0; p < host->pins.shown.count; p++) {
            const struct hh_pin *const pin = host->pins.shown.items[p];
            if (pin->signal == signal)
                hal_print(session, "%25s%s %s\n", "", signal_arrow(pin), hh_shown_name(pin));
        }
    }
    hal_print(session, "\n");
}

static void show_params(struct hal_session *const session, const struct hal_filter *const filter)
{
    const struct hh_list *const params = &hh_host()->params.shown;
    char value[HH_VALUE_TEXT];
    hal_print(session, "Parameters:\nOwner   Type  Dir         Value  Name\n");
    for (size_t i = 0; i < params->count; i++) {
        const struct hh_param *const param = params->items[i];
        if (!hal_filter_name(filter, hh_shown_name(param), param->type))
            continue;
        hh_format_column(hh_load(param->type, param->value), value);
        hal_print(session, "%6d  %-5s %-3s  %12s  %s\n", param->comp->id, hh_type_name(param->type),
                  param->dir == HAL_RO ? "RO" : "RW", value, hh_shown_name(param));
    }
    hal_print(session, "\n");
}

static void show_functs(struct hal_session *const session, const struct hal_filter *const filter)
{
    const struct hh_list *const functs = &hh_host()->functs.shown;
    hal_print(session, "Exported Functions:\nOwner   CodeAddr  Arg       FP   Users  Name\n");
    for (size_t i = 0; i < functs->count; i++) {
        const struct hh_funct *const funct = functs->items[i];
        if (hal_filter_name(filter, funct->names.name, HAL_TYPE_UNSPECIFIED))
            hal_print(session, " %05d  %012lx  %012lx  %-3s  %5u   %s\n", funct->comp->id,
                      (unsigned long)(uintptr_t)funct->code, (unsigned long)(uintptr_t)funct->arg,
                      funct->uses_fp ? "YES" : "NO", funct->users, funct->names.name);
    }
    hal_print(session, "\n");
}

static void show_threads(struct hal_session *const session, const struct hal_filter *const filter)
{
    const struct hh *const host = hh_host();
    hal_print(session, "Realtime Threads:\n     Period  FP     Name               (     Time, Max-Time )\n");
    for (size_t i = host->threads.count; i-- > 0;) {
        const struct hh_thread *const thread = host->threads.items[i];
        const struct hh_schedule *const schedule = atomic_load(&thread->schedule);
        if (!hal_filter_name(filter, thread->names.name, HAL_TYPE_UNSPECIFIED))
            continue;
        hal_print(session, "%11ld  %-3s  %20s ( %8d, %8d )\n", thread->period_ns, thread->uses_fp ? "YES" : "NO",
                  thread->names.name, hh_load(HAL_S32, *thread->time).s, hh_load(HAL_S32, thread->tmax).s);
        for (size_t f = 0; schedule && f < schedule->count; f++)
            hal_print(session, "%19zu %s\n", f + 1, schedule->functs[f]->names.name);
    }
    hal_print(session, "\n");
}

/* ---- show ------------------------------------------------------------------------------------------------------- */

static const struct {
    enum hal_kind kind;
    void (*show)(struct hal_session *session, const struct hal_filter *filter);
} shows[] = {
    {HAL_KIND_COMP, show_comps},   {HAL_KIND_PIN, show_pins},       {HAL_KIND_PIN_ALIAS, show_pin_aliases},
    {HAL_KIND_SIG, show_signals},  {HAL_KIND_PARAM, show_params},   {HAL_KIND_PARAM_ALIAS, show_param_aliases},
    {HAL_KIND_FUNCT, show_functs}, {HAL_KIND_THREAD, show_threads},
};

static const struct {
    const char *word;
    unsigned kinds;
} show_types[] = {
    {"all", 0xFF},
    {"comp", HAL_KIND_COMP},
    {"pin", HAL_KIND_PIN},
    {"sig", HAL_KIND_SIG},
    {"signal", HAL_KIND_SIG},
    {"param", HAL_KIND_PARAM},
    {"parameter", HAL_KIND_PARAM},
    {"funct", HAL_KIND_FUNCT},
    {"function", HAL_KIND_FUNCT},
    {"thread", HAL_KIND_THREAD},
    {"alias", HAL_KIND_PIN_ALIAS | HAL_KIND_PARAM_ALIAS},
};

static unsigned kinds_of(const char *const word)
{
    for (size_t i = 0; i < sizeof show_types / sizeof show_types[0]; i++) {
        if (strcmp(show_types[i].word, word) == 0)
            return show_types[i].kinds;
    }
    return 0;
}

static int run_show(struct hal_session *const session, char *const *const args, const size_t count,
                    struct hm2_diag *const diag)
{
    const unsigned kinds = kinds_of(count > 0 ? args[0] : "all");
    if (!kinds)
        return hm2_diag_add(diag, HM2_ERR_INVALID,
                            "cannot show '%s' (all, comp, pin, sig, param, funct, thread or alias)", args[0]);
    struct hal_filter filter;
    const int err = parse_filter(args + (count > 0), count - (count > 0), &filter, diag);
    if (err)
        return err;
    if (session->options.json) {
        hal_show_json(session, kinds, &filter);
        return 0;
    }
    for (size_t i = 0; i < sizeof shows / sizeof shows[0]; i++) {
        if (kinds & shows[i].kind)
            shows[i].show(session, &filter);
    }
    return 0;
}

/* ---- list ------------------------------------------------------------------------------------------------------- */

static void list_named(struct hal_session *const session, const struct hal_filter *const filter,
                       const struct hh_list *const list, hal_type_t (*const type_of)(const void *))
{
    for (size_t i = 0; i < list->count; i++) {
        const char *const name = hh_shown_name(list->items[i]);
        if (hal_filter_name(filter, name, type_of ? type_of(list->items[i]) : HAL_TYPE_UNSPECIFIED))
            hal_print(session, "%s ", name);
    }
}

static hal_type_t type_of_pin(const void *const pin)
{
    return ((const struct hh_pin *)pin)->type;
}

static hal_type_t type_of_param(const void *const param)
{
    return ((const struct hh_param *)param)->type;
}

static hal_type_t type_of_signal(const void *const signal)
{
    return ((const struct hh_signal *)signal)->type;
}

static int run_list(struct hal_session *const session, char *const *const args, const size_t count,
                    struct hm2_diag *const diag)
{
    const struct hh *const host = hh_host();
    struct hal_filter filter;
    const int err = parse_filter(args + 1, count - 1, &filter, diag);
    if (err)
        return err;
    switch (kinds_of(args[0])) {
    case HAL_KIND_COMP:
        for (size_t i = host->comps.count; i-- > 0;) {
            const struct hh_comp *const comp = host->comps.items[i];
            if (hal_filter_name(&filter, comp->name, HAL_TYPE_UNSPECIFIED))
                hal_print(session, "%s ", comp->name);
        }
        break;
    case HAL_KIND_PIN:
        list_named(session, &filter, &host->pins.shown, type_of_pin);
        break;
    case HAL_KIND_SIG:
        list_named(session, &filter, &host->signals.shown, type_of_signal);
        break;
    case HAL_KIND_PARAM:
        list_named(session, &filter, &host->params.shown, type_of_param);
        break;
    case HAL_KIND_FUNCT:
        list_named(session, &filter, &host->functs.shown, NULL);
        break;
    case HAL_KIND_THREAD:
        for (size_t i = host->threads.count; i-- > 0;) {
            const struct hh_thread *const thread = host->threads.items[i];
            if (hal_filter_name(&filter, thread->names.name, HAL_TYPE_UNSPECIFIED))
                hal_print(session, "%s ", thread->names.name);
        }
        break;
    default:
        return hm2_diag_add(diag, HM2_ERR_INVALID, "cannot list '%s' (comp, pin, sig, param, funct or thread)",
                            args[0]);
    }
    hal_print(session, "\n");
    return 0;
}

/* ---- status, locks ---------------------------------------------------------------------------------------------- */

static const struct {
    unsigned char bit;
    const char *text;
} locks[] = {
    {HAL_LOCK_LOAD, "HAL_LOCK_LOAD    - loading of new components is locked"},
    {HAL_LOCK_CONFIG, "HAL_LOCK_CONFIG  - link and addf is locked"},
    {HAL_LOCK_PARAMS, "HAL_LOCK_PARAMS  - setting params is locked"},
    {HAL_LOCK_RUN, "HAL_LOCK_RUN     - running/stopping HAL is locked"},
};

static void status_lock(struct hal_session *const session)
{
    const unsigned char lock = hh_host()->lock;
    hal_print(session, "HAL locking status:\n  current lock value %d (%02x)\n", lock, lock);
    if (lock == HAL_LOCK_NONE)
        hal_print(session, "  HAL_LOCK_NONE - nothing is locked\n");
    for (size_t i = 0; i < sizeof locks / sizeof locks[0]; i++) {
        if (lock & locks[i].bit)
            hal_print(session, "  %s\n", locks[i].text);
    }
}

static void status_memory(struct hal_session *const session)
{
    const struct hh *const host = hh_host();
    hal_print(session, "HAL memory status\n  used/total shared memory:   %zu/%zu\n", host->memory_used,
              host->options.memory_bytes);
    hal_print(session, "  active/recycled components: %zu/0\n", host->comps.count);
    hal_print(session, "  active/recycled pins:       %zu/0\n", host->pins.shown.count);
    hal_print(session, "  active/recycled parameters: %zu/0\n", host->params.shown.count);
    hal_print(session, "  active/recycled aliases:    %zu/0\n", host->pins.aliased.count + host->params.aliased.count);
    hal_print(session, "  active/recycled signals:    %zu/%zu\n", host->signals.shown.count, host->free_cells.count);
    hal_print(session, "  active/recycled functions:  %zu/0\n", host->functs.shown.count);
    hal_print(session, "  active/recycled threads:    %zu/0\n", host->threads.count);
}

static int run_status(struct hal_session *const session, char *const *const args, const size_t count,
                      struct hm2_diag *const diag)
{
    const char *const type = count > 0 ? args[0] : "all";
    const bool all = strcmp(type, "all") == 0, lock = strcmp(type, "lock") == 0, memory = strcmp(type, "mem") == 0;
    if (!all && !lock && !memory)
        return hm2_diag_add(diag, HM2_ERR_INVALID, "no status of '%s' (lock, mem or all)", type);
    if (all || lock)
        status_lock(session);
    if (all || memory)
        status_memory(session);
    return 0;
}

static int set_lock(const char *const word, const unsigned char none, struct hm2_diag *const diag)
{
    if (strcmp(word, "none") == 0)
        hh_host()->lock = none;
    else if (strcmp(word, "tune") == 0)
        hh_host()->lock = HAL_LOCK_TUNE;
    else if (strcmp(word, "all") == 0)
        hh_host()->lock = none == HAL_LOCK_ALL ? HAL_LOCK_NONE : HAL_LOCK_ALL;
    else
        return hm2_diag_add(diag, HM2_ERR_INVALID, "'%s' is not one of all, tune and none", word);
    return 0;
}

static int run_lock(struct hal_session *const session, char *const *const args, const size_t count,
                    struct hm2_diag *const diag)
{
    (void)session;
    return set_lock(count > 0 ? args[0] : "all", HAL_LOCK_NONE, diag);
}

static int run_unlock(struct hal_session *const session, char *const *const args, const size_t count,
                      struct hm2_diag *const diag)
{
    (void)session;
    return set_lock(count > 0 ? args[0] : "all", HAL_LOCK_ALL, diag);
}

const struct hal_command hal_show_commands[] = {
    {"show", 0, HAL_ANY, run_show, "[all|comp|pin|sig|param|funct|thread|alias [-t TYPE] [PATTERN...]]",
     "print objects; a pattern is a beginning or a shell pattern", "wP", false},
    {"list", 1, HAL_ANY, run_list, "comp|pin|sig|param|funct|thread [-t TYPE] [PATTERN...]", "print names on one line",
     "wP", false},
    {"status", 0, 1, run_status, "[lock|mem|all]", "print locks and use of memory", "w", false},
    {"lock", 0, 1, run_lock, "[all|tune|none]", "forbid changes", "w", false},
    {"unlock", 0, 1, run_unlock, "[all|tune]", "allow changes again", "w", false},
    {NULL, 0, 0, NULL, NULL, NULL, NULL, false},
};

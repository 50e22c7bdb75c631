/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* save: the present configuration as HAL commands, in halcmd's forms. */
#include "commands.h"

#include <string.h>

static void save_comps(struct hal_session *const session, const bool arrows)
{
    (void)arrows;
    const struct hh *const host = hh_host();
    hal_print(session, "# components\n");
    for (size_t i = 0; i < host->comps.count; i++) {
        const struct hh_comp *const comp = host->comps.items[i];
        if (comp->module && strcmp(hh_module_name(comp->module), comp->name) == 0)
            hal_print(session, "loadrt %s %s\n", comp->name, hh_module_arguments(comp->module));
        else
            hal_print(session, "#loadrt %s  (not loaded by loadrt, no args saved)\n", comp->name);
    }
}

static void save_alias_table(struct hal_session *const session, const char *const word,
                             const struct hh_table *const table)
{
    hal_print(session, "# %s aliases\n", word);
    for (size_t i = 0; i < table->shown.count; i++) {
        const struct hh_named *const named = table->shown.items[i];
        if (named->alias[0])
            hal_print(session, "alias %s %s %s\n", word, named->name, named->alias);
    }
}

static void save_aliases(struct hal_session *const session, const bool arrows)
{
    (void)arrows;
    save_alias_table(session, "pin", &hh_host()->pins);
    save_alias_table(session, "param", &hh_host()->params);
}

static bool is_linked(const struct hh_signal *const signal)
{
    return signal->readers + signal->writers + signal->bidirs > 0;
}

static void newsig(struct hal_session *const session, const struct hh_signal *const signal)
{
    hal_print(session, "newsig %s %-5s\n", signal->names.name, hh_type_name(signal->type));
}

static void save_signals(struct hal_session *const session, const bool unlinked_only)
{
    const struct hh_list *const signals = &hh_host()->signals.shown;
    hal_print(session, "# signals\n");
    for (size_t i = 0; i < signals->count; i++) {
        if (!unlinked_only || !is_linked(signals->items[i]))
            newsig(session, signals->items[i]);
    }
}

static void save_links(struct hal_session *const session, const bool arrows)
{
    const struct hh_list *const pins = &hh_host()->pins.shown;
    hal_print(session, "# links\n");
    for (size_t i = 0; i < pins->count; i++) {
        const struct hh_pin *const pin = pins->items[i];
        if (pin->signal)
            hal_print(session, "linkps %s %s %s\n", hh_shown_name(pin), arrows ? hal_pin_arrow(pin) : "",
                      pin->signal->names.name);
    }
}

static const char *arrow_to(const struct hh_pin *const pin)
{
    return pin->dir == HAL_IN ? "==>" : pin->dir == HAL_OUT ? "<==" : "<=>";
}

static void save_nets_long(struct hal_session *const session, const bool arrows)
{
    const struct hh *const host = hh_host();
    hal_print(session, "# nets\n");
    for (size_t i = 0; i < host->signals.shown.count; i++) {
        const struct hh_signal *const signal = host->signals.shown.items[i];
        newsig(session, signal);
        for (size_t p = 0; p < host->pins.shown.count; p++) {
            const struct hh_pin *const pin = host->pins.shown.items[p];
            if (pin->signal == signal)
                hal_print(session, "linksp %s %s %s\n", signal->names.name, arrows ? arrow_to(pin) : "",
                          hh_shown_name(pin));
        }
    }
}

/* Pins of one direction of a signal. halcmd puts an arrow between pins: before every I/O pin, and before the first
 * input. Returns whether the line has pins now. */
static bool net_pins(struct hal_session *const session, const struct hh_signal *const signal, const hal_pin_dir_t dir,
                     bool before)
{
    const struct hh_list *const pins = &hh_host()->pins.shown;
    bool arrow = dir != HAL_OUT;
    for (size_t i = 0; i < pins->count; i++) {
        const struct hh_pin *const pin = pins->items[i];
        if (pin->signal != signal || pin->dir != dir)
            continue;
        if (before && arrow)
            hal_print(session, dir == HAL_IO ? " <=>" : " =>");
        hal_print(session, " %s", hh_shown_name(pin));
        before = true;
        arrow = dir == HAL_IO;
    }
    return before;
}

static void net_all_pins(struct hal_session *const session, const struct hh_signal *const signal)
{
    const struct hh_list *const pins = &hh_host()->pins.shown;
    for (size_t i = 0; i < pins->count; i++) {
        const struct hh_pin *const pin = pins->items[i];
        if (pin->signal == signal)
            hal_print(session, " %s", hh_shown_name(pin));
    }
}

static void save_nets(struct hal_session *const session, const bool arrows)
{
    const struct hh_list *const signals = &hh_host()->signals.shown;
    hal_print(session, "# nets\n");
    for (size_t i = 0; i < signals->count; i++) {
        const struct hh_signal *const signal = signals->items[i];
        if (!is_linked(signal))
            continue;
        hal_print(session, "net %s", signal->names.name);
        if (arrows) {
            bool before = net_pins(session, signal, HAL_OUT, false);
            before = net_pins(session, signal, HAL_IO, before);
            (void)net_pins(session, signal, HAL_IN, before);
        } else {
            net_all_pins(session, signal);
        }
        hal_print(session, "\n");
    }
}

static void setp(struct hal_session *const session, const char *const name, const struct hh_value value)
{
    char text[HH_VALUE_TEXT];
    hh_format_column(value, text);
    hal_print(session, "setp %s %s\n", name, text);
}

static void save_params(struct hal_session *const session, const bool arrows)
{
    (void)arrows;
    const struct hh_list *const params = &hh_host()->params.shown;
    hal_print(session, "# parameter values\n");
    for (size_t i = 0; i < params->count; i++) {
        const struct hh_param *const param = params->items[i];
        if (param->dir != HAL_RO)
            setp(session, hh_shown_name(param), hh_load(param->type, param->value));
    }
}

static void save_pins(struct hal_session *const session, const bool arrows)
{
    (void)arrows;
    const struct hh_list *const pins = &hh_host()->pins.shown;
    hal_print(session, "# unconnected pin values\n");
    for (size_t i = 0; i < pins->count; i++) {
        const struct hh_pin *const pin = pins->items[i];
        if (!pin->signal && pin->dir != HAL_OUT)
            setp(session, hh_shown_name(pin), hh_load(pin->type, pin->own));
    }
}

static void save_threads(struct hal_session *const session, const bool arrows)
{
    (void)arrows;
    const struct hh_list *const threads = &hh_host()->threads;
    hal_print(session, "# realtime thread/function links\n");
    for (size_t i = threads->count; i-- > 0;) {
        const struct hh_thread *const thread = threads->items[i];
        const struct hh_schedule *const schedule = atomic_load(&thread->schedule);
        for (size_t f = 0; schedule && f < schedule->count; f++)
            hal_print(session, "addf %s %s\n", schedule->functs[f]->names.name, thread->names.name);
    }
}

typedef void (*save_function)(struct hal_session *session, bool flag);

static const struct {
    const char *word;
    struct {
        save_function save;
        bool flag;
    } parts[8];
} saves[] = {
    {"all",
     {{save_comps, false},
      {save_aliases, false},
      {save_signals, true},
      {save_nets, true},
      {save_params, false},
      {save_threads, false}}},
    {"allu",
     {{save_comps, false},
      {save_aliases, false},
      {save_signals, true},
      {save_nets, true},
      {save_params, false},
      {save_pins, false},
      {save_threads, false}}},
    {"comp", {{save_comps, false}}},
    {"alias", {{save_aliases, false}}},
    {"sig", {{save_signals, false}}},
    {"signal", {{save_signals, false}}},
    {"sigu", {{save_signals, true}}},
    {"link", {{save_links, false}}},
    {"linka", {{save_links, true}}},
    {"net", {{save_nets_long, false}}},
    {"neta", {{save_nets_long, true}}},
    {"netl", {{save_nets, false}}},
    {"netla", {{save_nets, true}}},
    {"netal", {{save_nets, true}}},
    {"param", {{save_params, false}}},
    {"parameter", {{save_params, false}}},
    {"thread", {{save_threads, false}}},
    {"unconnectedinpins", {{save_pins, false}}},
};

static int run_save(struct hal_session *const session, char *const *const args, const size_t count,
                    struct hm2_diag *const diag)
{
    const char *const word = count > 0 ? args[0] : "all";
    size_t i = 0;
    while (i < sizeof saves / sizeof saves[0] && strcmp(saves[i].word, word) != 0)
        i++;
    if (i == sizeof saves / sizeof saves[0])
        return hm2_diag_add(diag, HM2_ERR_INVALID, "cannot save '%s' (help save lists what can be saved)", word);
    const int err = count > 1 ? hal_open_output(session, args[1], diag) : 0;
    if (err)
        return err;
    for (size_t part = 0; saves[i].parts[part].save; part++)
        saves[i].parts[part].save(session, saves[i].parts[part].flag);
    return count > 1 ? hal_close_output(session, args[1], diag) : 0;
}

const struct hal_command hal_save_commands[] = {
    {"save", 0, 2, run_save,
     "[all|allu|comp|alias|sig|sigu|link|linka|net|neta|netl|netla|param|thread|unconnectedinpins [FILE]]",
     "print the configuration as commands", "w-", false},
    {NULL, 0, 0, NULL, NULL, NULL, NULL, false},
};

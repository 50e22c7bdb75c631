/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "commands.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MAX_WORDS 8

struct words {
    unsigned count;
    char *word[MAX_WORDS];
    char *answer;
    size_t size;
};

static bool say(const struct words *const w, const char *const text)
{
    snprintf(w->answer, w->size, "%s", text);
    return strncmp(text, "error", 5) != 0;
}

static bool number(const char *const text, const long min, const long max, long *const value)
{
    char *end;
    *value = strtol(text, &end, 0);
    return end != text && *end == '\0' && *value >= min && *value <= max;
}

static bool decimal(const char *const text, const long max, long *const value)
{
    char *end;
    *value = strtol(text, &end, 10);
    return *text >= '0' && *text <= '9' && *end == '\0' && *value <= max;
}

/* "SLOT.AXIS" */
static bool read_axis(const char *const text, unsigned *const slot, unsigned *const axis)
{
    const char *const dot = strchr(text, '.');
    char first[3] = "";
    long s, a;
    if (!dot || dot == text || (size_t)(dot - text) >= sizeof first)
        return false;
    memcpy(first, text, (size_t)(dot - text));
    if (!decimal(first, SIM_PPMC_SLOTS - 1, &s) || !decimal(dot + 1, SIM_PPMC_AXES - 1, &a))
        return false;
    *slot = (unsigned)s;
    *axis = (unsigned)a;
    return true;
}

static bool on_off(const char *const text, bool *const on)
{
    *on = strcmp(text, "on") == 0;
    return *on || strcmp(text, "off") == 0;
}

/* ---- commands ---------------------------------------------------------------------------------------------------- */

static bool board(struct sim_ppmc *const bus, const struct words *const w)
{
    long slot, id = 0x14;
    if (!number(w->word[1], 0, SIM_PPMC_SLOTS - 1, &slot) || (w->count > 2 && !number(w->word[2], 1, 0xFF, &id)))
        return say(w, "error: board SLOT [ID], slot 0 to 15, ID such as 0x14");
    return say(w, sim_ppmc_add(bus, (unsigned)slot, (uint8_t)id) == 0
                      ? "ok"
                      : "error: the slot is taken, or odd for a board of two slots");
}

static bool rate(struct sim_ppmc *const bus, const struct words *const w)
{
    unsigned slot, axis;
    long edges;
    if (!read_axis(w->word[1], &slot, &axis) || !number(w->word[2], -100000000, 100000000, &edges))
        return say(w, "error: rate SLOT.AXIS EDGES_PER_SECOND, up to 100000000 either way");
    sim_ppmc_set_rate(bus, slot, axis, (int32_t)edges);
    return say(w, "ok");
}

static bool jump(struct sim_ppmc *const bus, const struct words *const w)
{
    unsigned slot, axis;
    long edges;
    if (!read_axis(w->word[1], &slot, &axis) || !number(w->word[2], -1000, 1000, &edges))
        return say(w, "error: jump SLOT.AXIS EDGES");
    sim_ppmc_jump(bus, slot, axis, (int)edges);
    return say(w, "ok");
}

static bool set_index(struct sim_ppmc *const bus, const struct words *const w)
{
    unsigned slot, axis;
    long counts, offset = 0, width = 1;
    if (!read_axis(w->word[1], &slot, &axis) || !number(w->word[2], 2, INT32_MAX, &counts) ||
        (w->count > 3 && !number(w->word[3], 0, INT32_MAX, &offset)) ||
        (w->count > 4 && !number(w->word[4], 1, counts - 1, &width)))
        return say(w, "error: index SLOT.AXIS COUNTS [OFFSET [WIDTH]]");
    sim_ppmc_set_index(bus, slot, axis, (uint32_t)counts, (uint32_t)offset, (uint32_t)width);
    return say(w, "ok");
}

static bool wire(struct sim_ppmc *const bus, const struct words *const w)
{
    unsigned slot, axis;
    bool on;
    if (!read_axis(w->word[1], &slot, &axis) || !on_off(w->word[2], &on))
        return say(w, "error: wire SLOT.AXIS on|off");
    sim_ppmc_break_wire(bus, slot, axis, !on);
    return say(w, "ok");
}

static bool power(struct sim_ppmc *const bus, const struct words *const w)
{
    long slot;
    bool on;
    if (!number(w->word[1], 0, SIM_PPMC_SLOTS - 1, &slot) || !on_off(w->word[2], &on))
        return say(w, "error: power SLOT on|off");
    sim_ppmc_power(bus, (unsigned)slot, on);
    return say(w, "ok");
}

static bool cable(struct sim_ppmc *const bus, const struct words *const w)
{
    bool on;
    if (!on_off(w->word[1], &on))
        return say(w, "error: cable on|off");
    sim_ppmc_unplug(bus, !on);
    return say(w, "ok");
}

static bool reset(struct sim_ppmc *const bus, const struct words *const w)
{
    sim_ppmc_reset(bus);
    return say(w, "ok");
}

/* Kinds of faults as words, in the order of enum sim_ppmc_fault. */
static const char *const fault_names[SIM_PPMC_FAULTS] = {"timeout", "zeros", "ones", "residue", "skip", "repeat"};

static bool faults(struct sim_ppmc *const bus, const struct words *const w)
{
    unsigned mask = 0;
    long every;
    bool known = number(w->word[1], 0, INT32_MAX, &every);
    for (unsigned i = 2; i < w->count; i++) {
        unsigned kind = 0;
        while (kind < SIM_PPMC_FAULTS && strcmp(fault_names[kind], w->word[i]) != 0)
            kind++;
        known = known && kind < SIM_PPMC_FAULTS;
        mask |= 1u << kind;
    }
    if (!known)
        return say(w, "error: faults EVERY [timeout] [zeros] [ones] [residue] [skip] [repeat], EVERY 0 = none");
    sim_ppmc_set_faults(bus, (uint32_t)every, w->count > 2 ? mask : 1u << SIM_PPMC_FAULT_TIMEOUT);
    return say(w, "ok");
}

static bool show(struct sim_ppmc *const bus, const struct words *const w)
{
    unsigned slot, axis;
    if (!read_axis(w->word[1], &slot, &axis))
        return say(w, "error: show SLOT.AXIS");
    const struct sim_ppmc_truth t = sim_ppmc_truth(bus, slot, axis);
    snprintf(w->answer, w->size,
             "shaft %" PRId64 " counted %" PRId64 " latched %" PRId64 " indices %" PRIu64 " presets %" PRIu64
             " preset-at %" PRId64 " illegal %" PRIu64,
             t.shaft, t.counted, t.held_counted, t.indices, t.presets, t.preset_at, t.illegal);
    return true;
}

static bool stats(struct sim_ppmc *const bus, const struct words *const w)
{
    const struct sim_ppmc_stats s = sim_ppmc_stats(bus);
    size_t used = (size_t)snprintf(
        w->answer, w->size, "cycles %" PRIu64 " unanswered %" PRIu64 " latches %" PRIu64 " undocumented %" PRIu64,
        s.cycles, s.unanswered, s.latches, s.undocumented);
    for (unsigned i = 0; i < SIM_PPMC_FAULTS && used < w->size; i++)
        used += (size_t)snprintf(w->answer + used, w->size - used, " %s %" PRIu64, fault_names[i], s.faults[i]);
    return true;
}

static const struct {
    const char *name;
    unsigned least; /* words, with the name */
    bool (*run)(struct sim_ppmc *bus, const struct words *words);
} commands[] = {
    {"board", 2, board},   {"rate", 3, rate},   {"jump", 3, jump},   {"index", 3, set_index},
    {"wire", 3, wire},     {"power", 3, power}, {"cable", 2, cable}, {"reset", 1, reset},
    {"faults", 2, faults}, {"show", 2, show},   {"stats", 1, stats},
};

bool command_run(struct sim_ppmc *const bus, const char *const line, char *const answer, const size_t size)
{
    char text[256], *rest = NULL;
    struct words w = {.answer = answer, .size = size};
    snprintf(text, sizeof text, "%s", line);
    for (char *word = strtok_r(text, " \t\n", &rest); word && w.count < MAX_WORDS;
         word = strtok_r(NULL, " \t\n", &rest))
        w.word[w.count++] = word;
    for (size_t i = 0; w.count > 0 && i < sizeof commands / sizeof commands[0]; i++)
        if (strcmp(commands[i].name, w.word[0]) == 0 && w.count >= commands[i].least)
            return commands[i].run(bus, &w);
    return say(&w, "error: unknown command or too few words, see hm2ppmcsim(1)");
}

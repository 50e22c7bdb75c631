/* SPDX-License-Identifier: GPL-2.0-or-later */
/* hm2points: every pin and parameter that a card's modules can offer, from the tables that create them. */
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <hm2/board.h>
#include <hm2/module.h>

#include "../common/json_string.h"

static const char *const type_names[] = {
    [HM2_BIT] = "bit", [HM2_S32] = "s32", [HM2_U32] = "u32", [HM2_FLOAT] = "float"};
static const char *const dir_names[] = {
    [HM2_PIN_IN] = "IN", [HM2_PIN_OUT] = "OUT", [HM2_PIN_IO] = "IO", [HM2_PARAM_RO] = "RO", [HM2_PARAM_RW] = "RW"};

static bool is_param(const struct hm2_point *const point)
{
    return point->dir == HM2_PARAM_RO || point->dir == HM2_PARAM_RW;
}

/* One way of printing: begin/end around everything, group before each table, row for each point. */
struct style {
    const char *option;
    void (*begin)(void);
    void (*group)(const char *prefix, const struct hm2_point_group *group);
    void (*row)(const char *prefix, const struct hm2_point *point, bool first);
    void (*end)(void);
};

static void full_name(char *const buf, const size_t size, const char *const prefix, const char *const name)
{
    snprintf(buf, size, "%s%s%s", prefix, prefix[0] ? "." : "", name);
}

/* ---- tab-separated text ------------------------------------------------------------------------------------------ */

static void text_begin(void)
{
    puts("name\tkind\ttype\tdir\tdefault\tunit\thelp");
}

static void text_row(const char *const prefix, const struct hm2_point *const point, const bool first)
{
    char name[256];
    (void)first;
    full_name(name, sizeof name, prefix, point->name);
    printf("%s\t%s\t%s\t%s\t%.10g\t%s\t%s\n", name, is_param(point) ? "param" : "pin", type_names[point->type],
           dir_names[point->dir], point->initial, point->unit, point->help);
}

static void no_group(const char *const prefix, const struct hm2_point_group *const group)
{
    (void)prefix;
    (void)group;
}

static void nothing(void)
{
}

/* ---- JSON ---------------------------------------------------------------------------------------------------------*/

static void json_begin(void)
{
    puts("[");
}

static void json_row(const char *const prefix, const struct hm2_point *const point, const bool first)
{
    char name[256];
    full_name(name, sizeof name, prefix, point->name);
    printf("%s  {\"name\": ", first ? "" : ",\n");
    json_string(stdout, name);
    printf(", \"kind\": \"%s\", \"type\": \"%s\", \"dir\": \"%s\", \"default\": %.10g, \"unit\": ",
           is_param(point) ? "param" : "pin", type_names[point->type], dir_names[point->dir], point->initial);
    json_string(stdout, point->unit);
    printf(", \"help\": ");
    json_string(stdout, point->help);
    putchar('}');
}

static void json_end(void)
{
    puts("\n]");
}

/* ---- mdoc, for the manual page ----------------------------------------------------------------------------------- */

/* A dot or quote at the start of a line, and backslashes, mean something to roff. */
static void mdoc_text(const char *const text)
{
    if (*text == '.' || *text == '\'')
        fputs("\\&", stdout);
    for (const char *c = text; *c; c++)
        if (*c == '\\')
            fputs("\\e", stdout);
        else if (*c == '-')
            fputs("\\-", stdout);
        else
            putchar(*c);
}

static void mdoc_group(const char *const prefix, const struct hm2_point_group *const group)
{
    printf(".Ss ");
    mdoc_text(prefix[0] ? prefix : "board");
    putchar('\n');
    if (group->condition)
        printf("Exist %s.\n", group->condition);
    puts(".Bl -tag -width Ds -compact");
}

static void mdoc_row(const char *const prefix, const struct hm2_point *const point, const bool first)
{
    (void)prefix;
    (void)first;
    fputs(".It Sy ", stdout);
    mdoc_text(point->name);
    printf(" Pq %s %s %s , default %.10g%s%s\n", is_param(point) ? "param" : "pin", type_names[point->type],
           dir_names[point->dir], point->initial, point->unit[0] ? " " : "", point->unit);
    mdoc_text(point->help);
    puts(".");
}

static const struct style styles[] = {
    {"text", text_begin, no_group, text_row, nothing},
    {"json", json_begin, no_group, json_row, json_end},
    {"mdoc", nothing, mdoc_group, mdoc_row, nothing},
};

/* ---- walk over the tables ---------------------------------------------------------------------------------------- */

static void print_groups(const struct style *const style, const struct hm2_point_group *group, bool *const first)
{
    const bool mdoc = style->group == mdoc_group;
    for (; group && group->points; group++) {
        style->group(group->prefix, group);
        for (size_t i = 0; i < group->count; i++) {
            style->row(group->prefix, &group->points[i], *first);
            *first = false;
        }
        if (mdoc)
            puts(".El");
    }
}

static void print_all(const struct style *const style)
{
    bool first = true;
    style->begin();
    print_groups(style, hm2_board_point_groups(), &first);
    for (size_t i = 0; hm2_module_types[i]; i++)
        print_groups(style, hm2_module_types[i]->groups, &first);
    style->end();
}

static const char usage[] =
    "Usage: hm2points [--text | --json | --mdoc]\n"
    "List every pin and parameter that the modules of a HostMot2 card can offer. Names are\n"
    "below the card's prefix (hm2_7i96s.0.); ## and ### stand for two- and three-digit numbers.\n"
    "\n"
    "  --text     one line each, fields separated by tabs (default)\n"
    "  --json     an array of objects\n"
    "  --mdoc     the sections of the manual page hm2_lbp16(9)\n"
    "  --help     this text\n"
    "  --version  version\n";

int main(const int argc, char **const argv)
{
    static const struct option options[] = {{"text", no_argument, NULL, 0},      {"json", no_argument, NULL, 1},
                                            {"mdoc", no_argument, NULL, 2},      {"help", no_argument, NULL, 'h'},
                                            {"version", no_argument, NULL, 'V'}, {NULL, 0, NULL, 0}};
    const struct style *style = &styles[0];
    int option;
    while ((option = getopt_long(argc, argv, "hV", options, NULL)) != -1) {
        if (option == 'h') {
            fputs(usage, stdout);
            return EXIT_SUCCESS;
        }
        if (option == 'V') {
            puts("hm2points " HM2_VERSION);
            return EXIT_SUCCESS;
        }
        if (option == '?')
            return 2;
        style = &styles[option];
    }
    if (optind < argc) {
        fprintf(stderr, "hm2points: unexpected argument '%s'; see --help\n", argv[optind]);
        return 2;
    }
    print_all(style);
    return fflush(stdout) == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}

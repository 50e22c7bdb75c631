/* SPDX-License-Identifier: GPL-2.0-or-later */
/* hm2can: checks a DBC file, and lists its messages, signals, and the pins that can_io makes of them. */
#include <errno.h>
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../common/whole_file.h"
#include "list.h"

static const char usage[] =
    "Usage: hm2can [--check | --json] [--node NAME] [--floats] FILE\n"
    "Check a DBC file and list its messages and signals, with the pins that can_io(9) makes of them.\n"
    "\n"
    "  -c, --check      say only what is wrong, and one line of numbers\n"
    "  -j, --json       one JSON object\n"
    "  -n, --node NAME  the node that this machine is (can_io's node=)\n"
    "  -f, --floats     types of pins as with can_io's floats=1\n"
    "  -h, --help       this text\n"
    "  -V, --version    version\n"
    "\n"
    "Exit status: 0 the file is good, 1 it is not, 2 wrong usage.\n";

struct options {
    const char *node;
    bool check, json, floats;
};

static int find_node(const struct options *const options, struct listing *const l, struct hm2_diag *const diag)
{
    l->node = -1;
    if (!options->node || !l->dbc)
        return 0;
    l->node = hm2_dbc_node(l->dbc, options->node);
    if (l->node >= 0 && l->node < (int)HM2_DBC_ANYBODY)
        return 0;
    return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "%s: there is no node \"%s\"; BU_ lists them", l->file, options->node);
}

static void print(const struct options *const options, const struct listing *const l)
{
    if (!options->json)
        fputs(l->diag->text, stderr);
    if (options->json)
        list_json(l);
    else if (l->dbc && options->check)
        list_summary(l);
    else if (l->dbc)
        list_text(l);
}

static int look_at(const struct options *const options, const char *const path)
{
    struct hm2_dbc *dbc = NULL;
    struct hm2_diag diag;
    size_t len = 0;
    char *const text = whole_file(path, HM2_DBC_MAX_TEXT, &len);
    if (!text) {
        fprintf(stderr, "hm2can: cannot read %s: %s\n", path, strerror(errno));
        return EXIT_FAILURE;
    }
    hm2_diag_clear(&diag);
    int err = hm2_dbc_read(text, len, path, &dbc, &diag);
    free(text);
    struct listing listing = {.file = path, .dbc = dbc, .diag = &diag, .floats = options->floats};
    if (!err)
        err = find_node(options, &listing, &diag);
    if (err)
        listing.dbc = NULL;
    print(options, &listing);
    hm2_dbc_free(dbc);
    return err || fflush(stdout) != 0 ? EXIT_FAILURE : EXIT_SUCCESS;
}

int main(const int argc, char **const argv)
{
    static const struct option long_options[] = {{"check", no_argument, NULL, 'c'},
                                                 {"json", no_argument, NULL, 'j'},
                                                 {"node", required_argument, NULL, 'n'},
                                                 {"floats", no_argument, NULL, 'f'},
                                                 {"help", no_argument, NULL, 'h'},
                                                 {"version", no_argument, NULL, 'V'},
                                                 {NULL, 0, NULL, 0}};
    struct options options = {0};
    int option;
    while ((option = getopt_long(argc, argv, "cjn:fhV", long_options, NULL)) != -1) {
        if (option == 'h') {
            fputs(usage, stdout);
            return EXIT_SUCCESS;
        }
        if (option == 'V') {
            puts("hm2can " HM2_VERSION);
            return EXIT_SUCCESS;
        }
        if (option == '?')
            return 2;
        options.check = options.check || option == 'c';
        options.json = options.json || option == 'j';
        options.floats = options.floats || option == 'f';
        if (option == 'n')
            options.node = optarg;
    }
    if (optind + 1 != argc) {
        fputs("hm2can: expected one DBC file; see --help\n", stderr);
        return 2;
    }
    return look_at(&options, argv[optind]);
}

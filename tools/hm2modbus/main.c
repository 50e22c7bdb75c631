/* SPDX-License-Identifier: GPL-2.0-or-later */
/* hm2modbus: check the Modbus maps of modbus_io before a machine loads them. */
#include <errno.h>
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <hm2/modbus.h>

#include "../common/whole_file.h"

static const char usage[] = "Usage: hm2modbus --check FILE...\n"
                            "Check Modbus maps, which are files of LinuxCNC's mb2hal and of modbus_io.\n"
                            "\n"
                            "  --check    say what is wrong, with file and line, or what is in it\n"
                            "  --help     this text\n"
                            "  --version  version\n"
                            "\n"
                            "Exit status: 0 all files are good, 1 one is not, 2 wrong command line.\n";

static void describe(const char *const path, const struct hm2_modbus_map *const map)
{
    printf("%s: %s: %u transaction%s, %u link%s\n", path, map->component, map->transaction_count,
           map->transaction_count == 1 ? "" : "s", map->link_count, map->link_count == 1 ? "" : "s");
    for (unsigned i = 0; i < map->transaction_count; i++) {
        const struct hm2_modbus_transaction *const tx = &map->transactions[i];
        const struct hm2_modbus_link *const link = &map->links[tx->link];
        printf("  %s.%s: %s unit %u, function %d, %u to %u\n", map->component, tx->name,
               link->tcp ? link->host : link->device, tx->unit, (int)tx->function, tx->first,
               tx->first + tx->words - 1);
    }
}

static int check(const char *const path)
{
    size_t length;
    struct hm2_modbus_map *map;
    struct hm2_diag diag = {0};
    char *const text = whole_file(path, HM2_MODBUS_FILE_BYTES, &length);
    if (!text) {
        fprintf(stderr, "hm2modbus: %s: cannot be read: %s\n", path, strerror(errno));
        return EXIT_FAILURE;
    }
    const int err = hm2_modbus_parse(text, length, path, &map, &diag);
    free(text);
    fputs(diag.text, stderr);
    if (err)
        return EXIT_FAILURE;
    describe(path, map);
    hm2_modbus_free(map);
    return EXIT_SUCCESS;
}

int main(const int argc, char **const argv)
{
    static const struct option options[] = {{"check", no_argument, NULL, 'c'},
                                            {"help", no_argument, NULL, 'h'},
                                            {"version", no_argument, NULL, 'V'},
                                            {NULL, 0, NULL, 0}};
    int option, checks = 0, status = EXIT_SUCCESS;
    while ((option = getopt_long(argc, argv, "", options, NULL)) != -1) {
        if (option == 'h') {
            fputs(usage, stdout);
            return EXIT_SUCCESS;
        }
        if (option == 'V') {
            puts("hm2modbus " HM2_VERSION);
            return EXIT_SUCCESS;
        }
        if (option == '?')
            return 2;
        checks = 1;
    }
    if (!checks || optind == argc) {
        fputs("hm2modbus: give --check and a file; see --help\n", stderr);
        return 2;
    }
    for (int i = optind; i < argc; i++)
        if (check(argv[i]) != EXIT_SUCCESS)
            status = EXIT_FAILURE;
    if (fflush(stdout) != 0)
        status = EXIT_FAILURE;
    return status;
}

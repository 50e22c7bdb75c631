/* SPDX-License-Identifier: GPL-2.0-or-later */
/* hm2replay: replays folders of recorded firmware traces against the simulated card. */
#include <dirent.h>
#include <errno.h>
#include <getopt.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "../common/json_string.h"
#include "../common/whole_file.h"
#include "replay.h"

enum { EXIT_DIFFERENCE = 1, EXIT_USAGE = 2, EXIT_UNREADABLE = 3 };

#define MAX_FILE_BYTES (256u << 20)

struct settings {
    const char *test;
    bool json, verbose;
};

struct folder {
    const char *path;
    char **names;
    size_t count;
    const struct settings *settings;
    bool *first_result; /* of the JSON list */
};

/* ---- files
 * ----------------------------------------------------------------------------------------------------------- */

static int load(void *const context, const char *const name, char **const text, size_t *const len,
                struct hm2_diag *const diag)
{
    const struct folder *const folder = context;
    if (strchr(name, '/'))
        return hm2_diag_add(diag, HM2_ERR_INVALID, "\"%.80s\" is not the name of a file in the folder.", name);
    char path[PATH_MAX];
    const int n = snprintf(path, sizeof(path), "%s/%s", folder->path, name);
    if (n < 0 || (size_t)n >= sizeof(path))
        return hm2_diag_add(diag, HM2_ERR_RANGE, "The path of %.80s is too long.", name);
    *text = whole_file(path, MAX_FILE_BYTES, len);
    if (*text)
        return 0;
    return errno == ENOENT ? HM2_ERR_NOTFOUND
                           : hm2_diag_add(diag, HM2_ERR_IO, "%s cannot be read: %s.", path, strerror(errno));
}

static bool list(void *const context, const size_t index, char *const name, const size_t size)
{
    const struct folder *const folder = context;
    if (index >= folder->count)
        return false;
    snprintf(name, size, "%s", folder->names[index]);
    return true;
}

static int by_name(const void *const a, const void *const b)
{
    return strcmp(*(char *const *)a, *(char *const *)b);
}

static bool add_name(struct folder *const folder, const char *const name)
{
    char **const names = realloc(folder->names, (folder->count + 1) * sizeof(*names));
    if (!names)
        return false;
    folder->names = names;
    names[folder->count] = strdup(name);
    return names[folder->count++] != NULL;
}

static bool open_folder(struct folder *const folder)
{
    DIR *const dir = opendir(folder->path);
    if (!dir) {
        fprintf(stderr, "hm2replay: %s: %s\n", folder->path, strerror(errno));
        return false;
    }
    bool good = true;
    for (const struct dirent *entry = readdir(dir); entry && good; entry = readdir(dir))
        if (entry->d_name[0] != '.')
            good = add_name(folder, entry->d_name);
    closedir(dir);
    if (good && folder->count)
        qsort(folder->names, folder->count, sizeof(*folder->names), by_name);
    return good;
}

static void close_folder(struct folder *const folder)
{
    for (size_t i = 0; i < folder->count; i++)
        free(folder->names[i]);
    free(folder->names);
}

/* Last component of a path, without trailing slashes. */
static void base_name(const char *const path, char *const name, const size_t size)
{
    size_t end = strlen(path);
    while (end > 1 && path[end - 1] == '/')
        end--;
    size_t start = end;
    while (start > 0 && path[start - 1] != '/')
        start--;
    snprintf(name, size, "%.*s", (int)(end - start), path + start);
}

/* ---- results
 * ---------------------------------------------------------------------------------------------------------- */

static void on_result(void *const context, const char *const test, const bool passed, const char *const difference)
{
    const struct folder *const folder = context;
    if (folder->settings->json) {
        printf("%s\n    {\"folder\": ", *folder->first_result ? "" : ",");
        *folder->first_result = false;
        json_string(stdout, folder->path);
        printf(", \"test\": ");
        json_string(stdout, test);
        printf(", \"passed\": %s, \"difference\": ", passed ? "true" : "false");
        json_string(stdout, difference);
        printf("}");
    } else {
        printf("%s %s/%s%s%s\n", passed ? "ok" : "not ok", folder->path, test, passed ? "" : ": ", difference);
    }
}

static bool replay_one(const char *const path, const struct settings *const settings, bool *const first_result,
                       struct replay_totals *const totals)
{
    char name[NAME_MAX + 1];
    char resolved[PATH_MAX];
    struct folder folder = {.path = path, .settings = settings, .first_result = first_result};
    base_name(path, name, sizeof(name));
    if (name[0] == '.' && realpath(path, resolved)) /* "." and ".." have a name of their own */
        base_name(resolved, name, sizeof(name));
    bool good = open_folder(&folder);
    if (good) {
        const struct replay_files files = {.load = load, .list = list, .context = &folder};
        const struct replay_options options = {.only_test = settings->test, .on_result = on_result, .context = &folder};
        const struct replay_totals before = *totals;
        struct hm2_diag *const diag = calloc(1, sizeof(*diag));
        good = diag && replay_folder(name, &files, &options, totals, diag) == 0;
        if (!good)
            fprintf(stderr, "hm2replay: %s: %s", path, diag ? diag->text : "no memory\n");
        else if (settings->verbose && !settings->json)
            printf("# %s: %u passed, %u failed\n", path, totals->passed - before.passed,
                   totals->failed - before.failed);
        free(diag);
    }
    close_folder(&folder);
    return good;
}

static void usage(FILE *const to)
{
    fprintf(to, "usage: hm2replay [--verbose] [--json] [--test NAME] DIR...\n"
                "Replay folders of recorded firmware traces against the simulated card, clock by clock.\n"
                "  -t, --test NAME   only the test of this name\n"
                "  -j, --json        results as JSON\n"
                "  -v, --verbose     a line of totals for every folder\n"
                "  -h, --help        this text\n"
                "  -V, --version     the version\n"
                "Exit status: 0 all tests pass, 1 differences, 2 usage, 3 a folder cannot be read.\n");
}

static int parse_options(const int argc, char **const argv, struct settings *const settings)
{
    static const struct option options[] = {{"verbose", no_argument, NULL, 'v'},    {"json", no_argument, NULL, 'j'},
                                            {"test", required_argument, NULL, 't'}, {"help", no_argument, NULL, 'h'},
                                            {"version", no_argument, NULL, 'V'},    {NULL, 0, NULL, 0}};
    for (int c; (c = getopt_long(argc, argv, "vjt:hV", options, NULL)) >= 0;) {
        switch (c) {
        case 'v':
            settings->verbose = true;
            break;
        case 'j':
            settings->json = true;
            break;
        case 't':
            settings->test = optarg;
            break;
        case 'h':
            usage(stdout);
            exit(0);
        case 'V':
            puts("hm2replay " HM2_VERSION);
            exit(0);
        default:
            usage(stderr);
            return EXIT_USAGE;
        }
    }
    if (optind < argc)
        return 0;
    usage(stderr);
    return EXIT_USAGE;
}

int main(const int argc, char **const argv)
{
    struct settings settings = {0};
    const int bad_usage = parse_options(argc, argv, &settings);
    if (bad_usage)
        return bad_usage;
    struct replay_totals totals = {0};
    bool first_result = true, readable = true;
    if (settings.json)
        printf("{\n  \"tests\": [");
    for (int i = optind; i < argc; i++)
        readable = replay_one(argv[i], &settings, &first_result, &totals) && readable;
    if (settings.json)
        printf("\n  ],\n  \"passed\": %u,\n  \"failed\": %u\n}\n", totals.passed, totals.failed);
    else
        printf("%u passed, %u failed\n", totals.passed, totals.failed);
    if (settings.test && readable && totals.passed + totals.failed == 0) {
        fprintf(stderr, "hm2replay: no folder has a test \"%s\".\n", settings.test);
        return EXIT_USAGE;
    }
    if (!readable)
        return EXIT_UNREADABLE;
    return totals.failed ? EXIT_DIFFERENCE : 0;
}

/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Replay of recorded firmware traces against a simulated card, at clock resolution.
 *
 * A trace folder holds tables (tests.csv, events.csv; some kinds others). The folder's base name tells its kind, and
 * one row in replay_folders.c tells what the names in its events mean. Every register read, every edge of every
 * output that the trace names, and every sampled vector is compared; the first difference of a test is reported with
 * clock, name, expected and found value.
 *
 * The files come through a callback: nothing here opens files. Replay allocates and formats; it is not for a
 * realtime thread. Trace files are not trusted: sizes, numbers and names are checked.
 */
#ifndef SIM_REPLAY_H
#define SIM_REPLAY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/err.h>
#include <hm2/idrom.h>
#include <hm2/sim.h>

/* Where the files of a folder come from. */
struct replay_files {
    /* Whole file into memory from malloc(), one byte more than *len. 0; HM2_ERR_NOTFOUND when there is no such file
     * (and no message); any other error with one. */
    int (*load)(void *context, const char *name, char **text, size_t *len, struct hm2_diag *diag);
    /* Number `index` of the folder's files into name, false behind the last one. */
    bool (*list)(void *context, size_t index, char *name, size_t size);
    void *context;
};

/* One test has been done; difference is "" when it passed. */
typedef void (*replay_result_fn)(void *context, const char *test, bool passed, const char *difference);

struct replay_options {
    const char *only_test; /* NULL = all */
    replay_result_fn on_result;
    void *context;
};

struct replay_totals {
    unsigned passed, failed;
};

/* Replay a folder; folder is its base name. Differences are results, not errors: an error (with a sentence in diag)
 * means that the folder itself is of no known kind or cannot be read. Totals are added to. */
int HM2_MUST_CHECK replay_folder(const char *folder, const struct replay_files *files,
                                 const struct replay_options *options, struct replay_totals *totals,
                                 struct hm2_diag *diag);

/* A firmware image that traces were recorded with, by pin package name ("SVST8_4IM2_72"); false if unknown. */
bool replay_firmware(const char *name, struct hm2_image *image);

#endif

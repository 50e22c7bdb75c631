/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * hm2doctor: what of this computer, and of the way to the card, will cost cycles. Facts come from a state, which is
 * this computer or a folder that holds what another one looked like; checks judge facts and never change anything.
 */
#ifndef DOCTOR_H
#define DOCTOR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <hm2/err.h>
#include <hm2/link.h>

/* ---- facts ------------------------------------------------------------------------------------------------------- */

#define STATE_TEXT_BYTES 65536u
#define INTERFACE_BYTES  16u /* IFNAMSIZ */

struct state {
    const char *folder; /* NULL = this computer */
    const char *save;   /* what is read is written below this folder too; NULL = not */
    bool save_failed;
};

/* The text of a file, by its path from the root ("proc/cmdline"), NUL terminated and without the last line end; longer
 * than cap is cut. Paths that begin with "doctor/" are no files of a computer, but what it says when it is asked
 * (live.h); a folder has them as files. False when there is none. */
bool state_text(struct state *state, char *text, size_t cap, const char *path, ...)
    __attribute__((format(printf, 4, 5)));
/* The first number in it. */
bool state_number(struct state *state, long long *number, const char *path, ...) __attribute__((format(printf, 3, 4)));
/* The number behind a name at the beginning of a line of "name value" lines. */
bool text_named_number(const char *text, const char *name, long long *number);
/* Copy the word behind it. */
bool text_named_word(const char *text, const char *name, char *word, size_t cap);

/* ---- findings ---------------------------------------------------------------------------------------------------- */

enum grade {
    GRADE_OK,      /* as it should be */
    GRADE_UNKNOWN, /* could not be found out */
    GRADE_ADVICE,  /* costs time; cycles may be lost */
    GRADE_FAULT,   /* will cost cycles, or the card cannot be reached */
};

#define MAX_FINDINGS 64u

struct finding {
    const char *check; /* name of the check */
    enum grade grade;
    bool at_once; /* the remedy is a command that takes effect at once, and that is undone by a restart */
    char what[320];
    char remedy[320]; /* a command, or what to do; empty when nothing is to be done */
};

struct findings {
    struct finding list[MAX_FINDINGS];
    unsigned count;
};

/* Append one; NULL when there are too many. */
struct finding *find(struct findings *findings, const char *check, enum grade grade, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
/* Say what to do about it; nothing happens with NULL. */
void remedy(struct finding *finding, bool at_once, const char *format, ...) __attribute__((format(printf, 3, 4)));

/* ---- checks ------------------------------------------------------------------------------------------------------ */

struct patient {
    struct state *state;
    char interface[INTERFACE_BYTES]; /* empty when it could not be found */
    uint32_t card;                   /* IPv4 address, host byte order */
    char routes[STATE_TEXT_BYTES];   /* read by look_at_routes(); empty when there are none to be read */
    long period_us;
    struct findings *findings;
};

void check_computer(struct patient *patient);
void check_interface(struct patient *patient);
void check_way(struct patient *patient);
/* Read the routing table, which what follows needs. */
void look_at_routes(struct patient *patient);
/* The interface by which the card is reached. */
bool find_interface(struct patient *patient);

/* ---- round trips ------------------------------------------------------------------------------------------------- */

#define MAX_ROUNDS 1000000u

struct rounds {
    int64_t *paced_ns;   /* one request a period, the line at rest between them; sorted by rounds_sort() */
    int64_t *burst_ns;   /* each request at once behind the reply before */
    int64_t *spacing_ns; /* of two replies, whose requests were PAIR_NS apart */
    size_t paced, burst, spacing, lost;
};

#define PAIR_NS 50000

struct measuring {
    const char *card; /* address, as link_udp_open() takes it */
    long period_us;
    long seconds;
    unsigned reply_bytes;
};

/* How time passes by a link's clock. */
struct waiting {
    void (*until)(void *context, int64_t ns);
    void *context;
};

int rounds_measure_by(struct link *link, const struct waiting *waiting, const struct measuring *measuring,
                      struct rounds *rounds, struct hm2_diag *diag);
/* The same on this computer, with the priority of a servo thread where that is permitted. */
int rounds_measure(const struct measuring *measuring, struct rounds *rounds, struct hm2_diag *diag);
/* Lines "paced NS", "burst NS", "spacing NS" and "lost". */
int rounds_read(const char *path, struct rounds *rounds, struct hm2_diag *diag);
bool rounds_write(const char *path, const struct rounds *rounds);
void rounds_free(struct rounds *rounds);
/* Call before what follows. */
void rounds_sort(struct rounds *rounds);
int64_t rounds_percentile(const int64_t *sorted, size_t count, double percent);
/* Judge them against the period and name the pattern of delays. */
void check_rounds(struct patient *patient, const struct rounds *rounds);
void draw_rounds(FILE *out, const struct rounds *rounds, long period_us);

#endif

/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Measured round trips: from and to files, and what they say about the way. */
#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "doctor.h"

#define US         1e-3
#define NS_PER_US  1000
#define KINDS      3u
#define MAX_NS     1000000000000LL
#define LINE_BYTES 64u
/* What counts as a pattern: more than the scatter of an undisturbed line, which is some microseconds. */
#define WAKE_NS    15000
#define LATE_NS    100000
#define LATE_TIMES 4

/* ---- files --------------------------------------------------------------------------------------------------------
 */

struct kind {
    const char *name;
    int64_t **list;
    size_t *count;
};

static void kinds_of(struct rounds *const rounds, struct kind kinds[KINDS])
{
    kinds[0] = (struct kind){"paced", &rounds->paced_ns, &rounds->paced};
    kinds[1] = (struct kind){"burst", &rounds->burst_ns, &rounds->burst};
    kinds[2] = (struct kind){"spacing", &rounds->spacing_ns, &rounds->spacing};
}

static bool take_line(const char *const line, struct rounds *const rounds, const struct kind kinds[KINDS])
{
    if (strcmp(line, "lost\n") == 0)
        return rounds->lost++ < MAX_ROUNDS;
    for (unsigned i = 0; i < KINDS; i++) {
        const size_t name = strlen(kinds[i].name);
        char *end;
        if (strncmp(line, kinds[i].name, name) != 0 || line[name] != ' ')
            continue;
        errno = 0;
        const long long ns = strtoll(line + name, &end, 10);
        if (!*kinds[i].list || strcmp(end, "\n") != 0 || errno != 0 || ns < 0 || ns > MAX_NS ||
            *kinds[i].count >= MAX_ROUNDS)
            return false;
        (*kinds[i].list)[(*kinds[i].count)++] = ns;
        return true;
    }
    return false;
}

static bool make_room(struct rounds *const rounds)
{
    rounds->paced_ns = calloc(MAX_ROUNDS, sizeof(int64_t));
    rounds->burst_ns = calloc(MAX_ROUNDS, sizeof(int64_t));
    rounds->spacing_ns = calloc(MAX_ROUNDS, sizeof(int64_t));
    return rounds->paced_ns && rounds->burst_ns && rounds->spacing_ns;
}

int rounds_read(const char *const path, struct rounds *const rounds, struct hm2_diag *const diag)
{
    struct kind kinds[KINDS];
    char line[LINE_BYTES];
    unsigned number = 0;
    int err = 0;
    FILE *const file = fopen(path, "r");
    if (!file)
        return hm2_diag_add(diag, HM2_ERR_IO, "%s: %s", path, strerror(errno));
    kinds_of(rounds, kinds);
    if (!make_room(rounds))
        err = hm2_diag_add(diag, HM2_ERR_NOMEM, "%s: no memory", path);
    while (!err && fgets(line, sizeof line, file)) {
        number++;
        if (line[0] != '#' && !take_line(line, rounds, kinds))
            err = hm2_diag_add(
                diag, HM2_ERR_MALFORMED,
                "%s:%u: expected \"paced NS\", \"burst NS\", \"spacing NS\" or \"lost\", at most %u of each\n", path,
                number, MAX_ROUNDS);
    }
    fclose(file);
    return err;
}

bool rounds_write(const char *const path, const struct rounds *const rounds)
{
    struct rounds copy = *rounds;
    struct kind kinds[KINDS];
    FILE *const file = fopen(path, "w");
    if (!file)
        return false;
    kinds_of(&copy, kinds);
    for (unsigned i = 0; i < KINDS; i++)
        for (size_t k = 0; k < *kinds[i].count; k++)
            fprintf(file, "%s %" PRId64 "\n", kinds[i].name, (*kinds[i].list)[k]);
    for (size_t k = 0; k < rounds->lost; k++)
        fputs("lost\n", file);
    const bool bad = ferror(file) != 0;
    return fclose(file) == 0 && !bad;
}

void rounds_free(struct rounds *const rounds)
{
    free(rounds->paced_ns);
    free(rounds->burst_ns);
    free(rounds->spacing_ns);
}

/* ---- numbers ------------------------------------------------------------------------------------------------------
 */

static int compare(const void *const a, const void *const b)
{
    const int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

void rounds_sort(struct rounds *const rounds)
{
    struct kind kinds[KINDS];
    kinds_of(rounds, kinds);
    for (unsigned i = 0; i < KINDS; i++)
        if (*kinds[i].count > 0)
            qsort(*kinds[i].list, *kinds[i].count, sizeof(int64_t), compare);
}

int64_t rounds_percentile(const int64_t *const sorted, const size_t count, const double percent)
{
    if (count == 0)
        return 0;
    const size_t at = (size_t)((double)count * percent / 100.0);
    return sorted[at < count ? at : count - 1];
}

/* ---- what they say ------------------------------------------------------------------------------------------------
 */

/* Loopback has nothing that could be set. */
static bool has_port(const struct patient *const p)
{
    return p->interface[0] != '\0' && strcmp(p->interface, "lo") != 0;
}

static const char *port(const struct patient *const p)
{
    return has_port(p) ? p->interface : "INTERFACE";
}

static void check_answers(struct patient *const p, const struct rounds *const rounds)
{
    const size_t all = rounds->paced + rounds->lost;
    if (rounds->lost == 0)
        find(p->findings, "losses", GRADE_OK, "all of %zu requests were answered", all);
    else
        remedy(find(p->findings, "losses", GRADE_FAULT, "%zu of %zu requests were not answered within 10 ms",
                    rounds->lost, all),
               false, "replace the cable; look at ethtool -S %s for errors", port(p));
}

static void check_period(struct patient *const p, const struct rounds *const rounds)
{
    const int64_t period_ns = p->period_us * NS_PER_US;
    const int64_t median = rounds_percentile(rounds->paced_ns, rounds->paced, 50),
                  rare = rounds_percentile(rounds->paced_ns, rounds->paced, 99.9),
                  longest = rounds->paced_ns[rounds->paced - 1];
    const enum grade grade = longest > period_ns * 8 / 10 ? GRADE_FAULT
                             : longest > period_ns / 2    ? GRADE_ADVICE
                                                          : GRADE_OK;
    struct finding *const finding = find(
        p->findings, "round-trip", grade,
        "half of the replies came within %.0f us, 99.9 %% within %.0f us, the last after %.0f us of a period of %ld us",
        (double)median * US, (double)rare * US, (double)longest * US, p->period_us);
    if (grade != GRADE_OK)
        remedy(finding, false, "mend what is found here, or let the period be %.0f us", (double)longest * US * 2);
}

static void check_coalesced(struct patient *const p, const struct rounds *const rounds)
{
    if (rounds->spacing == 0 || rounds_percentile(rounds->spacing_ns, rounds->spacing, 50) > PAIR_NS / 4)
        return;
    remedy(find(p->findings, "pattern", GRADE_ADVICE,
                "replies to requests %d us apart arrive together: the network port holds interrupts back (coalescing)",
                PAIR_NS / NS_PER_US),
           has_port(p), "ethtool -C %s rx-usecs 0 tx-usecs 0", port(p));
}

static void check_sleep(struct patient *const p, const struct rounds *const rounds)
{
    const int64_t rested = rounds_percentile(rounds->paced_ns, rounds->paced, 50),
                  busy = rounds_percentile(rounds->burst_ns, rounds->burst, 50);
    if (rounds->burst == 0 || rested - busy < (busy / 4 > WAKE_NS ? busy / 4 : WAKE_NS))
        return;
    remedy(find(p->findings, "pattern", GRADE_ADVICE,
                "a reply after a pause takes %.0f us, at once behind another %.0f us: the line or the processor sleeps "
                "in between",
                (double)rested * US, (double)busy * US),
           has_port(p), "ethtool --set-eee %s eee off", port(p));
}

static void check_neighbours(struct patient *const p, const struct rounds *const rounds)
{
    const int64_t median = rounds_percentile(rounds->paced_ns, rounds->paced, 50);
    size_t late = 0;
    while (late < rounds->paced && rounds->paced_ns[rounds->paced - 1 - late] > median * LATE_TIMES &&
           rounds->paced_ns[rounds->paced - 1 - late] > median + LATE_NS)
        late++;
    if (late * 1000 < rounds->paced || late == 0)
        return;
    remedy(
        find(p->findings, "pattern", GRADE_ADVICE,
             "%.1f %% of the replies take more than %d times as long as usual: other packets are in the way, or other "
             "programs",
             100.0 * (double)late / (double)rounds->paced, LATE_TIMES),
        false, "give the card a network port, and the cycle a processor, of its own");
}

void check_rounds(struct patient *const p, const struct rounds *const rounds)
{
    if (rounds->paced == 0) {
        remedy(find(p->findings, "round-trip", GRADE_FAULT, "the card does not answer"), false,
               "check power, cable, and the address that its jumpers select (hm2flash --discover looks for cards)");
        return;
    }
    check_answers(p, rounds);
    check_period(p, rounds);
    check_coalesced(p, rounds);
    check_sleep(p, rounds);
    check_neighbours(p, rounds);
}

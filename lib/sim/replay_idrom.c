/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * idrom folders: firmware dumps and an index of what they contain. Every dump is decoded twice, by the library's
 * parser and by the few lines here, and both must agree with the index. The parser must say a word about a dump that
 * contradicts itself (the source has some), and may refuse only such a dump.
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "replay_trace.h"

#define MAX_NAME       128u
#define MODULES_TEXT   1024u
#define WORD_MODULES   1u /* header words (register map 1.3) */
#define WORD_PINS      2u
#define WORD_BOARD     4u
#define WORD_PORTS     7u
#define WORD_WIDTH     8u
#define WORD_CLOCK_LO  10u
#define WORD_CLOCK_HI  11u
#define MODULE_WORDS   3u
#define INDEX_COLUMNS  7u
#define TAG_IOPORT     0x03u
#define MAX_DESCRIPTOR 32u
#define MAX_SENTENCE   180u

/* Module names of the index. */
static const struct {
    uint8_t tag;
    const char *name;
} tag_names[] = {
    {0x01, "irq"},      {0x02, "watchdog"}, {0x03, "ioport"}, {0x04, "qcount"}, {0x05, "stepgen"}, {0x06, "pwm"},
    {0x07, "spi"},      {0x08, "sssi"},     {0x09, "uartt"},  {0x0A, "uartr"},  {0x0B, "addrx"},   {0x0C, "mqcount"},
    {0x0D, "mqcntsel"}, {0x0E, "bspi"},     {0x0F, "dbspi"},  {0x10, "dpll"},   {0x13, "tppwm"},   {0x14, "wavegen"},
    {0x15, "daqfifo"},  {0x16, "binosc"},   {0x17, "dmdma"},  {0x18, "biss"},   {0x19, "fabs"},    {0x1A, "hm2dpll"},
    {0x1B, "pktuartt"}, {0x1C, "pktuartr"}, {0x1F, "sigma5"}, {0x80, "led"},    {0xC0, "resmod"},  {0xC1, "sserial"},
    {0xC2, "twiddler"},
};

/* ---- what a dump says, by words
 * -------------------------------------------------------------------------------------- */

static const char *tag_name(const uint8_t tag, char *const room, const size_t size)
{
    for (size_t i = 0; i < sizeof(tag_names) / sizeof(tag_names[0]); i++)
        if (tag_names[i].tag == tag)
            return tag_names[i].name;
    snprintf(room, size, "%02X", tag);
    return room;
}

static uint32_t word_at(const struct hm2_image *const image, const uint32_t byte_offset, const uint32_t word)
{
    const uint64_t at = (uint64_t)byte_offset / 4 + word;
    return at < HM2_IDROM_WORDS ? image->rom[at] : 0;
}

/* "tag:instances[vVersion]" of every module, separated by spaces. */
static void module_list(const struct hm2_image *const image, char *const text, const size_t size)
{
    size_t used = 0;
    text[0] = '\0';
    for (uint32_t i = 0; i < MAX_DESCRIPTOR && used < size; i++) {
        const uint32_t word = word_at(image, image->rom[WORD_MODULES], i * MODULE_WORDS);
        if ((word & 0xFFu) == 0)
            return;
        char room[4], version[8] = "";
        if (word >> 8 & 0xFFu)
            snprintf(version, sizeof(version), "v%u", (unsigned)(word >> 8 & 0xFFu));
        const int n = snprintf(text + used, size - used, "%s%s:%u%s", i ? " " : "",
                               tag_name((uint8_t)word, room, sizeof(room)), (unsigned)(word >> 24), version);
        used += n > 0 ? (size_t)n : 0;
    }
}

/* The IOPort descriptor disagrees with the header, or the pin list ends before the last pin. */
static bool contradicts_itself(const struct hm2_image *const image)
{
    for (uint32_t i = 0; i < MAX_DESCRIPTOR; i++) {
        const uint32_t word = word_at(image, image->rom[WORD_MODULES], i * MODULE_WORDS);
        if ((word & 0xFFu) == 0)
            break;
        if ((word & 0xFFu) == TAG_IOPORT && word >> 24 != image->rom[WORD_PORTS])
            return true;
    }
    for (uint32_t pin = 0; pin < image->rom[WORD_WIDTH] && pin < HM2_MAX_PINS; pin++)
        if (word_at(image, image->rom[WORD_PINS], pin) >> 24 != TAG_IOPORT)
            return true;
    return false;
}

/* ---- the index
 * ---------------------------------------------------------------------------------------------------------- */

struct index_row {
    const char *board, *ports, *width, *clock_low, *clock_high, *modules;
};

static void compare_number(char *const difference, const char *const field, const uint32_t got,
                           const char *const expected)
{
    char text[12];
    snprintf(text, sizeof(text), "%" PRIu32, got);
    if (!difference[0] && strcmp(text, expected) != 0)
        snprintf(difference, REPLAY_TEXT, "%s expected %.20s, got %s", field, expected, text);
}

static void compare_words(const struct hm2_image *const image, const struct index_row *const row,
                          char *const difference)
{
    char modules[MODULES_TEXT], board[5];
    for (unsigned i = 0; i < 4; i++)
        board[i] = (char)(image->rom[WORD_BOARD] >> 8 * i & 0xFFu);
    board[4] = '\0';
    if (strcmp(board, row->board) != 0)
        snprintf(difference, REPLAY_TEXT, "board name expected %.20s, got %.4s", row->board, board);
    compare_number(difference, "IO ports", image->rom[WORD_PORTS], row->ports);
    compare_number(difference, "IO width", image->rom[WORD_WIDTH], row->width);
    compare_number(difference, "clock low", image->rom[WORD_CLOCK_LO], row->clock_low);
    compare_number(difference, "clock high", image->rom[WORD_CLOCK_HI], row->clock_high);
    module_list(image, modules, sizeof(modules));
    if (!difference[0] && strcmp(modules, row->modules) != 0)
        snprintf(difference, REPLAY_TEXT, "modules expected %.90s, got %.90s", row->modules, modules);
}

static void compare_parser(const struct hm2_image *const image, char *const difference)
{
    struct hm2_idrom *const idrom = calloc(1, sizeof(*idrom));
    struct hm2_diag *const diag = calloc(1, sizeof(*diag));
    if (idrom && diag && !difference[0]) {
        const bool refused = hm2_idrom_parse(image, NULL, idrom, diag) != 0;
        const bool contradiction = contradicts_itself(image);
        const size_t line = strcspn(diag->text, "\n");
        const size_t sentence = line < MAX_SENTENCE ? line : MAX_SENTENCE;
        if (refused && !contradiction)
            snprintf(difference, REPLAY_TEXT, "expected to parse, got: %.*s", (int)sentence, diag->text);
        else if (contradiction && diag->problems + diag->warnings == 0)
            snprintf(difference, REPLAY_TEXT, "expected a word about contradicting descriptors, got none");
        else if (!refused && (idrom->io_ports != image->rom[WORD_PORTS] || idrom->pin_count != image->rom[WORD_WIDTH] ||
                              idrom->clock_high_hz != image->rom[WORD_CLOCK_HI]))
            snprintf(difference, REPLAY_TEXT, "the parser and the words disagree");
    }
    free(idrom);
    free(diag);
}

static int check_dump(const struct replay_files *const files, const char *const file, const struct index_row *const row,
                      char *const difference, struct hm2_diag *const diag)
{
    char *text = NULL;
    size_t len = 0;
    struct hm2_image *const image = calloc(1, sizeof(*image));
    int err = image ? files->load(files->context, file, &text, &len, diag) : HM2_ERR_NOMEM;
    if (err == HM2_ERR_NOTFOUND) {
        snprintf(difference, REPLAY_TEXT, "the index names a file that is not there");
        err = 0;
    } else if (!err) {
        struct hm2_diag *const why = calloc(1, sizeof(*why));
        if (!why || hm2_image_from_text(text, len, image, why))
            snprintf(difference, REPLAY_TEXT, "expected a dump, got: %.180s", why ? why->text : "no memory");
        free(why);
        if (!difference[0])
            compare_words(image, row, difference);
        compare_parser(image, difference);
    }
    free(text);
    free(image);
    return err;
}

/* Dumps of the folder that the index does not name. */
static void report_strangers(const struct replay_files *const files, char **const seen, const size_t seen_count,
                             const struct replay_options *const options, struct replay_totals *const totals)
{
    char name[MAX_NAME];
    for (size_t i = 0; files->list && files->list(files->context, i, name, sizeof(name)); i++) {
        const size_t len = strlen(name);
        if (len < 4 || strcmp(name + len - 4, ".hex") != 0 || !replay_wanted(options, name))
            continue;
        bool known = false;
        for (size_t k = 0; k < seen_count && !known; k++)
            known = strcmp(seen[k], name) == 0;
        if (!known)
            replay_report(options, totals, name, "expected a line in index.csv, got none");
    }
}

static int index_columns(const struct replay_csv *const csv, int columns[INDEX_COLUMNS], struct hm2_diag *const diag)
{
    static const char *const names[INDEX_COLUMNS] = {"file",        "board",        "ioports", "iowidth",
                                                     "clocklow_hz", "clockhigh_hz", "modules"};
    for (unsigned i = 0; i < INDEX_COLUMNS; i++) {
        columns[i] = -1;
        for (unsigned c = 0; c < csv->columns; c++) /* the last header has an explanation behind its name */
            if (strncmp(csv->header[c], names[i], strlen(names[i])) == 0)
                columns[i] = (int)c;
        if (columns[i] < 0)
            return hm2_diag_add(diag, HM2_ERR_MALFORMED, "index.csv line 1: no column \"%s\".", names[i]);
    }
    return 0;
}

static int check_rows(struct replay_csv *const csv, const struct replay_files *const files,
                      const struct replay_options *const options, struct replay_totals *const totals,
                      struct hm2_diag *const diag)
{
    int c[INDEX_COLUMNS] = {0};
    int err = index_columns(csv, c, diag);
    char **const seen = calloc(REPLAY_MAX_TESTS, sizeof(*seen));
    size_t count = 0;
    if (!seen)
        return HM2_ERR_NOMEM;
    while (!err && count < REPLAY_MAX_TESTS) {
        const int got = replay_csv_row(csv, diag);
        if (got <= 0) {
            err = got;
            break;
        }
        char *const file = strdup(csv->field[c[0]]);
        char difference[REPLAY_TEXT] = "";
        if (!file) {
            err = HM2_ERR_NOMEM;
            break;
        }
        seen[count++] = file;
        if (!replay_wanted(options, file))
            continue;
        const struct index_row row = {csv->field[c[1]], csv->field[c[2]], csv->field[c[3]],
                                      csv->field[c[4]], csv->field[c[5]], csv->field[c[6]]};
        err = check_dump(files, file, &row, difference, diag);
        if (!err)
            replay_report(options, totals, file, difference);
    }
    if (!err)
        report_strangers(files, seen, count, options, totals);
    for (size_t i = 0; i < count; i++)
        free(seen[i]);
    free(seen);
    return err;
}

int replay_idrom(const struct replay_kind *const kind, const struct replay_files *const files,
                 const struct replay_options *const options, struct replay_totals *const totals,
                 struct hm2_diag *const diag)
{
    (void)kind;
    char *text = NULL;
    size_t len = 0;
    struct replay_csv csv;
    int err = files->load(files->context, "index.csv", &text, &len, diag);
    if (err == HM2_ERR_NOTFOUND)
        return hm2_diag_add(diag, err, "There is no index.csv in the folder.");
    if (!err)
        err = replay_csv_open(&csv, "index.csv", text, len, diag);
    if (!err)
        err = check_rows(&csv, files, options, totals, diag);
    free(text);
    return err;
}
